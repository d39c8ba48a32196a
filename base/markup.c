// Escaping for SVG and HTML.
#include "base/markup.h"

static const char *escape_of(unsigned char c)
{
    switch (c) {
    case '&':
        return "&amp;";
    case '<':
        return "&lt;";
    case '>':
        return "&gt;";
    case '"':
        return "&quot;";
    case '\'':
        return "&#39;";
    default:
        return (c < 0x20 && c != '\t' && c != '\n') || c == 0x7f ? "\xef\xbf\xbd" : NULL;
    }
}

void alb_markup_add(alb_text *markup, const char *plain)
{
    if (!plain)
        return;
    for (const unsigned char *s = (const unsigned char *)plain; *s;) {
        const int length = alb_text_sequence((const char *)s);
        const char *escape = length ? escape_of(*s) : "\xef\xbf\xbd";
        if (escape)
            alb_text_add(markup, "%s", escape);
        else
            alb_text_add_bytes(markup, s, (size_t)length);
        s += length ? length : 1;
    }
}

int alb_markup_length(const char *plain)
{
    int count = 0;
    for (const unsigned char *s = (const unsigned char *)plain; s && *s; count++) {
        const int length = alb_text_sequence((const char *)s);
        s += length ? length : 1;
    }
    return count;
}

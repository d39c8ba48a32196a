// Escaping for SVG and HTML. UTF-8 is checked after RFC 3629: shortest form only, no surrogates, up to U+10FFFF.
#include "base/markup.h"

// Bytes of the valid UTF-8 sequence that starts here; 0 where there is none. The text is NUL-terminated.
static int sequence_length(const unsigned char *s)
{
    if (s[0] < 0x80)
        return 1;
    const int length = s[0] >= 0xc2 && s[0] < 0xe0   ? 2
                       : (s[0] & 0xf0) == 0xe0       ? 3
                       : s[0] >= 0xf0 && s[0] < 0xf5 ? 4
                                                     : 0;
    for (int i = 1; i < length; i++)
        if ((s[i] & 0xc0) != 0x80)
            return 0;
    if ((s[0] == 0xe0 && s[1] < 0xa0) || (s[0] == 0xed && s[1] >= 0xa0) || (s[0] == 0xf0 && s[1] < 0x90) ||
        (s[0] == 0xf4 && s[1] >= 0x90))
        return 0;
    return length;
}

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
        const int length = sequence_length(s);
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
        const int length = sequence_length(s);
        s += length ? length : 1;
    }
    return count;
}

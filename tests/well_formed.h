// Whether a piece of SVG or HTML is well-formed: tags balanced, attributes quoted, no stray '<' or bare '&'.
#pragma once
#include <ctype.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>

static inline const char *malformed_at(const char *text, const char *why)
{
    printf("not well-formed (%s) at: %.60s\n", why, text);
    return NULL;
}

// Past one tag that starts at `s`; NULL where it is broken. *name is the element's, *closed whether it ends in "/>".
static inline const char *pass_tag(const char *s, char name[32], bool *closed)
{
    size_t n = strcspn(s + 1, " \t\n/>");
    if (n == 0 || n > 31)
        return malformed_at(s, "name");
    snprintf(name, 32, "%.*s", (int)n, s + 1);
    for (s += 1 + n; *s != '>' && strncmp(s, "/>", 2) != 0;) {
        s += strspn(s, " \t\n");
        n = strcspn(s, "= \t\n>/");
        if (n == 0 || s[n] != '=' || s[n + 1] != '"')
            return malformed_at(s, "attribute");
        s += n + 2;
        n = strcspn(s, "\"<");
        if (s[n] != '"')
            return malformed_at(s, "quote");
        s += n + 1;
    }
    *closed = *s == '/';
    return s + (*closed ? 2 : 1);
}

// Past a comment or a processing instruction that starts at `s`; `s` itself where none does, NULL where it is broken.
static inline const char *pass_aside(const char *s)
{
    const bool comment = strncmp(s, "<!--", 4) == 0;
    if (!comment && strncmp(s, "<?", 2) != 0)
        return s;
    const char *end = comment ? strstr(s + 4, "--") : strstr(s, "?>");
    if (!end || (comment && end[2] != '>'))
        return malformed_at(s, "aside");
    return end + (comment ? 3 : 2);
}

// One root element, perhaps after <!DOCTYPE html> or <?xml?>. Style sheets may hold anything but '<'.
static inline bool well_formed(const char *text)
{
    char open[64][32], name[32];
    int depth = 0, roots = 0;
    if (strncmp(text, "<!DOCTYPE html>", 15) == 0)
        text += 15;
    for (const char *s = text; *s;) {
        bool closed = false;
        const char *aside = pass_aside(s);
        if (!aside)
            return false;
        if (aside > s)
            s = aside;
        else if (strncmp(s, "</", 2) == 0) {
            const size_t n = strcspn(s, ">");
            if (depth == 0 || strncmp(open[depth - 1], s + 2, n - 2) != 0 || open[depth - 1][n - 2] != '\0')
                return malformed_at(s, "closes what is not open") != NULL;
            depth--, s += n + 1;
        } else if (*s == '<') {
            if (!(s = pass_tag(s, name, &closed)))
                return false;
            if (!closed && strcmp(name, "meta") != 0 && strcmp(name, "img") != 0) {
                if (depth == 64)
                    return malformed_at(s, "too deep") != NULL;
                roots += depth == 0;
                memcpy(open[depth++], name, sizeof name);
            }
        } else if (*s == '&') {
            const size_t n = strcspn(s, ";");
            if (n < 2 || n > 6)
                return malformed_at(s, "bare &") != NULL;
            s += n;
        } else if (depth == 0 && !isspace((unsigned char)*s))
            return malformed_at(s, "text outside") != NULL;
        else
            s++;
    }
    return depth == 0 && roots == 1;
}

static inline int occurrences(const char *text, const char *part)
{
    int count = 0;
    for (const char *s = text; (s = strstr(s, part)); s++)
        count++;
    return count;
}

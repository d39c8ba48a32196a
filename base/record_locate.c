// The place of a value in JSON text that a parser has accepted: walks the text along the path, past the values beside
// it. A key that is written with an escape is not recognised; the place is then the end of its object.
#include "base/record_locate.h"

#include <stdbool.h>
#include <stdio.h>
#include <string.h>

static const char *skip_space(const char *t) { return t + strspn(t, " \t\r\n"); }

static const char *skip_string(const char *t)
{
    for (t++; *t && *t != '"'; t++)
        if (*t == '\\' && t[1])
            t++;
    return *t ? t + 1 : t;
}

// Past one value of text that is known to be valid JSON.
static const char *skip_value(const char *t)
{
    t = skip_space(t);
    if (*t == '"')
        return skip_string(t);
    if (*t != '{' && *t != '[')
        return t + strcspn(t, ",]} \t\r\n");
    int depth = 0;
    do {
        if (*t == '"') {
            t = skip_string(t);
            continue;
        }
        depth += (*t == '{' || *t == '[') - (*t == '}' || *t == ']');
        t++;
    } while (depth > 0 && *t);
    return t;
}

// The text of the value that the path leads to (the key of a last step that is a key).
static const char *locate(const char *text, const alb_step *path, int depth)
{
    const char *t = skip_space(text);
    for (int i = 0; i < depth && *t; i++) {
        size_t index = 0;
        for (t = skip_space(t + 1); *t && *t != '}' && *t != ']'; index++) {
            const char *start = t;
            bool here = !path[i].key && index == path[i].index;
            if (path[i].key) {
                const size_t length = strlen(path[i].key);
                here = !strncmp(t + 1, path[i].key, length) && t[1 + length] == '"';
                t = skip_space(skip_space(skip_string(t)) + 1);
            }
            if (here) {
                if (i + 1 == depth)
                    t = start;
                break;
            }
            t = skip_space(skip_value(t));
            if (*t == ',')
                t = skip_space(t + 1);
        }
    }
    return t;
}

alb_place alb_record_locate(const char *text, const alb_step *path, int depth)
{
    alb_place place = {.line = 1, .column = 1};
    size_t size = 0;
    for (int i = 0; i < depth && size < sizeof place.name; i++) {
        char *end = place.name + size;
        const size_t room = sizeof place.name - size;
        size += (size_t)(path[i].key ? snprintf(end, room, "%s%s", i ? "." : "", path[i].key)
                                     : snprintf(end, room, "[%zu]", path[i].index));
    }
    const char *found = locate(text, path, depth);
    for (const char *t = text; t < found; t++) {
        place.column = *t == '\n' ? 1 : place.column + 1;
        place.line += *t == '\n';
    }
    return place;
}

#include "base/error.h"
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

bool alb_fail(alb_error *error, alb_status status, const char *format, ...)
{
    if (!error || error->status != ALB_OK)
        return false;
    error->status = status;
    char text[8192];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    // Too long, most likely for a path: the middle gives way, so that the end still says what is wrong.
    const size_t length = strlen(text), half = sizeof error->text / 2 - 4;
    if (length < sizeof error->text)
        memcpy(error->text, text, length + 1);
    else
        snprintf(error->text, sizeof error->text, "%.*s ... %s", (int)half, text, text + length - half);
    // One failure, one line: names that come from files may hold anything.
    for (char *c = error->text; *c; c++)
        if ((unsigned char)*c < 0x20 || *c == 0x7f)
            *c = ' ';
    return false;
}

#include "base/error.h"
#include <stdarg.h>
#include <stdio.h>

bool alb_fail(alb_error *error, alb_status status, const char *format, ...)
{
    if (!error || error->status != ALB_OK)
        return false;
    error->status = status;
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(error->text, sizeof error->text, format, arguments);
    va_end(arguments);
    // One failure, one line: names that come from files may hold anything.
    for (char *c = error->text; *c; c++)
        if ((unsigned char)*c < 0x20 || *c == 0x7f)
            *c = ' ';
    return false;
}

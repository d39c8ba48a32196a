// What cmocka 1.1.5 lacks: double comparisons that print what was found, and skipping with a reason.
#pragma once
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "base/error.h"

// |a - b| <= tolerance, with both printed when it is not so.
#define check_near(a, b, tolerance) check_near_at((a), (b), (tolerance), #a, __FILE__, __LINE__)
// |a - b| <= relative * |b|
#define check_relative(a, b, relative) check_near_at((a), (b), (relative)*fabs(b), #a, __FILE__, __LINE__)
// a < b
#define check_below(a, b) check_below_at((a), (b), #a, __FILE__, __LINE__)
// The call returned true; prints the error otherwise.
#define check_ok(call, error) check_ok_at((call), (error), #call, __FILE__, __LINE__)
// The call returned false with the status, and its text contains `part`.
#define check_fails(call, error, status_, part)                                                                        \
    check_fails_at((call), (error), (status_), (part), #call, __FILE__, __LINE__)

static inline void check_near_at(double a, double b, double tolerance, const char *what, const char *file, int line)
{
    if (!(fabs(a - b) <= tolerance)) {
        print_error("%s: found %.10g, expected %.10g +- %.3g\n", what, a, b, tolerance);
        _fail(file, line);
    }
}

static inline void check_below_at(double a, double b, const char *what, const char *file, int line)
{
    if (!(a < b)) {
        print_error("%s: found %.10g, expected less than %.10g\n", what, a, b);
        _fail(file, line);
    }
}

static inline void check_ok_at(bool ok, const alb_error *error, const char *what, const char *file, int line)
{
    if (!ok) {
        print_error("%s: status %d: %s\n", what, (int)error->status, error->text);
        _fail(file, line);
    }
}

static inline void check_fails_at(bool ok, alb_error *error, alb_status status, const char *part, const char *what,
                                  const char *file, int line)
{
    if (ok || error->status != status || !strstr(error->text, part)) {
        print_error("%s: returned %s, status %d (expected %d): '%s' (expected to contain '%s')\n", what,
                    ok ? "true" : "false", (int)error->status, (int)status, error->text, part);
        _fail(file, line);
    }
    *error = (alb_error){0};
}

// Errors as values: a fixed-size struct on the caller's stack, carried out through the last argument.
#pragma once
#include <stdbool.h>

// The codes are the exit codes of the program.
typedef enum alb_status {
    ALB_OK = 0,
    ALB_DIFFERS = 1,   // a comparison found a difference, or a result is stale
    ALB_USAGE = 2,     // the command line is wrong
    ALB_ACCESS = 3,    // a file cannot be opened, read or written
    ALB_BAD_DATA = 4,  // the content of an input is wrong
    ALB_UNDECIDED = 5, // the measurement does not decide
    ALB_NO_MEMORY = 6,
    ALB_INTERNAL = 7,
} alb_status;

typedef struct alb_error {
    alb_status status;
    char text[1024];
} alb_error;

// Records status and text (printf format) unless an error is already there: the first one wins. `error` may be NULL.
// Always returns false, so that a function can `return alb_fail(...)`.
bool alb_fail(alb_error *error, alb_status status, const char *format, ...) __attribute__((format(printf, 3, 4)));

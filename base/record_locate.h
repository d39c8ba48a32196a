// Where a value stands in the text of a record.
#pragma once
#include <stddef.h>

typedef struct alb_step {
    const char *key; // NULL: list item
    size_t index;
} alb_step;

typedef struct alb_place {
    int line, column; // of the value, or of the key where the last step is one; from 1, columns in bytes
    char name[512];   // the path as text, a.b[3]; cut where it is longer
} alb_place;

// The place that the path leads to in text that is valid JSON and ends with a NUL.
alb_place alb_record_locate(const char *text, const alb_step *path, int depth);

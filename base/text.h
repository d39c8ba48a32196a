// A growing piece of text. Zero is empty; append never fails loudly: the first failure is kept in `failed` and
// reported by whoever writes the text out.
#pragma once
#include <stdbool.h>
#include <stddef.h>

typedef struct alb_text {
    char *bytes; // always NUL-terminated once anything was appended; NULL when empty
    size_t size, capacity;
    bool failed; // memory ran out: the text is incomplete and must not be used
} alb_text;

void alb_text_add(alb_text *text, const char *format, ...) __attribute__((format(printf, 2, 3)));
void alb_text_add_bytes(alb_text *text, const void *bytes, size_t size);
void alb_text_free(alb_text *text);
// Bytes of the valid UTF-8 sequence that starts here; 0 where there is none. The text is NUL-terminated.
int alb_text_sequence(const char *at);

// JSON written as a stream: open, put, close. Keys are NULL inside lists. Numbers print in the shortest form that reads
// back to the same double; a number that is not finite prints as null.
#pragma once
#include "base/error.h"
#include "base/file.h"
#include "base/text.h"

typedef struct alb_json {
    alb_text text;
    int depth;
    bool started; // something stands before in the open object or list
} alb_json;

// What a derived file says of its origin: no clock, host or absolute path.
typedef struct alb_provenance {
    const char *command; // "fit"
    char options[1024];  // the effective options in full, as text
    struct {
        char name[256]; // last component of the path
        char sha256[ALB_HASH_SIZE];
    } inputs[64];
    int input_count;
} alb_provenance;

// Hashes the file and adds it to the inputs, once however often it is named.
bool alb_provenance_add(alb_provenance *provenance, const char *path, alb_error *error);

// Opens the top object and writes "format": 1 and, where given, the provenance.
void alb_json_begin(alb_json *json, const alb_provenance *provenance);
void alb_json_object(alb_json *json, const char *key);
void alb_json_list(alb_json *json, const char *key);
void alb_json_end_object(alb_json *json);
void alb_json_end_list(alb_json *json);
void alb_json_number(alb_json *json, const char *key, double value);
void alb_json_integer(alb_json *json, const char *key, long value);
void alb_json_boolean(alb_json *json, const char *key, bool value);
void alb_json_string(alb_json *json, const char *key, const char *value);
void alb_json_numbers(alb_json *json, const char *key, const double *values, size_t count);
// {"value": v, "sd": s}
void alb_json_estimate(alb_json *json, const char *key, double value, double sd);
// Closes the top object, writes the file atomically, frees.
bool alb_json_write(alb_json *json, const char *path, alb_error *error);
// Closes the top object and prints to standard output, frees.
bool alb_json_print(alb_json *json, alb_error *error);
void alb_json_free(alb_json *json);

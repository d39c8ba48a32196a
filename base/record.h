// JSON records read strictly: an unknown key, a wrong type or a value out of range is an error that names the file, the
// line and column, and the path of the value. Reading is through alb_node, a cheap value that borrows from the record.
#pragma once
#include "base/error.h"
#include <stddef.h>

typedef struct alb_record alb_record; // one parsed file

// A value inside a record. Valid as long as the record lives.
typedef struct alb_node {
    const alb_record *record;
    const void *value;
} alb_node;

// Parses a file; NULL on failure. Refuses duplicate keys, trailing text, non-UTF-8 and nesting beyond 2048.
alb_record *alb_record_read(const char *path, alb_error *error);
// Parses bytes; `name` is what errors call them.
alb_record *alb_record_parse(const char *name, const char *bytes, size_t size, alb_error *error);
void alb_record_free(alb_record *record);
// The top object; requires "format": 1 there and fails otherwise.
bool alb_record_root(alb_node *root, const alb_record *record, alb_error *error);

// Fails unless every key of the object is one of the space-separated `keys`.
bool alb_node_allow(alb_node object, const char *keys, alb_error *error);
bool alb_node_has(alb_node object, const char *key);
bool alb_node_null(alb_node object, const char *key);    // null stands there
bool alb_node_is_text(alb_node object, const char *key); // a text does
bool alb_node_item_null(alb_node list, size_t i);
// Required values. Numbers must be finite and within [minimum, maximum].
bool alb_node_number(double *out, alb_node object, const char *key, double minimum, double maximum, alb_error *error);
bool alb_node_integer(long *out, alb_node object, const char *key, long minimum, long maximum, alb_error *error);
bool alb_node_boolean(bool *out, alb_node object, const char *key, alb_error *error);
bool alb_node_text(const char **out, alb_node object, const char *key, alb_error *error); // borrowed
// Text that is one of `count` names; its index.
bool alb_node_choice(int *out, alb_node object, const char *key, const char *const *names, int count, alb_error *error);
// Exactly `count` numbers.
bool alb_node_numbers(double *out, size_t count, alb_node object, const char *key, double minimum, double maximum,
                      alb_error *error);
bool alb_node_object(alb_node *out, alb_node object, const char *key, alb_error *error);
bool alb_node_list(alb_node *out, size_t *count, alb_node object, const char *key, alb_error *error);
// Item i of a list (any type), and that item read as a number or text.
alb_node alb_node_item(alb_node list, size_t i);
bool alb_node_item_number(double *out, alb_node list, size_t i, double minimum, double maximum, alb_error *error);
// Item i of a list, required to be a list of exactly `count` numbers.
bool alb_node_item_numbers(double *out, size_t count, alb_node list, size_t i, double minimum, double maximum,
                           alb_error *error);
bool alb_node_item_text(const char **out, alb_node list, size_t i, alb_error *error);
// Item i of a list, required to be an object.
bool alb_node_item_object(alb_node *out, alb_node list, size_t i, alb_error *error);
// Number of keys of an object, and key i in the order of the file (borrowed).
size_t alb_node_key_count(alb_node object);
const char *alb_node_key(alb_node object, size_t i);
// ALB_BAD_DATA with "file:line:column: path: " before the message; key may be NULL (the node itself).
bool alb_node_fail(alb_error *error, alb_node node, const char *key, const char *format, ...)
    __attribute__((format(printf, 4, 5)));

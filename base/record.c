// JSON records by jansson. The tree holds no positions, so an error finds the value's path by searching the tree for it
// and then its line and column by walking the text along that path (record_locate.c).
#include "base/record.h"
#include "base/file.h"
#include "base/memory.h"
#include "base/record_locate.h"
#include <jansson.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { DEPTH_MAX = 64 };

struct alb_record {
    char *name, *text;
    size_t size;
    json_t *top;
};

alb_record *alb_record_parse(const char *name, const char *bytes, size_t size, alb_error *error)
{
    alb_record *record = alb_allocate(1, sizeof *record, error);
    if (!record)
        return NULL;
    record->name = strdup(name);
    record->text = alb_allocate(size + 1, 1, error);
    if (!record->name || !record->text) {
        alb_fail(error, ALB_NO_MEMORY, "%s: out of memory", name);
        goto failed;
    }
    memcpy(record->text, bytes, size);
    record->size = size;
    if (memchr(bytes, '\0', size)) { // jansson takes a NUL behind a number for the end
        alb_fail(error, ALB_BAD_DATA, "%s: not valid JSON: a NUL byte", name);
        goto failed;
    }
    json_error_t problem;
    record->top = json_loadb(bytes, size, JSON_REJECT_DUPLICATES | JSON_DECODE_ANY | JSON_ALLOW_NUL, &problem);
    if (!record->top) {
        alb_fail(error, ALB_BAD_DATA, "%s:%d:%d: not valid JSON: %s", name, problem.line > 0 ? problem.line : 1,
                 problem.column > 0 ? problem.column : 1, problem.text);
        goto failed;
    }
    return record;
failed:
    alb_record_free(record);
    return NULL;
}

alb_record *alb_record_read(const char *path, alb_error *error)
{
    char *bytes = NULL;
    size_t size = 0;
    if (!alb_file_read(&bytes, &size, path, error))
        return NULL;
    alb_record *record = alb_record_parse(path, bytes, size, error);
    free(bytes);
    return record;
}

void alb_record_free(alb_record *record)
{
    if (!record)
        return;
    json_decref(record->top);
    free(record->name);
    free(record->text);
    free(record);
}

// The steps from the tree to the value wanted and how many they are; -1 where it lies deeper than DEPTH_MAX.
static int find(const json_t *tree, const json_t *wanted, alb_step *path, int depth)
{
    if (tree == wanted)
        return depth;
    if (depth == DEPTH_MAX)
        return -1;
    const char *key;
    json_t *value;
    size_t index;
    int found;
    if (json_is_object(tree)) {
        for (void *i = json_object_iter((json_t *)tree); i; i = json_object_iter_next((json_t *)tree, i)) {
            key = json_object_iter_key(i);
            path[depth] = (alb_step){key, 0};
            if ((found = find(json_object_iter_value(i), wanted, path, depth + 1)) >= 0)
                return found;
        }
    } else if (json_is_array(tree))
        json_array_foreach(tree, index, value)
        {
            path[depth] = (alb_step){NULL, index};
            if ((found = find(value, wanted, path, depth + 1)) >= 0)
                return found;
        }
    return -1;
}

// key, or item: of the node, where the error is about one of its values; NULL: about the node itself.
static bool fail_at(alb_error *error, alb_node node, const char *key, const size_t *item, const char *message)
{
    alb_step path[DEPTH_MAX + 1];
    int depth = find(node.record->top, node.value, path, 0);
    if (depth < 0)
        return alb_fail(error, ALB_BAD_DATA, "%s: %s", node.record->name, message);
    if (key && json_is_object((const json_t *)node.value) && json_object_get(node.value, key))
        path[depth++] = (alb_step){key, 0};
    if (item)
        path[depth++] = (alb_step){NULL, *item};
    const alb_place place = alb_record_locate(node.record->text, path, depth);
    return alb_fail(error, ALB_BAD_DATA, "%s:%d:%d: %s%s%s", node.record->name, place.line, place.column, place.name,
                    *place.name ? ": " : "", message);
}

bool alb_node_fail(alb_error *error, alb_node node, const char *key, const char *format, ...)
{
    char message[512];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(message, sizeof message, format, arguments);
    va_end(arguments);
    return fail_at(error, node, key, NULL, message);
}

bool alb_record_root(alb_node *root, const alb_record *record, alb_error *error)
{
    *root = (alb_node){record, record->top};
    if (!json_is_object(record->top))
        return alb_node_fail(error, *root, NULL, "expected an object at the top");
    long format;
    return alb_node_integer(&format, *root, "format", 1, 1, error);
}

bool alb_node_allow(alb_node object, const char *keys, alb_error *error)
{
    if (!json_is_object((const json_t *)object.value))
        return alb_node_fail(error, object, NULL, "expected an object");
    for (size_t i = 0; i < alb_node_key_count(object); i++) {
        const char *key = alb_node_key(object, i);
        const size_t length = strlen(key);
        bool known = false;
        for (const char *k = keys; *k && !known; k += strspn(k, " ")) {
            const size_t size = strcspn(k, " ");
            known = size == length && !strncmp(k, key, size);
            k += size;
        }
        if (!known)
            return alb_node_fail(error, object, key, "unknown key; known here: %s", keys);
    }
    return true;
}

bool alb_node_has(alb_node object, const char *key) { return json_object_get(object.value, key) != NULL; }

static const char *type_name(const json_t *value)
{
    if (!value)
        return "nothing";
    static const char *const names[] = {"an object", "a list", "text", "a number", "a number", "true", "false", "null"};
    return names[json_typeof(value)];
}

static const json_t *member(alb_node object, const char *key, alb_error *error)
{
    if (!json_is_object((const json_t *)object.value)) {
        alb_node_fail(error, object, NULL, "expected an object, found %s", type_name(object.value));
        return NULL;
    }
    const json_t *value = json_object_get(object.value, key);
    if (!value)
        alb_node_fail(error, object, NULL, "key \"%s\" is missing", key);
    return value;
}

// The member, required to be of the type; `expected` is what the error calls it.
static const json_t *member_of(alb_node object, const char *key, json_type type, const char *expected, alb_error *error)
{
    const json_t *value = member(object, key, error);
    if (!value || json_typeof(value) == type)
        return value;
    alb_node_fail(error, object, key, "expected %s, found %s", expected, type_name(value));
    return NULL;
}

// A number in bounds, or why not in message.
static bool number_of(double *out, const json_t *value, double minimum, double maximum, char message[128])
{
    if (!json_is_number(value)) {
        snprintf(message, 128, "expected a number, found %s", type_name(value));
        return false;
    }
    const double number = json_number_value(value);
    if (!(number >= minimum && number <= maximum)) {
        snprintf(message, 128, "found %.9g, expected a number from %.9g to %.9g", number, minimum, maximum);
        return false;
    }
    *out = number;
    return true;
}

bool alb_node_null(alb_node object, const char *key) { return json_is_null(json_object_get(object.value, key)); }

bool alb_node_is_text(alb_node object, const char *key) { return json_is_string(json_object_get(object.value, key)); }

bool alb_node_item_null(alb_node list, size_t i) { return json_is_null(json_array_get(list.value, i)); }

bool alb_node_number(double *out, alb_node object, const char *key, double minimum, double maximum, alb_error *error)
{
    const json_t *value = member(object, key, error);
    char message[128];
    if (!value)
        return false;
    return number_of(out, value, minimum, maximum, message) || alb_node_fail(error, object, key, "%s", message);
}

bool alb_node_integer(long *out, alb_node object, const char *key, long minimum, long maximum, alb_error *error)
{
    const json_t *value = member(object, key, error);
    if (!value)
        return false;
    if (!json_is_integer(value))
        return alb_node_fail(error, object, key, "expected a whole number, found %s",
                             json_is_real(value) ? "a fraction" : type_name(value));
    const json_int_t number = json_integer_value(value);
    if (number < minimum || number > maximum)
        return alb_node_fail(error, object, key, "found %lld, expected %ld to %ld", (long long)number, minimum,
                             maximum);
    *out = (long)number;
    return true;
}

bool alb_node_boolean(bool *out, alb_node object, const char *key, alb_error *error)
{
    const json_t *value = member(object, key, error);
    if (!value)
        return false;
    if (!json_is_boolean(value))
        return alb_node_fail(error, object, key, "expected true or false, found %s", type_name(value));
    *out = json_is_true(value);
    return true;
}

bool alb_node_text(const char **out, alb_node object, const char *key, alb_error *error)
{
    const json_t *value = member_of(object, key, JSON_STRING, "text", error);
    if (!value)
        return false;
    if (strlen(json_string_value(value)) != json_string_length(value))
        return alb_node_fail(error, object, key, "text with a NUL character");
    *out = json_string_value(value);
    return true;
}

bool alb_node_choice(int *out, alb_node object, const char *key, const char *const *names, int count, alb_error *error)
{
    const char *text;
    if (!alb_node_text(&text, object, key, error))
        return false;
    for (int i = 0; i < count; i++)
        if (!strcmp(text, names[i]))
            return *out = i, true;
    char known[128] = "";
    for (int i = 0; i < count; i++)
        snprintf(known + strlen(known), sizeof known - strlen(known), "%s%s", i ? ", " : "", names[i]);
    return alb_node_fail(error, object, key, "found \"%.40s\", expected one of %s", text, known);
}

bool alb_node_list(alb_node *out, size_t *count, alb_node object, const char *key, alb_error *error)
{
    const json_t *value = member_of(object, key, JSON_ARRAY, "a list", error);
    if (!value)
        return false;
    *out = (alb_node){object.record, value};
    *count = json_array_size(value);
    return true;
}

bool alb_node_object(alb_node *out, alb_node object, const char *key, alb_error *error)
{
    const json_t *value = member_of(object, key, JSON_OBJECT, "an object", error);
    if (!value)
        return false;
    *out = (alb_node){object.record, value};
    return true;
}

bool alb_node_numbers(double *out, size_t count, alb_node object, const char *key, double minimum, double maximum,
                      alb_error *error)
{
    alb_node list;
    size_t found;
    if (!alb_node_list(&list, &found, object, key, error))
        return false;
    if (found != count)
        return alb_node_fail(error, object, key, "found %zu numbers, expected %zu", found, count);
    for (size_t i = 0; i < count; i++)
        if (!alb_node_item_number(&out[i], list, i, minimum, maximum, error))
            return false;
    return true;
}

alb_node alb_node_item(alb_node list, size_t i) { return (alb_node){list.record, json_array_get(list.value, i)}; }

static bool item_fail(alb_error *error, alb_node list, size_t i, const char *message)
{
    return fail_at(error, list, NULL, &i, message);
}

bool alb_node_item_number(double *out, alb_node list, size_t i, double minimum, double maximum, alb_error *error)
{
    char message[128];
    return number_of(out, json_array_get(list.value, i), minimum, maximum, message) ||
           item_fail(error, list, i, message);
}

bool alb_node_item_numbers(double *out, size_t count, alb_node list, size_t i, double minimum, double maximum,
                           alb_error *error)
{
    const alb_node row = alb_node_item(list, i);
    char message[128];
    if (!json_is_array((const json_t *)row.value))
        snprintf(message, sizeof message, "expected a list of %zu numbers, found %s", count, type_name(row.value));
    else if (json_array_size(row.value) != count)
        snprintf(message, sizeof message, "found %zu numbers, expected %zu", json_array_size(row.value), count);
    else {
        for (size_t k = 0; k < count; k++)
            if (!alb_node_item_number(&out[k], row, k, minimum, maximum, error))
                return false;
        return true;
    }
    return item_fail(error, list, i, message);
}

bool alb_node_item_text(const char **out, alb_node list, size_t i, alb_error *error)
{
    const json_t *value = json_array_get(list.value, i);
    if (!json_is_string(value) || strlen(json_string_value(value)) != json_string_length(value))
        return item_fail(error, list, i, "expected text");
    *out = json_string_value(value);
    return true;
}

bool alb_node_item_object(alb_node *out, alb_node list, size_t i, alb_error *error)
{
    const json_t *value = json_array_get(list.value, i);
    if (!json_is_object(value))
        return item_fail(error, list, i, "expected an object");
    *out = (alb_node){list.record, value};
    return true;
}

size_t alb_node_key_count(alb_node object) { return json_object_size(object.value); }

const char *alb_node_key(alb_node object, size_t i)
{
    void *at = json_object_iter((json_t *)object.value);
    while (i-- && at)
        at = json_object_iter_next((json_t *)object.value, at);
    return at ? json_object_iter_key(at) : NULL;
}

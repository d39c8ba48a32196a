#include "base/json.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static void string(alb_text *text, const char *value)
{
    alb_text_add(text, "\"");
    for (const char *c = value; *c;) {
        const unsigned char byte = (unsigned char)*c;
        const int size = alb_text_sequence(c);
        if (byte == '"' || byte == '\\')
            alb_text_add(text, "\\%c", byte);
        else if (byte < 0x20)
            alb_text_add(text, "\\u%04x", byte);
        else if (size)
            alb_text_add_bytes(text, c, (size_t)size);
        else // file names may hold anything; JSON holds UTF-8 alone
            alb_text_add(text, "\xef\xbf\xbd");
        c += size ? size : 1;
    }
    alb_text_add(text, "\"");
}

// Separator, line break and indentation, key.
static void start(alb_json *json, const char *key)
{
    if (json->depth)
        alb_text_add(&json->text, "%s\n%*s", json->started ? "," : "", 2 * json->depth, "");
    json->started = true;
    if (key) {
        string(&json->text, key);
        alb_text_add(&json->text, ": ");
    }
}

static void open(alb_json *json, const char *key, const char *bracket)
{
    start(json, key);
    alb_text_add(&json->text, "%s", bracket);
    json->depth++;
    json->started = false;
}

static void close(alb_json *json, const char *bracket)
{
    json->depth--;
    if (json->started)
        alb_text_add(&json->text, "\n%*s", 2 * json->depth, "");
    alb_text_add(&json->text, "%s", bracket);
    json->started = true;
}

static void number(alb_text *text, double value)
{
    char digits[40];
    if (!isfinite(value)) {
        alb_text_add(text, "null");
        return;
    }
    for (int precision = 15; precision <= 17; precision++) {
        snprintf(digits, sizeof digits, "%.*g", precision, value);
        if (strtod(digits, NULL) == value)
            break;
    }
    alb_text_add(text, "%s", digits);
}

void alb_json_object(alb_json *json, const char *key) { open(json, key, "{"); }
void alb_json_list(alb_json *json, const char *key) { open(json, key, "["); }
void alb_json_end_object(alb_json *json) { close(json, "}"); }
void alb_json_end_list(alb_json *json) { close(json, "]"); }

void alb_json_number(alb_json *json, const char *key, double value)
{
    start(json, key);
    number(&json->text, value);
}

void alb_json_integer(alb_json *json, const char *key, long value)
{
    start(json, key);
    alb_text_add(&json->text, "%ld", value);
}

void alb_json_boolean(alb_json *json, const char *key, bool value)
{
    start(json, key);
    alb_text_add(&json->text, value ? "true" : "false");
}

void alb_json_string(alb_json *json, const char *key, const char *value)
{
    start(json, key);
    string(&json->text, value);
}

void alb_json_numbers(alb_json *json, const char *key, const double *values, size_t count)
{
    start(json, key);
    alb_text_add(&json->text, "[");
    for (size_t i = 0; i < count; i++) {
        alb_text_add(&json->text, i ? ", " : "");
        number(&json->text, values[i]);
    }
    alb_text_add(&json->text, "]");
}

void alb_json_estimate(alb_json *json, const char *key, double value, double sd)
{
    start(json, key);
    alb_text_add(&json->text, "{\"value\": ");
    number(&json->text, value);
    alb_text_add(&json->text, ", \"sd\": ");
    number(&json->text, sd);
    alb_text_add(&json->text, "}");
}

bool alb_provenance_add(alb_provenance *provenance, const char *path, alb_error *error)
{
    const int count = provenance->input_count, most = (int)(sizeof provenance->inputs / sizeof provenance->inputs[0]);
    const char *name = alb_path_name(path);
    char sha256[ALB_HASH_SIZE];
    if (!alb_hash_file(sha256, path, error))
        return false;
    for (int i = 0; i < count; i++)
        if (!strcmp(provenance->inputs[i].sha256, sha256) && !strcmp(provenance->inputs[i].name, name))
            return true;
    if (count == most)
        return alb_fail(error, ALB_BAD_DATA, "%s: more than the %d different input files that a result can name", path,
                        most);
    snprintf(provenance->inputs[count].name, sizeof provenance->inputs[count].name, "%.255s", name);
    memcpy(provenance->inputs[count].sha256, sha256, sizeof sha256);
    provenance->input_count++;
    return true;
}

void alb_json_begin(alb_json *json, const alb_provenance *provenance)
{
    *json = (alb_json){0};
    alb_json_object(json, NULL);
    alb_json_integer(json, "format", 1);
    if (!provenance)
        return;
    alb_json_object(json, "provenance");
    alb_json_string(json, "alabaster", ALB_VERSION);
    alb_json_string(json, "command", provenance->command);
    alb_json_string(json, "options", provenance->options);
    alb_json_list(json, "inputs");
    for (int i = 0; i < provenance->input_count; i++) {
        alb_json_object(json, NULL);
        alb_json_string(json, "name", provenance->inputs[i].name);
        alb_json_string(json, "sha256", provenance->inputs[i].sha256);
        alb_json_end_object(json);
    }
    alb_json_end_list(json);
    alb_json_end_object(json);
}

bool alb_json_write(alb_json *json, const char *path, alb_error *error)
{
    alb_json_end_object(json);
    alb_text_add(&json->text, "\n");
    const bool ok = alb_file_write_text(path, &json->text, error);
    alb_json_free(json);
    return ok;
}

bool alb_json_print(alb_json *json, alb_error *error)
{
    alb_json_end_object(json);
    alb_text_add(&json->text, "\n");
    bool ok = !json->text.failed || alb_fail(error, ALB_NO_MEMORY, "out of memory while the result was printed");
    if (ok && fwrite(json->text.bytes, 1, json->text.size, stdout) != json->text.size)
        ok = alb_fail(error, ALB_ACCESS, "standard output cannot be written");
    alb_json_free(json);
    return ok;
}

void alb_json_free(alb_json *json)
{
    alb_text_free(&json->text);
    *json = (alb_json){0};
}

// Command lines read against a table of options.
#include "base/command.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

static const alb_option *named(const alb_option *options, int count, const char *name, size_t length)
{
    for (int i = 0; i < count; i++)
        if (options[i].name && strlen(options[i].name) == length && !strncmp(options[i].name, name, length))
            return &options[i];
    return NULL;
}

static bool read_named(const alb_option *options, int count, char **argv, int argc, int *at, alb_error *error)
{
    const char *argument = argv[*at], *equals = strchr(argument, '=');
    const size_t length = equals ? (size_t)(equals - argument) : strlen(argument);
    const alb_option *option = named(options, count, argument, length);
    if (!option)
        return alb_fail(error, ALB_USAGE, "unknown option %.*s", (int)(length < 80 ? length : 80), argument);
    if (option->flag) {
        *option->flag = true;
        return !equals || alb_fail(error, ALB_USAGE, "option %s takes no value", option->name);
    }
    if (*option->value)
        return alb_fail(error, ALB_USAGE, "option %s is given twice", option->name);
    if (!equals && ++*at >= argc)
        return alb_fail(error, ALB_USAGE, "option %s needs a value", option->name);
    *option->value = equals ? equals + 1 : argv[*at];
    return **option->value || alb_fail(error, ALB_USAGE, "option %s has an empty value", option->name);
}

bool alb_options_read(const alb_option *options, int option_count, int argc, char **argv, alb_error *error)
{
    int next = 0; // row of the next positional argument
    for (int i = 0; i < argc; i++) {
        if (argv[i][0] == '-' && argv[i][1]) {
            if (!read_named(options, option_count, argv, argc, &i, error))
                return false;
            continue;
        }
        while (next < option_count && options[next].name)
            next++;
        if (next == option_count)
            return alb_fail(error, ALB_USAGE, "unexpected argument %.200s", argv[i]);
        *options[next++].value = argv[i];
    }
    for (int i = 0; i < option_count; i++)
        if (options[i].required && !*options[i].value)
            return alb_fail(error, ALB_USAGE, "%s is missing", options[i].name ? options[i].name : options[i].label);
    return true;
}

bool alb_option_number(double *out, const char *name, const char *text, double minimum, double maximum,
                       alb_error *error)
{
    char *end;
    const double number = strtod(text, &end);
    if (end == text || *end || !(number >= minimum && number <= maximum))
        return alb_fail(error, ALB_USAGE, "%s %.60s: expected a number from %.9g to %.9g", name, text, minimum,
                        maximum);
    *out = number;
    return true;
}

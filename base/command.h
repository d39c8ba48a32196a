// What a command of the program is: one row of the table in alabaster.c.
#pragma once
#include "base/error.h"
#include "base/json.h"
#include <stdbool.h>

typedef struct alb_command {
    const char *name;
    const char *summary; // one line for `alabaster help`
    const char *usage;   // the whole text of `alabaster help NAME`
    // argc, argv without the program's name and the command's name. The result goes to stdout, narration to stderr.
    bool (*run)(int argc, char **argv, alb_error *error);
} alb_command;

// Options of a command line, declared as a table and read in one pass.
typedef struct alb_option {
    const char *name;  // "--rig"; NULL: the positional arguments, in order, one row each
    const char *label; // what a positional argument is called in messages: "PLAN.json"
    bool required;
    const char **value; // where the text goes (borrowed from argv)
    bool *flag;         // or: an option without a value
} alb_option;

// Fills the options; ALB_USAGE names what is unknown, repeated, missing or in excess. "--name=value" works too.
bool alb_options_read(const alb_option *options, int option_count, int argc, char **argv, alb_error *error);
// A number given on the command line as `name`: finite and within the bounds, nothing behind it.
bool alb_option_number(double *out, const char *name, const char *text, double minimum, double maximum,
                       alb_error *error);

extern const alb_command alb_capture_command, alb_calibrate_command, alb_fit_command, alb_export_command,
    alb_render_command, alb_compare_command, alb_sh_table_command;

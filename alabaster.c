// alabaster: the table of commands. Each stage's command.c is one row; `alabaster help` prints this table.
#include "base/command.h"
#include <fcntl.h>
#include <stdio.h>
#include <string.h>

static const alb_command *const commands[] = {
    &alb_capture_command, &alb_calibrate_command, &alb_fit_command,      &alb_export_command,
    &alb_render_command,  &alb_compare_command,   &alb_sh_table_command,
};
enum { COMMANDS = sizeof commands / sizeof commands[0] };

static const alb_command *find(const char *name)
{
    for (int i = 0; i < COMMANDS; i++)
        if (!strcmp(commands[i]->name, name))
            return commands[i];
    return NULL;
}

static void help(void)
{
    printf("alabaster measures how translucent materials scatter light, and renders them beside their photograph\n\n"
           "usage: alabaster COMMAND ...\n\n");
    for (int i = 0; i < COMMANDS; i++)
        printf("  %-10s %s\n", commands[i]->name, commands[i]->summary);
    printf("  %-10s %s\n\nalabaster help COMMAND tells more; alabaster --version names the version.\n"
           "exit codes: 0 ok, 1 differs, 2 usage, 3 access, 4 bad data, 5 the measurement does not decide,\n"
           "            6 memory, 7 internal\n",
           "help", "says how a command is used");
}

// Started with a standard stream closed, the first file that is opened would take its place and what is printed would
// end up inside it. Such a stream is filled so that using it fails.
static void fill_closed_streams(void)
{
    for (int stream = 0; stream <= 2; stream++)
        if (fcntl(stream, F_GETFD) < 0) // the lowest one that is free, so it becomes this one
            (void)!open("/dev/null", stream ? O_RDONLY : O_WRONLY);
}

// The exit code once all that was printed has left; output that cannot be written is an error of its own.
static int finish(bool ok, alb_error *error)
{
    if (ok && (fflush(stdout) != 0 || ferror(stdout)))
        ok = alb_fail(error, ALB_ACCESS, "standard output cannot be written");
    if (ok)
        return ALB_OK;
    fflush(stdout);
    fprintf(stderr, "alabaster: %s\n", error->text);
    return error->status;
}

int main(int argc, char **argv)
{
    fill_closed_streams();
    alb_error error = {0};
    const char *name = argc > 1 ? argv[1] : "help";
    const bool wants_help = argc > 2 && (!strcmp(argv[2], "--help") || !strcmp(argv[2], "-h"));
    if (!strcmp(name, "--version")) {
        printf("alabaster %s\n", ALB_VERSION);
        return finish(true, &error);
    }
    if (!strcmp(name, "help") || !strcmp(name, "--help") || !strcmp(name, "-h")) {
        if (argc < 3) {
            help();
            return finish(true, &error);
        }
        name = argv[2];
    }
    const alb_command *command = find(name);
    if (!command)
        return finish(alb_fail(&error, ALB_USAGE, "no command '%.60s'; alabaster help lists them", name), &error);
    if (wants_help || name == argv[2]) {
        printf("%s\n", command->usage);
        return finish(true, &error);
    }
    return finish(command->run(argc - 2, argv + 2, &error), &error);
}

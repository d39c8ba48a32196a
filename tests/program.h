// Running the real program, and files for it.
#pragma once
#include "base/file.h"
#include "check.h"

#include <sys/wait.h>
#include <unistd.h>

static char *output, *complaint; // of the last run

static inline char *slurp(const char *path)
{
    alb_error error = {0};
    char *bytes = NULL;
    size_t size;
    check_ok(alb_file_read(&bytes, &size, path, &error), &error);
    return bytes;
}

// system() with printf arguments.
__attribute__((format(printf, 1, 2))) static inline int shell(const char *format, ...)
{
    char command[8192];
    va_list arguments;
    va_start(arguments, format);
    assert_true(vsnprintf(command, sizeof command, format, arguments) < (int)sizeof command);
    va_end(arguments);
    return system(command);
}

// Where this process keeps what a run said: tests run side by side in one folder.
static inline const char *said_path(const char *stream)
{
    static char path[64];
    snprintf(path, sizeof path, "program_%d_%s.tmp", (int)getpid(), stream);
    return path;
}

// Exit code of `alabaster ARGUMENTS`; 128 + signal where it died, 124 where it hung.
static inline int run(const char *arguments)
{
    const int status = shell("timeout 600 '%s' %s >program_%d_out.tmp 2>program_%d_err.tmp", ALB_PROGRAM, arguments,
                             (int)getpid(), (int)getpid());
    free(output);
    free(complaint);
    output = slurp(said_path("out"));
    complaint = slurp(said_path("err"));
    return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
}

static inline void save(const char *path, const void *bytes, size_t size)
{
    alb_error error = {0};
    check_ok(alb_file_write(path, bytes, size, &error), &error);
}

static inline void save_text(const char *path, const char *text) { save(path, text, strlen(text)); }

// The first half of a file under another name.
static inline void cut(const char *to, const char *from)
{
    alb_error error = {0};
    char *bytes;
    size_t size;
    check_ok(alb_file_read(&bytes, &size, from, &error), &error);
    save(to, bytes, size / 2);
    free(bytes);
}

// Removes what runs leave in the working folder.
static inline void forget_runs(void)
{
    free(output);
    free(complaint);
    output = complaint = NULL;
    remove(said_path("out"));
    remove(said_path("err"));
}

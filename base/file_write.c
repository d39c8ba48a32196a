// Whole files written: under a temporary name in the same folder, then renamed, so that a reader, a crash or an
// interrupt meets the old bytes or the new ones.
#include "base/file.h"
#include <errno.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

// What a signal handler removes. The one piece of global state: a handler can be told nothing else. Several threads may
// each have a file under way; one beyond the table is written all the same, but an interrupt would leave it. Where
// files are gathered, they stay in the table until all are renamed, and an interrupt waits for that.
enum { PENDING_MAX = 64 };
static char pending[PENDING_MAX][ALB_PATH_SIZE];
static volatile sig_atomic_t pending_set[PENDING_MAX], gathering, settling, waiting_signal;

static void remove_pending(int signal_number)
{
    if (settling) {
        waiting_signal = signal_number;
        return;
    }
    for (int i = 0; i < PENDING_MAX; i++)
        if (pending_set[i])
            unlink(pending[i]);
    signal(signal_number, SIG_DFL);
    raise(signal_number);
}

static void install_handler(void)
{
    static bool installed;
    const int numbers[] = {SIGINT, SIGTERM, SIGHUP};
    for (int i = 0; !installed && i < 3; i++) {
        struct sigaction old;
        if (!sigaction(numbers[i], NULL, &old) && old.sa_handler == SIG_DFL)
            signal(numbers[i], remove_pending);
    }
    installed = true;
}

static void guard(const char *temporary)
{
#pragma omp critical(alb_file_pending)
    {
        int slot = 0;
        install_handler();
        while (slot < PENDING_MAX && pending_set[slot])
            slot++;
        if (slot < PENDING_MAX) {
            snprintf(pending[slot], ALB_PATH_SIZE, "%s", temporary);
            pending_set[slot] = 1;
        }
    }
}

static bool guarded(const char *temporary)
{
    bool found = false;
#pragma omp critical(alb_file_pending)
    for (int i = 0; i < PENDING_MAX; i++)
        found |= pending_set[i] && !strcmp(pending[i], temporary);
    return found;
}

static void unguard(const char *temporary)
{
#pragma omp critical(alb_file_pending)
    for (int i = 0; i < PENDING_MAX; i++)
        if (pending_set[i] && !strcmp(pending[i], temporary))
            pending_set[i] = 0;
}

bool alb_file_check_target(const char *path, alb_error *error)
{
    struct stat status;
    char folder[ALB_PATH_SIZE];
    if (!alb_path_folder(folder, path, error))
        return false;
    if (!*path || path[strlen(path) - 1] == '/')
        return alb_fail(error, ALB_ACCESS, "%s: cannot be written: a file's name is wanted, not a folder's", path);
    if (access(folder, W_OK | X_OK))
        return alb_fail(error, ALB_ACCESS, "%s: cannot be written: folder %s: %s", path, folder, strerror(errno));
    if (!stat(path, &status) && !S_ISREG(status.st_mode))
        return alb_fail(error, ALB_ACCESS, "%s: cannot be written: %s stands there", path,
                        S_ISDIR(status.st_mode) ? "a folder" : "a device or pipe");
    return true;
}

bool alb_file_begin(char temporary[ALB_PATH_SIZE], const char *path, alb_error *error)
{
    if (!alb_file_check_target(path, error))
        return false;
    const int length = snprintf(temporary, ALB_PATH_SIZE, "%s.%ld.tmp", path, (long)getpid());
    if (length < 0 || length >= ALB_PATH_SIZE)
        return alb_fail(error, ALB_USAGE, "path is longer than %d bytes: %.60s...", ALB_PATH_SIZE - 32, path);
    guard(temporary);
    return true;
}

bool alb_file_commit(const char *temporary, const char *path, alb_error *error)
{
    if (gathering && guarded(temporary))
        return true;
    if (rename(temporary, path)) {
        const int reason = errno;
        alb_file_abandon(temporary);
        return alb_fail(error, ALB_ACCESS, "%s: cannot be written: %s", path, strerror(reason));
    }
    unguard(temporary);
    return true;
}

void alb_file_abandon(const char *temporary)
{
    unlink(temporary);
    unguard(temporary);
}

void alb_files_gather(void) { gathering = 1; }

bool alb_files_settle(bool keep, alb_error *error)
{
    char path[ALB_PATH_SIZE], suffix[32];
    const size_t cut = (size_t)snprintf(suffix, sizeof suffix, ".%ld.tmp", (long)getpid());
    bool ok = true;
    gathering = 0;
    settling = 1;
    for (int i = 0; i < PENDING_MAX; i++) {
        if (!pending_set[i])
            continue;
        snprintf(path, sizeof path, "%.*s", (int)(strlen(pending[i]) - cut), pending[i]);
        if (keep && ok)
            ok = alb_file_commit(pending[i], path, error);
        else
            alb_file_abandon(pending[i]);
    }
    settling = 0;
    if (waiting_signal)
        remove_pending(waiting_signal);
    return ok;
}

bool alb_file_write(const char *path, const void *bytes, size_t size, alb_error *error)
{
    char temporary[ALB_PATH_SIZE];
    if (!alb_file_begin(temporary, path, error))
        return false;
    FILE *file = fopen(temporary, "wb");
    bool ok = file != NULL;
    if (ok) {
        ok = fwrite(bytes, 1, size, file) == size;
        ok = fflush(file) == 0 && ok;
        ok = fsync(fileno(file)) == 0 && ok;
        const int reason = errno;
        ok = fclose(file) == 0 && ok;
        errno = ok ? 0 : reason;
    }
    if (!ok) {
        alb_fail(error, ALB_ACCESS, "%s: cannot be written: %s", path, strerror(errno));
        alb_file_abandon(temporary);
        return false;
    }
    return alb_file_commit(temporary, path, error);
}

bool alb_file_write_text(const char *path, const alb_text *text, alb_error *error)
{
    if (text->failed)
        return alb_fail(error, ALB_NO_MEMORY, "%s: out of memory while its text was made", path);
    return alb_file_write(path, text->size ? text->bytes : "", text->size, error);
}

// Whole files. A file is written under a temporary name in the same folder and renamed, so that a reader, a crash or an
// interrupt meets the old bytes or the new ones. SHA-256 is OpenSSL's.
#include "base/file.h"
#include "base/memory.h"
#include <errno.h>
#include <fcntl.h>
#include <openssl/evp.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
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

bool alb_file_exists(const char *path) { return access(path, F_OK) == 0; }

bool alb_file_is_directory(const char *path)
{
    struct stat status;
    return !stat(path, &status) && S_ISDIR(status.st_mode);
}

bool alb_file_read(char **bytes, size_t *size, const char *path, alb_error *error)
{
    bool ok = false;
    char *content = NULL;
    size_t length = 0, capacity = 0;
    const size_t limit = (size_t)1 << 31;
    FILE *file = alb_file_is_directory(path) ? (errno = EISDIR, NULL) : fopen(path, "rb");
    if (!file)
        return alb_fail(error, ALB_ACCESS, "%s: cannot be opened: %s", path, strerror(errno));
    struct stat status;
    const bool known = !fstat(fileno(file), &status);
    if (known && (S_ISCHR(status.st_mode) || S_ISBLK(status.st_mode))) { // may never end
        alb_fail(error, ALB_ACCESS, "%s: is a device, not a file", path);
        goto done;
    }
    capacity = known && status.st_size > 0 ? (size_t)status.st_size : 0;
    if (capacity > limit) {
        alb_fail(error, ALB_BAD_DATA, "%s: %zu bytes is more than the 2 GiB that are read", path, capacity);
        goto done;
    }
    capacity += 4096;
    for (;;) {
        char *more = realloc(content, capacity + 1);
        if (!more) {
            alb_fail(error, ALB_NO_MEMORY, "%s: out of memory after %zu bytes", path, length);
            goto done;
        }
        content = more;
        length += fread(content + length, 1, capacity - length, file);
        if (length < capacity)
            break;
        if (capacity > limit) {
            alb_fail(error, ALB_BAD_DATA, "%s: more than the 2 GiB that are read", path);
            goto done;
        }
        capacity = 2 * capacity < limit ? 2 * capacity : limit + 1;
    }
    if (ferror(file)) {
        alb_fail(error, ALB_ACCESS, "%s: cannot be read: %s", path, strerror(errno));
        goto done;
    }
    content[length] = '\0';
    *bytes = content, *size = length;
    content = NULL;
    ok = true;
done:
    free(content);
    fclose(file);
    return ok;
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

static bool same_node(const char *a, const char *b)
{
    struct stat one, other;
    return !stat(a, &one) && !stat(b, &other) && one.st_dev == other.st_dev && one.st_ino == other.st_ino;
}

bool alb_file_same(const char *a, const char *b)
{
    char one[ALB_PATH_SIZE], other[ALB_PATH_SIZE];
    return same_node(a, b) || (strcmp(alb_path_name(a), alb_path_name(b)) == 0 && alb_path_folder(one, a, NULL) &&
                               alb_path_folder(other, b, NULL) && same_node(one, other));
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

bool alb_file_make_directory(const char *path, alb_error *error)
{
    char part[ALB_PATH_SIZE];
    const size_t length = strlen(path);
    if (length >= sizeof part)
        return alb_fail(error, ALB_USAGE, "path is longer than %d bytes: %.60s...", ALB_PATH_SIZE, path);
    for (size_t i = 1; i <= length; i++) {
        if (path[i] != '/' && path[i] != '\0')
            continue;
        memcpy(part, path, i);
        part[i] = '\0';
        if (mkdir(part, 0777) && !alb_file_is_directory(part))
            return alb_fail(error, ALB_ACCESS, "%s: cannot be made a folder: %s", part, strerror(errno));
    }
    return true;
}

bool alb_path_join(char out[ALB_PATH_SIZE], const char *a, const char *b, alb_error *error)
{
    const bool alone = b[0] == '/' || !a[0];
    const size_t size = strlen(a);
    const char *between = !alone && a[size - 1] != '/' ? "/" : "";
    const int length = snprintf(out, ALB_PATH_SIZE, "%s%s%s", alone ? "" : a, alone ? "" : between, b);
    if (length >= 0 && length < ALB_PATH_SIZE)
        return true;
    out[0] = '\0'; // half a path leads elsewhere
    return alb_fail(error, ALB_USAGE, "path is longer than %d bytes: %.60s...", ALB_PATH_SIZE, b);
}

bool alb_path_folder(char out[ALB_PATH_SIZE], const char *path, alb_error *error)
{
    const char *slash = strrchr(path, '/');
    const size_t length = !slash ? 0 : slash == path ? 1 : (size_t)(slash - path);
    if (length >= ALB_PATH_SIZE)
        return alb_fail(error, ALB_USAGE, "path is longer than %d bytes: %.60s...", ALB_PATH_SIZE, path);
    memcpy(out, length ? path : ".", length ? length : 1);
    out[length ? length : 1] = '\0';
    return true;
}

const char *alb_path_name(const char *path)
{
    const char *slash = strrchr(path, '/');
    return slash ? slash + 1 : path;
}

bool alb_hash_bytes(char hex[ALB_HASH_SIZE], const void *bytes, size_t size, alb_error *error)
{
    unsigned char digest[EVP_MAX_MD_SIZE];
    unsigned int length = 0;
    if (!EVP_Digest(bytes, size, digest, &length, EVP_sha256(), NULL) || length != 32)
        return alb_fail(error, ALB_INTERNAL, "SHA-256 is not available in this OpenSSL");
    for (int i = 0; i < 32; i++)
        snprintf(hex + 2 * i, 3, "%02x", digest[i]);
    return true;
}

bool alb_hash_file(char hex[ALB_HASH_SIZE], const char *path, alb_error *error)
{
    char *bytes = NULL;
    size_t size = 0;
    const bool ok = alb_file_read(&bytes, &size, path, error) && alb_hash_bytes(hex, bytes, size, error);
    free(bytes);
    return ok;
}

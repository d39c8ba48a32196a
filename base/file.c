// Whole files read and hashed, folders and paths. SHA-256 is OpenSSL's.
#include "base/file.h"
#include <errno.h>
#include <openssl/evp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

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

// Whole files: read, written atomically, hashed. Paths are UTF-8 bytes as the caller gave them.
#pragma once
#include "base/error.h"
#include "base/text.h"
#include <stddef.h>

enum { ALB_PATH_SIZE = 4096, ALB_HASH_SIZE = 65 };

bool alb_file_exists(const char *path);
bool alb_file_is_directory(const char *path);
// Reads the whole file; *bytes ends with a NUL that *size does not count and is the caller's (free). Refuses devices
// and more than 2 GiB.
bool alb_file_read(char **bytes, size_t *size, const char *path, alb_error *error);
// Writes to a temporary name beside `path` and renames: `path` holds the old bytes or the new ones, never a part.
bool alb_file_write(const char *path, const void *bytes, size_t size, alb_error *error);
// The same for a text; refuses a text that ran out of memory. The text stays the caller's.
bool alb_file_write_text(const char *path, const alb_text *text, alb_error *error);
// Whether a file could be written there, before the work that makes it: its folder exists and takes files, and what
// stands at `path` now, if anything, is an ordinary file (a folder or a device is never replaced).
bool alb_file_check_target(const char *path, alb_error *error);
// Whether both paths lead to one file, there or yet to be written.
bool alb_file_same(const char *a, const char *b);
// For libraries that write a file themselves: choose the temporary name, then commit (rename) or abandon (remove) it.
// An interrupt (SIGINT, SIGTERM, SIGHUP) removes the temporary files that are under way, 64 of them at most.
bool alb_file_begin(char temporary[ALB_PATH_SIZE], const char *path, alb_error *error);
bool alb_file_commit(const char *temporary, const char *path, alb_error *error);
void alb_file_abandon(const char *temporary);
// For results that belong together: what is written between the two calls stays under its temporary name (64 files at
// most; more are renamed at once), then all of it is renamed or, where `keep` is false, removed. A full disk or an
// interrupt before that leaves what stood there.
void alb_files_gather(void);
bool alb_files_settle(bool keep, alb_error *error);
// Makes the directory and its parents; an existing one is fine.
bool alb_file_make_directory(const char *path, alb_error *error);
// "a/b" from "a" and "b"; b alone when it is absolute or a is empty. Empty where it fails.
bool alb_path_join(char out[ALB_PATH_SIZE], const char *a, const char *b, alb_error *error);
// The folder of a path ("." where it has none) and its last component (borrowed from path).
bool alb_path_folder(char out[ALB_PATH_SIZE], const char *path, alb_error *error);
const char *alb_path_name(const char *path);
// SHA-256 as 64 hexadecimal digits.
bool alb_hash_bytes(char hex[ALB_HASH_SIZE], const void *bytes, size_t size, alb_error *error);
bool alb_hash_file(char hex[ALB_HASH_SIZE], const char *path, alb_error *error);

// frames/ changes place with the earlier one in one step (renameat2 with RENAME_EXCHANGE), then the small files follow.
// Only a crash of the machine within these few renames can leave frames and session.json of different captures
// together; the hashes in session.json show it.
#define _GNU_SOURCE
#include "capture/store.h"
#include <errno.h>
#include <fcntl.h>
#include <ftw.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <sys/file.h>
#include <unistd.h>

static int remove_one(const char *path, const struct stat *status, int kind, struct FTW *walk)
{
    (void)status, (void)kind, (void)walk;
    return remove(path);
}

static void remove_tree(const char *path) { nftw(path, remove_one, 16, FTW_DEPTH | FTW_PHYS); }

// Whether session.json names the same rig and the same inputs by content.
static bool same_origin(bool *same, const char *path, const char *rig, const alb_provenance *provenance,
                        alb_error *error)
{
    alb_node root, origin, inputs, input;
    const char *text;
    size_t size;
    alb_record *record = alb_record_read(path, error);
    bool ok = record && alb_record_root(&root, record, error) && alb_node_text(&text, root, "rig", error) &&
              alb_node_object(&origin, root, "provenance", error) &&
              alb_node_list(&inputs, &size, origin, "inputs", error);
    *same = ok && !strcmp(text, rig) && size == (size_t)provenance->input_count;
    for (size_t i = 0; ok && *same && i < size; i++) {
        ok = alb_node_item_object(&input, inputs, i, error) && alb_node_text(&text, input, "sha256", error);
        *same = ok && !strcmp(text, provenance->inputs[i].sha256);
    }
    alb_record_free(record);
    return ok;
}

bool alb_store_check(const char *folder, const char *rig, const alb_provenance *provenance, bool force,
                     alb_error *error)
{
    char session[ALB_PATH_SIZE], frames[ALB_PATH_SIZE];
    alb_error unreadable = {0};
    bool same;
    if (!alb_path_join(session, folder, "session.json", error) || !alb_path_join(frames, folder, "frames", error))
        return false;
    if (alb_file_exists(folder) && !alb_file_is_directory(folder))
        return alb_fail(error, ALB_ACCESS, "%s: is a file; a session is a folder", folder);
    if (force || (!alb_file_exists(session) && !alb_file_exists(frames)))
        return true;
    if (!alb_file_exists(session))
        return alb_fail(error, ALB_USAGE,
                        "%s: holds frames but no session.json; choose another folder, or --force to "
                        "replace the frames",
                        folder);
    if (!same_origin(&same, session, rig, provenance, &unreadable))
        return alb_fail(error, ALB_USAGE, "%s: holds a session that cannot be read (%.300s); --force replaces it",
                        folder, unreadable.text);
    return same || alb_fail(error, ALB_USAGE,
                            "%s: holds a session of another plan or rig; choose another folder, or "
                            "--force to replace it",
                            folder);
}

bool alb_store_open(alb_store *store, const char *folder, alb_error *error)
{
    char frames[ALB_PATH_SIZE];
    char partial[ALB_PATH_SIZE];
    *store = (alb_store){.made_folder = !alb_file_exists(folder)};
    if (!alb_path_join(partial, folder, "capture.partial", error) || !alb_path_join(frames, partial, "frames", error) ||
        !alb_file_make_directory(folder, error))
        return false;
    strcpy(store->folder, folder); // shorter than partial
    const int descriptor = open(folder, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (descriptor < 0)
        return alb_fail(error, ALB_ACCESS, "%s: cannot be opened: %s", folder, strerror(errno));
    store->lock = descriptor + 1;
    if (flock(descriptor, LOCK_EX | LOCK_NB) && errno == EWOULDBLOCK)
        return alb_fail(error, ALB_ACCESS, "%s: another capture is writing there; wait for it to end", folder);
    strcpy(store->partial, partial); // from here on it is this capture's
    remove_tree(partial);
    return alb_file_make_directory(frames, error);
}

// Moves partial/name to folder/name, exchanging where one stands there; removes the one there where none was written.
static bool place(const alb_store *store, const char *name, alb_error *error)
{
    char from[ALB_PATH_SIZE], to[ALB_PATH_SIZE];
    if (!alb_path_join(from, store->partial, name, error) || !alb_path_join(to, store->folder, name, error))
        return false;
    if (!alb_file_exists(from)) {
        unlink(to);
        return true;
    }
    const bool failed = alb_file_is_directory(from) && alb_file_exists(to)
                            ? renameat2(AT_FDCWD, from, AT_FDCWD, to, RENAME_EXCHANGE) != 0
                            : rename(from, to) != 0;
    return !failed || alb_fail(error, ALB_ACCESS, "%s: cannot be put in place: %s", to, strerror(errno));
}

bool alb_store_commit(alb_store *store, alb_error *error)
{
    sigset_t all, before;
    sigfillset(&all);
    sigprocmask(SIG_BLOCK, &all, &before);
    const bool ok =
        place(store, "frames", error) && place(store, "truth.json", error) && place(store, "session.json", error);
    sigprocmask(SIG_SETMASK, &before, NULL);
    store->made_folder = store->made_folder && !ok;
    return ok;
}

void alb_store_close(alb_store *store)
{
    if (store->partial[0])
        remove_tree(store->partial);
    if (store->made_folder)
        rmdir(store->folder); // where it is empty, as it was not there before
    if (store->lock)
        close(store->lock - 1);
    *store = (alb_store){0};
}

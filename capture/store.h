// Where a capture writes: inside the session's folder, but beside its content until all of it is there. An earlier
// session stays as it is until then, and so do the results of other stages.
#pragma once
#include "capture/session.h"

typedef struct alb_store {
    char folder[ALB_PATH_SIZE];  // the session's
    char partial[ALB_PATH_SIZE]; // folder/capture.partial, where everything is written
    bool made_folder;
    int lock; // descriptor of the folder, locked against a second capture, + 1; 0: none
} alb_store;

// Refuses (ALB_USAGE) a folder that holds a session made from other inputs or by another rig, or frames without a
// session, unless `force`. Writes nothing.
bool alb_store_check(const char *folder, const char *rig, const alb_provenance *provenance, bool force,
                     alb_error *error);
// Makes the folders; what an interrupted capture left there goes. ALB_ACCESS while another capture writes there.
bool alb_store_open(alb_store *store, const char *folder, alb_error *error);
// Puts frames/, session.json and truth.json (where there is one) in the place of the earlier ones; no signal comes
// between.
bool alb_store_commit(alb_store *store, alb_error *error);
// Removes what is not committed. Safe after commit.
void alb_store_close(alb_store *store);

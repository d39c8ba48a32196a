// The table of rigs: what can photograph a plan. A new one is one file and one row in rig.c.
#pragma once
#include "base/image.h"
#include "capture/session.h"

typedef struct alb_rig {
    const char *kind, *argument; // "virtual", "TRUTH.json"
    // Reads and checks all that can be, before anything is written: fills width, height, channels, channel names, white
    // level and the obtained exposures of the session, whose plan is known; adds its inputs to the provenance. *state
    // is the rig's own, NULL on failure.
    bool (*open)(void **state, alb_session *session, alb_provenance *provenance, const char *argument,
                 alb_error *error);
    // One frame into an empty image, the caller's to free. Repeats of a shot come one after the other.
    bool (*capture)(alb_image *frame, void *state, const alb_session *session, int shot, int exposure, int repeat,
                    alb_error *error);
    // Writes what only this rig knows into the session's folder; may be NULL.
    bool (*finish)(void *state, const alb_provenance *provenance, const char *folder, alb_error *error);
    void (*close)(void *state);
} alb_rig;

extern const alb_rig alb_virtual_rig, alb_folder_rig;

// The rig of "KIND:ARGUMENT"; *argument is borrowed from the text. NULL with ALB_USAGE.
const alb_rig *alb_rig_find(const char **argument, const char *text, alb_error *error);

// alabaster capture: a plan and a rig become a session.
#include "base/command.h"
#include "base/exr.h"
#include "base/memory.h"
#include "base/progress.h"
#include "capture/rig.h"
#include "capture/store.h"
#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// Set by the first interrupt; the frame at hand is finished and everything removed. A second one ends the program.
static volatile sig_atomic_t interrupted;

static void interrupt(int number)
{
    interrupted = 1;
    signal(number, SIG_DFL);
}

// What a plan's maker wants to know of an exposure: the brightest value and the share of saturated ones.
typedef struct frame_level {
    double highest_dn, saturated;
} frame_level;

static frame_level measure(const alb_image *frame, double white_level_dn)
{
    frame_level level = {0};
    const size_t count = (size_t)frame->width * (size_t)frame->height * (size_t)frame->channels;
    for (size_t i = 0; i < count; i++) {
        const double value = (double)frame->pixels[i];
        level.highest_dn = fmax(level.highest_dn, value);
        level.saturated += value >= white_level_dn;
    }
    level.saturated /= (double)count;
    return level;
}

static int frame_count(const alb_plan *plan)
{
    int count = 0;
    for (int i = 0; i < plan->shot_count; i++)
        count += plan->shots[i].exposure_count * plan->shots[i].repeats;
    return count;
}

// frames/camera.json makes the frames a folder that the folder rig replays.
static bool write_camera(const alb_session *session, alb_error *error)
{
    alb_json json;
    char path[ALB_PATH_SIZE];
    if (!alb_path_join(path, session->folder, "frames/camera.json", error))
        return false;
    alb_json_begin(&json, NULL);
    alb_json_number(&json, "white_level_dn", session->white_level_dn);
    alb_json_string(&json, "response", "linear");
    alb_json_object(&json, "obtained_s");
    for (int i = 0; i < session->plan.shot_count; i++)
        alb_json_numbers(&json, session->plan.shots[i].name, session->plan.shots[i].obtained_s,
                         (size_t)session->plan.shots[i].exposure_count);
    alb_json_end_object(&json);
    return alb_json_write(&json, path, error);
}

// A frame on its way to its file.
typedef struct outgoing {
    alb_image frame;
    char path[ALB_PATH_SIZE];
    frame_level *level; // NULL: not asked for
    alb_error error;
} outgoing;

// Frames are taken one after the other and written a few at a time, for compressing them takes longer.
enum { OUTGOING_MAX = 4 };
typedef struct queue {
    outgoing frames[OUTGOING_MAX];
    int count;
} queue;

// Writes and empties the queue; the first error in the order of the frames.
static bool write_queue(queue *queued, const alb_session *session, alb_error *error)
{
    bool ok = true;
#pragma omp parallel for schedule(dynamic)
    for (int i = 0; i < queued->count; i++) {
        outgoing *out = &queued->frames[i];
        if (alb_exr_write(&out->frame, NULL, out->path, &out->error) && out->level)
            *out->level = measure(&out->frame, session->white_level_dn);
    }
    for (int i = 0; i < queued->count; i++) {
        const alb_error *reason = &queued->frames[i].error;
        if (ok && reason->status != ALB_OK)
            ok = alb_fail(error, reason->status, "%s", reason->text);
        alb_image_free(&queued->frames[i].frame);
    }
    queued->count = 0;
    return ok;
}

static bool capture_frame(queue *queued, frame_level *level, const alb_rig *rig, void *state,
                          const alb_session *session, int shot, int exposure, int repeat, alb_error *error)
{
    outgoing *out = &queued->frames[queued->count];
    *out = (outgoing){.level = repeat == 0 ? level : NULL};
    if (!alb_session_frame(out->path, session, &session->plan.shots[shot], exposure, repeat, error) ||
        !rig->capture(&out->frame, state, session, shot, exposure, repeat, error)) {
        alb_image_free(&out->frame);
        return false;
    }
    queued->count++;
    if (interrupted)
        return alb_fail(error, ALB_ACCESS, "interrupted; nothing was changed");
    return queued->count < OUTGOING_MAX || write_queue(queued, session, error);
}

// levels[shot * ALB_EXPOSURES_MAX + exposure]
static bool capture_frames(frame_level *levels, const alb_rig *rig, void *state, const alb_session *session,
                           alb_error *error)
{
    const alb_plan *plan = &session->plan;
    alb_progress progress;
    queue *queued = alb_allocate(1, sizeof *queued, error);
    bool ok = queued != NULL;
    int done = 0;
    alb_progress_begin(&progress, "capture", frame_count(plan));
    for (int shot = 0; shot < plan->shot_count; shot++)
        for (int repeat = 0; repeat < plan->shots[shot].repeats; repeat++)
            for (int exposure = 0; ok && exposure < plan->shots[shot].exposure_count; exposure++) {
                ok = capture_frame(queued, &levels[shot * ALB_EXPOSURES_MAX + exposure], rig, state, session, shot,
                                   exposure, repeat, error);
                alb_progress_at(&progress, ++done);
            }
    ok = ok && write_queue(queued, session, error);
    for (int i = 0; queued && i < queued->count; i++)
        alb_image_free(&queued->frames[i].frame);
    free(queued);
    alb_progress_end(&progress);
    if (ok && interrupted)
        return alb_fail(error, ALB_ACCESS, "interrupted; nothing was changed");
    return ok;
}

static bool print_json(const frame_level *levels, const alb_session *session, const char *folder, alb_error *error)
{
    alb_json json;
    alb_json_begin(&json, NULL);
    alb_json_string(&json, "session", folder);
    alb_json_string(&json, "rig", session->rig);
    alb_json_integer(&json, "frames", frame_count(&session->plan));
    alb_json_list(&json, "shots");
    for (int i = 0; i < session->plan.shot_count; i++)
        for (int e = 0; e < session->plan.shots[i].exposure_count; e++) {
            alb_json_object(&json, NULL);
            alb_json_string(&json, "shot", session->plan.shots[i].name);
            alb_json_number(&json, "exposure_s", session->plan.shots[i].obtained_s[e]);
            alb_json_number(&json, "highest_dn", levels[i * ALB_EXPOSURES_MAX + e].highest_dn);
            alb_json_number(&json, "saturated", levels[i * ALB_EXPOSURES_MAX + e].saturated);
            alb_json_end_object(&json);
        }
    alb_json_end_list(&json);
    return alb_json_print(&json, error);
}

static void print_table(const frame_level *levels, const alb_session *session, const char *folder)
{
    printf("%s: %d frames of %d x %d pixels, white level %g DN\n", folder, frame_count(&session->plan), session->width,
           session->height, session->white_level_dn);
    printf("%-24s %12s %12s %12s\n", "shot", "exposure s", "highest DN", "saturated %");
    for (int i = 0; i < session->plan.shot_count; i++)
        for (int e = 0; e < session->plan.shots[i].exposure_count; e++)
            printf("%-24s %12.6g %12.6g %12.3g\n", session->plan.shots[i].name, session->plan.shots[i].obtained_s[e],
                   levels[i * ALB_EXPOSURES_MAX + e].highest_dn, 100 * levels[i * ALB_EXPOSURES_MAX + e].saturated);
}

// From an open rig to a session in its folder.
static bool store_session(frame_level *levels, const alb_rig *rig, void *state, alb_session *session,
                          const alb_provenance *provenance, const char *folder, alb_error *error)
{
    alb_store store = {0};
    const struct sigaction action = {.sa_handler = interrupt};
    struct sigaction before[3];
    interrupted = 0;
    sigaction(SIGINT, &action, &before[0]);
    sigaction(SIGTERM, &action, &before[1]);
    sigaction(SIGHUP, &action, &before[2]);
    bool ok = alb_store_open(&store, folder, error);
    if (ok)
        strcpy(session->folder, store.partial);
    ok = ok && capture_frames(levels, rig, state, session, error) && write_camera(session, error) &&
         (!rig->finish || rig->finish(state, provenance, session->folder, error)) &&
         alb_session_write(session, provenance, error) && alb_store_commit(&store, error);
    alb_store_close(&store);
    sigaction(SIGINT, &before[0], NULL);
    sigaction(SIGTERM, &before[1], NULL);
    sigaction(SIGHUP, &before[2], NULL);
    return ok;
}

static bool run(int argc, char **argv, alb_error *error)
{
    const char *plan = NULL, *folder = NULL, *rig_text = NULL, *argument = NULL;
    bool json = false, force = false, ok = false;
    const alb_option options[] = {{.label = "PLAN.json", .required = true, .value = &plan},
                                  {.name = "-o", .required = true, .value = &folder},
                                  {.name = "--rig", .required = true, .value = &rig_text},
                                  {.name = "--force", .flag = &force},
                                  {.name = "--json", .flag = &json}};
    void *state = NULL;
    const alb_rig *rig = NULL;
    alb_provenance provenance = {.command = "capture"};
    frame_level *levels = NULL;
    alb_session *session = NULL;
    if (!alb_options_read(options, 5, argc, argv, error) || !(rig = alb_rig_find(&argument, rig_text, error)) ||
        !(levels = alb_allocate((size_t)ALB_SHOTS_MAX * ALB_EXPOSURES_MAX, sizeof *levels, error)) ||
        !(session = alb_allocate(1, sizeof *session, error)) || !alb_plan_read(&session->plan, plan, error) ||
        !alb_provenance_add(&provenance, plan, error))
        goto done;
    snprintf(session->rig, sizeof session->rig, "%s:%s", rig->kind, alb_path_name(argument));
    snprintf(provenance.options, sizeof provenance.options, "--rig %.900s", session->rig);
    if (!rig->open(&state, session, &provenance, argument, error) ||
        !alb_store_check(folder, session->rig, &provenance, force, error) ||
        !store_session(levels, rig, state, session, &provenance, folder, error))
        goto done;
    if (!json)
        print_table(levels, session, folder);
    ok = !json || print_json(levels, session, folder, error);
done:
    if (state)
        rig->close(state);
    free(session);
    free(levels);
    return ok;
}

const alb_command alb_capture_command = {
    "capture", "photographs a plan with a rig: a session",
    "usage: alabaster capture PLAN.json -o SESSION --rig KIND:ARGUMENT [--force] [--json]\n"
    "\n"
    "Takes every photograph of the plan and leaves SESSION/session.json and SESSION/frames/*.exr (raw values).\n"
    "\n"
    "  --rig virtual:TRUTH.json  a simulated projector, slab and camera; leaves SESSION/truth.json too\n"
    "  --rig folder:DIR          frames from files: DIR/SHOT_e0_r0.exr (or .png, .tif, .tiff, .jpg), DIR/camera.json\n"
    "  --force                   replaces a session of another plan or rig\n"
    "  --json                    prints the result as JSON\n"
    "\n"
    "An earlier session stays whole until the new one is complete.\n",
    run};

// A small plan and a small rig for tests of whole captures, and a folder of their own to work in.
#pragma once
#include "base/command.h"
#include "base/file.h"
#include "check.h"
#include <unistd.h>

static const char *const plan_json =
    "{\"format\": 1, \"sample\": {\"name\": \"wax\", \"thickness_mm\": 6, \"refractive_index\": 1.45, \"finish\": "
    "\"ground\"},\n"
    " \"white_reference\": {\"reflectance\": [0.99, 0.98, 0.97]}, \"board\": {\"columns\": 9, \"rows\": 6, "
    "\"square_mm\": 3},\n"
    " \"shots\": [{\"name\": \"dark\", \"target\": \"cap\", \"pattern\": {\"kind\": \"black\"}, \"exposures_s\": "
    "[0.01],\n"
    "   \"repeats\": 2},\n"
    "  {\"name\": \"hand\", \"target\": \"board\", \"pattern\": {\"kind\": \"chessboard\"}, \"exposures_s\": [0.01],\n"
    "   \"repeats\": 2, \"in_hand\": true},\n"
    "  {\"name\": \"slab_transmission\", \"side\": \"transmission\", \"target\": \"slab\",\n"
    "   \"pattern\": {\"kind\": \"grid\", \"diameter_px\": 2, \"columns\": 3, \"rows\": 2, \"pitch_px\": 20},\n"
    "   \"exposures_s\": [0.0100004, 0.04]}]}\n";

static const char *const truth_json =
    "{\"format\": 1, \"seed\": 1, \"profile\": {\n"
    "  \"reflection\": {\"amplitude_per_mm2\": [[0.1, 0.1], [0.2], [0.1]], \"decay_per_mm\": [[1, 2], [1.5], [1]]},\n"
    "  \"transmission\": {\"amplitude_per_mm2\": [[0.01], [0.02, -0.01], [0.01]], \"decay_per_mm\": [[0.4], [0.4, 1], "
    "[0.5]]}},\n"
    " \"projector\": {\"pixel_mm\": 0.25, \"blur_sd_mm\": 0.12, \"irradiance_w_per_mm2\": [0.001, 0.001, 0.001]},\n"
    " \"lamp\": {\"radiance_w_per_mm2_sr\": 1e-5},\n"
    " \"camera\": {\"width\": 96, \"height\": 72, \"focal_px\": 210, \"centre_px\": [48, 35],\n"
    "  \"distortion\": [-0.1, 0, 0, 0, 0], \"distance_mm\": 120, \"tilt_deg\": 15},\n"
    " \"sensor\": {\"responsivity_e\": [9e10, 1e11, 8e10], \"full_well_e\": 18000, \"read_noise_e\": 3,\n"
    "  \"gain_dn_per_e\": 0.25, \"black_level_dn\": 64, \"bits\": 12, \"vignetting\": 0.3}}\n";

static char work[] = "/tmp/alabaster_capture_XXXXXX";

// work/name; a few buffers in turn.
static inline const char *at(const char *name)
{
    static char paths[8][256];
    static int next;
    char *path = paths[next++ % 8];
    snprintf(path, sizeof paths[0], "%s/%s", work, name);
    return path;
}

static inline void put(const char *name, const char *text)
{
    alb_error error = {0};
    check_ok(alb_file_write(at(name), text, strlen(text), &error), &error);
}

// The text with its first occurrence of `from` replaced.
static inline const char *replaced(const char *text, const char *from, const char *to)
{
    static char out[8192];
    const char *found = strstr(text, from);
    assert_non_null(found);
    snprintf(out, sizeof out, "%.*s%s%s", (int)(found - text), text, to, found + strlen(from));
    return out;
}

static inline int set_up(void **state)
{
    (void)state;
    if (!mkdtemp(work))
        return 1;
    put("plan.json", plan_json);
    put("truth.json", truth_json);
    return 0;
}

static inline int tear_down(void **state)
{
    (void)state;
    char command[300];
    snprintf(command, sizeof command, "rm -rf %s", work);
    return system(command);
}

// alabaster capture work/PLAN -o work/SESSION --rig KIND:work/ARGUMENT [OPTION], its table not shown.
static inline bool capture(const char *plan, const char *session, const char *kind, const char *argument,
                           const char *option, alb_error *error)
{
    char rig[512];
    snprintf(rig, sizeof rig, "%s:%s", kind, at(argument));
    char *argv[] = {(char *)at(plan), (char *)"-o", (char *)at(session), (char *)"--rig", rig, (char *)option};
    fflush(stdout);
    const int shown = dup(1);
    assert_non_null(freopen("/dev/null", "w", stdout));
    const bool ok = alb_capture_command.run(option ? 6 : 5, argv, error);
    fflush(stdout);
    dup2(shown, 1);
    close(shown);
    return ok;
}

static inline void hash(char out[ALB_HASH_SIZE], const char *name)
{
    alb_error error = {0};
    check_ok(alb_hash_file(out, at(name), &error), &error);
}

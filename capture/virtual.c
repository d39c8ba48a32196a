// The virtual rig: a projector, a slab and a camera that exist in TRUTH.json. Photons scatter in the slab (photon.c),
// the projector's pattern makes a face shine (kernel.c, lit_face.c), the camera sees it (view.c) and the sensor counts
// it (sensor.c). The radiance of a shot is worked out once and shared by its exposures and repeats.
//
// What is simpler than the world: light leaves a smooth face in the same directions at all distances from the beam
// (those of the photons that left, lobe.c) and a ground one as Lambert says, the slab is wider than the view, light
// from the camera's side does not exist, nothing is out of focus, and the camera stands in the same way before both
// faces.
#include "base/memory.h"
#include "base/progress.h"
#include "capture/kernel.h"
#include "capture/lit_face.h"
#include "capture/rig.h"
#include "capture/sensor.h"
#include "capture/view.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

static const double shutter_step_s = 1e-6; // exposures are obtained in whole steps

typedef struct virtual_rig {
    alb_truth truth;
    alb_sight sight;
    alb_kernel kernels[ALB_SIDES][3];
    alb_response responses[ALB_SIDES][3];
    alb_image rate; // electrons per second of the shot (and pose) in rate_shot, rate_pose
    int rate_shot, rate_pose;
} virtual_rig;

static void close_rig(void *state)
{
    virtual_rig *rig = state;
    if (!rig)
        return;
    alb_sight_free(&rig->sight);
    for (int i = 0; i < ALB_SIDES * 3; i++)
        alb_kernel_free(&rig->kernels[i / 3][i % 3]);
    alb_image_free(&rig->rate);
    free(rig);
}

// Furthest that the view and the pattern reach from the origin, on the face.
static double reach_mm(const virtual_rig *rig, const alb_plan *plan)
{
    const alb_transform plane_from_camera = alb_inverse(&rig->sight.camera.camera_from_world);
    const int width = rig->truth.camera.width, height = rig->truth.camera.height;
    double reach = 0, pattern = 0;
    for (long i = 0; i < (long)(width + 1) * (height + 1); i++) {
        const alb_vector d = alb_rotate(
            &plane_from_camera, (alb_vector){rig->sight.corners_xy[2 * i], rig->sight.corners_xy[2 * i + 1], 1});
        const double t = -plane_from_camera.translation.z / d.z;
        if (t > 0 && t < 1e9)
            reach = fmax(reach,
                         hypot(plane_from_camera.translation.x + t * d.x, plane_from_camera.translation.y + t * d.y));
    }
    for (int i = 0; i < plan->shot_count; i++) {
        const alb_pattern *p = &plan->shots[i].pattern;
        pattern = fmax(pattern, p->diameter_px + p->pitch_px * hypot(p->columns, p->rows));
    }
    return reach + pattern * rig->truth.projector.pixel_mm;
}

static bool kernels_from_photons(virtual_rig *rig, alb_finish finish, double radius_mm, alb_error *error)
{
    alb_progress progress;
    bool ok = true;
    alb_progress_begin(&progress, "scatter photons", 3);
    for (int c = 0; c < 3 && ok; c++) {
        alb_photon_tally tally;
        const double edge = 10 + 8 * rig->truth.medium[c].thickness_mm; // beyond, less than 1e-8 of the peak is left
        ok = alb_photon_trace(&tally, &rig->truth.medium[c], edge, rig->truth.photons, rig->truth.seed, (uint64_t)c,
                              error);
        for (int side = 0; side < ALB_SIDES && ok; side++) {
            alb_response_from_photons(&rig->responses[side][c], &tally, side);
            ok = alb_kernel_from_photons(&rig->kernels[side][c], &tally, side, rig->truth.projector.blur_sd_mm,
                                         fmin(edge, radius_mm), error);
            if (ok && finish == ALB_FINISH_SMOOTH)
                alb_lobe_from_photons(&rig->kernels[side][c].lobe, &tally, side);
        }
        alb_progress_at(&progress, c + 1);
    }
    alb_progress_end(&progress);
    return ok;
}

static bool kernels_from_profile(virtual_rig *rig, double radius_mm, alb_error *error)
{
    for (int side = 0; side < ALB_SIDES; side++)
        for (int c = 0; c < 3; c++) {
            const alb_stated_profile *profile = &rig->truth.profile[side][c];
            alb_response_from_profile(&rig->responses[side][c], profile, radius_mm);
            if (!alb_kernel_from_profile(&rig->kernels[side][c], profile, rig->truth.projector.blur_sd_mm, radius_mm,
                                         error))
                return false;
        }
    return true;
}

static void describe(alb_session *session, const virtual_rig *rig)
{
    session->width = rig->truth.camera.width;
    session->height = rig->truth.camera.height;
    session->channels = 3;
    for (int c = 0; c < 3; c++)
        snprintf(session->channel_names[c], sizeof session->channel_names[c], "%c", "RGB"[c]);
    session->white_level_dn = alb_sensor_white_level_dn(&rig->truth.sensor);
    for (int i = 0; i < session->plan.shot_count; i++) {
        alb_shot *shot = &session->plan.shots[i];
        for (int e = 0; e < shot->exposure_count; e++)
            shot->obtained_s[e] = fmax(1, rint(shot->exposures_s[e] / shutter_step_s)) * shutter_step_s;
    }
}

static void board_half(double half[2], const alb_plan *plan)
{
    half[0] = 0.5 * (plan->board_columns + 3) * plan->board_square_mm; // one square around the outermost ones
    half[1] = 0.5 * (plan->board_rows + 3) * plan->board_square_mm;
}

// Boards must be in view and patterns payable: found before the first frame.
static bool check_shots(const virtual_rig *rig, const alb_plan *plan, alb_error *error)
{
    double half[2];
    board_half(half, plan);
    for (int i = 0; i < plan->shot_count; i++) {
        const alb_shot *shot = &plan->shots[i];
        alb_lit_face face;
        alb_transform pose;
        if (!alb_lit_face_create(&face, &rig->truth, &shot->pattern, NULL, plan->white_reflectance, error))
            return false;
        alb_lit_face_free(&face);
        if (shot->target == ALB_TARGET_BOARD && !shot->in_hand &&
            !alb_sight_sees(&rig->sight, &rig->sight.camera.camera_from_world, half[0], half[1]))
            return alb_fail(error, ALB_BAD_DATA,
                            "shot %s: a board of %g x %g mm with its margin is not fully in view; use "
                            "smaller squares",
                            shot->name, 2 * half[0], 2 * half[1]);
        for (int repeat = 0; shot->in_hand && repeat < shot->repeats; repeat++)
            if (!alb_sight_hand_pose(&pose, &rig->sight, half[0], half[1], rig->truth.seed, (uint64_t)repeat, error))
                return false;
    }
    return true;
}

static bool open_rig(void **state, alb_session *session, alb_provenance *provenance, const char *argument,
                     alb_error *error)
{
    bool ok = false;
    virtual_rig *rig = alb_allocate(1, sizeof *rig, error);
    *state = NULL;
    if (!rig || !alb_truth_read(&rig->truth, argument, session->plan.thickness_mm, error) ||
        !alb_provenance_add(provenance, argument, error) || !alb_sight_open(&rig->sight, &rig->truth, error))
        goto done;
    const double radius = reach_mm(rig, &session->plan), sd = rig->truth.projector.blur_sd_mm;
    if (!(radius < 2e4 * sd)) {
        alb_fail(error, ALB_BAD_DATA,
                 "%s: the view reaches %.4g mm from the middle, more than 20 000 times the projector's "
                 "blur of %g mm; bring the camera nearer or tilt it less",
                 argument, radius, sd);
        goto done;
    }
    if (!rig->truth.is_medium && session->plan.finish != ALB_FINISH_GROUND) {
        alb_fail(
            error, ALB_BAD_DATA,
            "%s: a stated profile leaves as Lambert says, but the plan's sample has a smooth face; give the plan's "
            "sample \"finish\": \"ground\", or the rig a medium",
            argument);
        goto done;
    }
    if (!check_shots(rig, &session->plan, error) ||
        !(rig->truth.is_medium ? kernels_from_photons(rig, session->plan.finish, radius, error)
                               : kernels_from_profile(rig, radius, error)))
        goto done;
    describe(session, rig);
    rig->rate_shot = -1;
    *state = rig;
    ok = true;
done:
    if (!ok)
        close_rig(rig);
    return ok;
}

typedef struct printed_board {
    double square_mm, half[2]; // with the margin
    double white;
} printed_board;

// Black and white squares within a white margin, on a grey table.
static void board_radiance(double out[3], const void *scene, double x_mm, double y_mm, double cosine)
{
    const printed_board *board = scene;
    (void)cosine;
    const double s = board->square_mm, x = x_mm + board->half[0], y = board->half[1] - y_mm;
    double share = 0.15;
    if (x >= 0 && y >= 0 && x < 2 * board->half[0] && y < 2 * board->half[1]) {
        const bool margin = x < s || y < s || x >= 2 * board->half[0] - s || y >= 2 * board->half[1] - s;
        share = margin || ((int)floor(x / s) + (int)floor(y / s)) % 2 ? 1 : 0.05;
    }
    out[0] = out[1] = out[2] = share * board->white;
}

static void lamp_radiance(double out[3], const void *scene, double x_mm, double y_mm, double cosine)
{
    (void)x_mm, (void)y_mm, (void)cosine;
    out[0] = out[1] = out[2] = *(const double *)scene;
}

// Radiance of the shot as the camera's pixels average it.
static bool picture(alb_image *out, const virtual_rig *rig, const alb_plan *plan, const alb_shot *shot, int pose,
                    alb_error *error)
{
    alb_transform camera_from_plane = rig->sight.camera.camera_from_world;
    alb_lit_face face = {0};
    printed_board board = {.square_mm = plan->board_square_mm, .white = rig->truth.lamp_radiance};
    alb_flat_scene scene = {.samples = 5};
    board_half(board.half, plan);
    if (shot->target == ALB_TARGET_CAP)
        return true;
    if (shot->target == ALB_TARGET_BOARD) {
        if (shot->in_hand && !alb_sight_hand_pose(&camera_from_plane, &rig->sight, board.half[0], board.half[1],
                                                  rig->truth.seed, (uint64_t)pose, error))
            return false;
        scene = (alb_flat_scene){board_radiance, &board, 34};
    } else if (shot->target == ALB_TARGET_DIFFUSER) {
        scene = (alb_flat_scene){lamp_radiance, &rig->truth.lamp_radiance, 1};
    } else {
        const alb_kernel *kernels = shot->target == ALB_TARGET_SLAB ? rig->kernels[shot->side] : NULL;
        if (!alb_lit_face_create(&face, &rig->truth, &shot->pattern, kernels, plan->white_reflectance, error))
            return false;
        scene = (alb_flat_scene){alb_lit_face_radiance, &face, 5};
    }
    alb_sight_picture(out, &rig->sight, &camera_from_plane, &scene);
    alb_lit_face_free(&face);
    return true;
}

static bool prepare(virtual_rig *rig, const alb_plan *plan, int shot, int pose, alb_error *error)
{
    if (rig->rate_shot == shot && rig->rate_pose == pose)
        return true;
    rig->rate_shot = -1;
    alb_image_free(&rig->rate);
    if (!alb_image_create(&rig->rate, rig->truth.camera.width, rig->truth.camera.height, "R,G,B", error) ||
        !picture(&rig->rate, rig, plan, &plan->shots[shot], pose, error))
        return false;
    alb_sight_vignette(&rig->rate, &rig->sight, rig->truth.sensor.vignetting);
    for (size_t i = 0; i < (size_t)rig->rate.width * (size_t)rig->rate.height * 3; i++)
        rig->rate.pixels[i] = (float)((double)rig->rate.pixels[i] * rig->truth.sensor.responsivity_e[i % 3]);
    rig->rate_shot = shot;
    rig->rate_pose = pose;
    return true;
}

static bool capture(alb_image *frame, void *state, const alb_session *session, int shot, int exposure, int repeat,
                    alb_error *error)
{
    virtual_rig *rig = state;
    const alb_shot *s = &session->plan.shots[shot];
    const uint64_t id = ((uint64_t)(shot + 1) * ALB_EXPOSURES_MAX + (uint64_t)exposure) * 1000 + (uint64_t)repeat;
    if (!prepare(rig, &session->plan, shot, s->in_hand ? repeat : 0, error) ||
        !alb_image_create(frame, rig->rate.width, rig->rate.height, "R,G,B", error))
        return false;
    alb_sensor_expose(frame, &rig->rate, &rig->truth.sensor, s->obtained_s[exposure], rig->truth.seed, id);
    return true;
}

static bool finish(void *state, const alb_provenance *provenance, const char *folder, alb_error *error)
{
    const virtual_rig *rig = state;
    return alb_truth_write(rig->responses, provenance, folder, error);
}

const alb_rig alb_virtual_rig = {"virtual", "TRUTH.json", open_rig, capture, finish, close_rig};

// alabaster calibrate: session -> calibration.
#include "base/command.h"
#include "base/exr.h"
#include "base/memory.h"
#include "base/progress.h"
#include "calibrate/calibration_file.h"
#include "calibrate/flat.h"
#include "calibrate/geometry.h"
#include "calibrate/merge.h"
#include "calibrate/products.h"
#include "calibrate/report.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const char usage[] =
    "usage: alabaster calibrate SESSION [--json]\n"
    "       alabaster calibrate --photographs FOLDER --board COLUMNSxROWS --square-mm S [-o LENS.json] [--json]\n"
    "\n"
    "Turns the frames of a session into numbers: black level, noise and gain of the sensor, vignetting, lens and "
    "pose,\n"
    "exposures merged with a variance per pixel, and the absolute scale from the white reference.\n"
    "Writes SESSION/calibration.json, SESSION/calibration/*.exr and SESSION/report/calibrate.html.\n"
    "The second form calibrates a lens from photographs of a chessboard (inner corners, square's side) alone.";

typedef struct work {
    alb_session session;
    alb_calibration calibration;
    alb_noise noise;
    alb_board_views boards;
    alb_image images[ALB_SHOTS_MAX];
    double flat_rms;
} work;

static void work_free(work *w)
{
    for (int i = 0; i < ALB_SHOTS_MAX; i++)
        alb_image_free(&w->images[i]);
    alb_board_views_free(&w->boards);
    free(w);
}

static bool measure_flat(work *w, alb_error *error)
{
    const alb_plan *plan = &w->session.plan;
    for (int s = 0; s < plan->shot_count; s++) {
        if (plan->shots[s].target != ALB_TARGET_DIFFUSER)
            continue;
        alb_image merged = {0};
        const bool ok = alb_merge_shot(&merged, &w->session, &plan->shots[s], &w->noise, error) &&
                        alb_flat_fit(w->calibration.flat, &w->flat_rms, &merged, &w->calibration.views[0].camera.lens,
                                     w->calibration.channels, error);
        alb_image_free(&merged);
        return ok;
    }
    return alb_fail(error, ALB_BAD_DATA, "%s: no shot of the diffuser", w->session.folder);
}

static bool measure(work *w, const char *folder, alb_error *error)
{
    alb_calibration *c = &w->calibration;
    const alb_session *s = &w->session;
    alb_progress progress;
    if (!alb_session_read(&w->session, folder, error))
        return false;
    snprintf(c->folder, sizeof c->folder, "%s", folder);
    memcpy(c->sample, s->plan.sample, sizeof c->sample);
    memcpy(c->channel_names, s->channel_names, sizeof c->channel_names);
    c->thickness_mm = s->plan.thickness_mm;
    c->refractive_index = s->plan.refractive_index;
    c->finish = s->plan.finish;
    c->channels = s->channels;
    c->white_level_dn = s->white_level_dn;
    alb_progress_begin(&progress, "calibrate", 4);
    bool ok = alb_noise_measure(&w->noise, s, error);
    memcpy(c->black_dn, w->noise.black_dn, sizeof c->black_dn);
    memcpy(c->read_noise_dn, w->noise.read_noise_dn, sizeof c->read_noise_dn);
    memcpy(c->gain_dn_per_electron, w->noise.gain_dn_per_electron, sizeof c->gain_dn_per_electron);
    alb_progress_at(&progress, 1);
    ok = ok && alb_geometry_measure(c, &w->boards, s, error);
    alb_progress_at(&progress, 2);
    ok = ok && measure_flat(w, error);
    alb_progress_at(&progress, 3);
    ok = ok && alb_products_make(c, w->images, s, &w->noise, error);
    alb_progress_end(&progress);
    return ok;
}

static bool write_results(work *w, alb_error *error)
{
    char path[ALB_PATH_SIZE], origin[ALB_HASH_SIZE + 128];
    alb_provenance provenance = {.command = "calibrate"};
    if (!alb_path_join(path, w->calibration.folder, "session.json", error) ||
        !alb_provenance_add(&provenance, path, error) ||
        !alb_path_join(path, w->calibration.folder, "calibration", error) || !alb_file_make_directory(path, error))
        return false;
    snprintf(origin, sizeof origin, "alabaster %s calibrate; session.json sha256 %s", ALB_VERSION,
             provenance.inputs[0].sha256);
    for (int i = 0; i < w->calibration.product_count; i++)
        if (!alb_calibration_image(path, &w->calibration, &w->calibration.products[i], error) ||
            !alb_exr_write(&w->images[i], origin, path, error))
            return false;
    return alb_calibration_write(&w->calibration, &provenance, error) &&
           alb_calibration_report(&w->calibration, &w->boards, w->noise.linearity, w->flat_rms, w->images, error);
}

static void print(const work *w)
{
    const alb_calibration *c = &w->calibration;
    printf("board, rms by view\n");
    alb_geometry_print(&w->boards);
    printf("lens      f %.2f +- %.2f px, rms %.3f px\n", c->views[0].camera.lens.fx, c->lens_sd[0], c->lens_rms_px);
    for (int s = 0; s < ALB_SIDES; s++)
        if (c->views[s].known)
            printf("pose      %-12s rms %.3f px, lengths known to %.3f %%\n", alb_side_names[s], c->views[s].rms_px,
                   100 * c->views[s].relative_length_sd);
    for (int i = 0; i < c->channels; i++)
        printf("sensor    %s  black %.3f +- %.3f DN, read noise %.3f DN, gain %.5f +- %.5f DN per electron\n",
               c->channel_names[i], c->black_dn[i].value, c->black_dn[i].sd, c->read_noise_dn[i].value,
               c->gain_dn_per_electron[i].value, c->gain_dn_per_electron[i].sd);
    printf("linearity %.3f %% over the exposures of the diffuser; vignetting fits to %.2f %% rms\n",
           100 * w->noise.linearity, 100 * w->flat_rms);
    for (int i = 0; i < c->product_count; i++)
        printf("product   calibration/%s.exr, scale known to %.3f %%\n", c->products[i].shot,
               100 * c->products[i].relative_scale_sd[0]);
}

static bool print_file(const char *folder, alb_error *error)
{
    char path[ALB_PATH_SIZE], *bytes = NULL;
    size_t size;
    if (!alb_path_join(path, folder, "calibration.json", error) || !alb_file_read(&bytes, &size, path, error))
        return false;
    fwrite(bytes, 1, size, stdout);
    free(bytes);
    return true;
}

static bool calibrate_session(const char *folder, bool as_json, alb_error *error)
{
    work *w = alb_allocate(1, sizeof *w, error);
    if (!w)
        return false;
    bool ok = measure(w, folder, error) && write_results(w, error);
    if (ok && as_json)
        ok = print_file(folder, error);
    else if (ok)
        print(w);
    work_free(w);
    return ok;
}

static bool board_size(alb_board *board, const char *text, const char *square, alb_error *error)
{
    char rest;
    if (sscanf(text, "%4dx%4d%c", &board->columns, &board->rows, &rest) != 2)
        return alb_fail(error, ALB_USAGE, "--board %.60s: expected COLUMNSxROWS, such as 9x6", text);
    return alb_option_number(&board->square_mm, "--square-mm", square, 1e-6, 1e6, error);
}

static void print_lens(const alb_lens_estimate *estimate, const alb_board_views *views)
{
    const alb_lens *l = &estimate->lens;
    const double *sd = estimate->sd;
    alb_geometry_print(views);
    printf("fx %.3f +- %.3f  fy %.3f +- %.3f  cx %.3f +- %.3f  cy %.3f +- %.3f px\n", l->fx, sd[0], l->fy, sd[1], l->cx,
           sd[2], l->cy, sd[3]);
    printf("k1 %.5f  k2 %.5f  p1 %.5f  p2 %.5f  k3 %.5f\n", l->k1, l->k2, l->p1, l->p2, l->k3);
    printf("rms %.4f px over %d photographs (2-D: sqrt(mean(du^2 + dv^2)))\n", estimate->rms_px, views->found_count);
}

static void put_lens(alb_json *json, const alb_lens_estimate *estimate, const alb_board_views *views)
{
    alb_lens_write(json, &estimate->lens, estimate->sd, estimate->rms_px);
    alb_json_list(json, "views");
    for (int v = 0; v < views->count; v++) {
        alb_json_object(json, NULL);
        alb_json_string(json, "name", views->name[v]);
        alb_json_boolean(json, "found", views->found[v]);
        alb_json_number(json, "rms_px", views->rms_px[v]);
        alb_json_end_object(json);
    }
    alb_json_end_list(json);
}

static bool calibrate_photographs(const char *folder, const alb_board *board, const char *out, bool as_json,
                                  alb_error *error)
{
    alb_board_views views = {0};
    alb_lens_estimate estimate;
    bool ok = alb_geometry_photographs(&estimate, &views, folder, board, error);
    if (ok && !as_json)
        print_lens(&estimate, &views);
    alb_provenance provenance = {.command = "calibrate"};
    snprintf(provenance.options, sizeof provenance.options, "--board %dx%d --square-mm %.9g", board->columns,
             board->rows, board->square_mm);
    for (int to_file = 0; ok && to_file < 2; to_file++) {
        if (to_file ? !out : !as_json)
            continue;
        alb_json json;
        alb_json_begin(&json, &provenance);
        put_lens(&json, &estimate, &views);
        ok = to_file ? alb_json_write(&json, out, error) : alb_json_print(&json, error);
    }
    alb_board_views_free(&views);
    return ok;
}

static bool run(int argc, char **argv, alb_error *error)
{
    const char *session = NULL, *photographs = NULL, *size = NULL, *square = NULL, *out = NULL;
    bool as_json = false;
    const alb_option options[] = {
        {.label = "SESSION", .value = &session}, {.name = "--photographs", .value = &photographs},
        {.name = "--board", .value = &size},     {.name = "--square-mm", .value = &square},
        {.name = "-o", .value = &out},           {.name = "--json", .flag = &as_json},
    };
    if (!alb_options_read(options, 6, argc, argv, error))
        return false;
    if (!session == !photographs)
        return alb_fail(error, ALB_USAGE, "give a SESSION or --photographs FOLDER; see alabaster help calibrate");
    if (session)
        return size || square || out ? alb_fail(error, ALB_USAGE, "--board, --square-mm and -o go with --photographs")
                                     : calibrate_session(session, as_json, error);
    alb_board board;
    if (!size || !square)
        return alb_fail(error, ALB_USAGE, "--photographs needs --board COLUMNSxROWS and --square-mm S");
    return board_size(&board, size, square, error) && calibrate_photographs(photographs, &board, out, as_json, error);
}

const alb_command alb_calibrate_command = {
    "calibrate", "session -> linear, absolute, metric images and what they rest on", usage, run};

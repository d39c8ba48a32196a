// Which photographs of a session, or of a folder, show the board, and what is asked of them: the lens from all, a
// pose from the one that lies on a face. The mathematics stands in target.c.
#include "calibrate/geometry.h"
#include "calibrate/frames.h"
#include <dirent.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

static bool look_at_shot(alb_board_views *views, const alb_session *session, const alb_shot *shot, int repeats,
                         const alb_board *board, alb_error *error)
{
    for (int r = 0; r < repeats; r++) {
        alb_image frame;
        char name[ALB_NAME_SIZE + 16];
        snprintf(name, sizeof name, "%s %d", shot->name, r + 1);
        if (!alb_frame_read(&frame, session, shot, 0, r, error))
            return false;
        const bool ok = alb_board_look(views, &frame, name, board, error);
        alb_image_free(&frame);
        if (!ok)
            return false;
    }
    return true;
}

// All photographs of the board, those that lie on a face among them; flat[side] is the view of that face, or -1.
static bool look_at_boards(alb_board_views *views, int flat[ALB_SIDES], const alb_session *session,
                           const alb_board *board, alb_error *error)
{
    flat[ALB_REFLECTION] = flat[ALB_TRANSMISSION] = -1;
    for (int s = 0; s < session->plan.shot_count; s++) {
        const alb_shot *shot = &session->plan.shots[s];
        if (shot->target != ALB_TARGET_BOARD)
            continue;
        if (!shot->in_hand)
            flat[shot->side] = views->count;
        if (!look_at_shot(views, session, shot, shot->in_hand ? shot->repeats : 1, board, error))
            return false;
        if (!shot->in_hand && !views->found[flat[shot->side]])
            return alb_fail(error, ALB_BAD_DATA, "%s: shot %s: no board of %d x %d inner corners is to be seen",
                            session->folder, shot->name, board->columns, board->rows);
    }
    return true;
}

bool alb_geometry_measure(alb_calibration *calibration, alb_board_views *views, const alb_session *session,
                          alb_error *error)
{
    const alb_plan *plan = &session->plan;
    const alb_board board = {plan->board_columns, plan->board_rows, plan->board_square_mm};
    alb_lens_estimate estimate;
    int flat[ALB_SIDES], terms;
    if (!look_at_boards(views, flat, session, &board, error) ||
        !alb_board_lens(&estimate, &terms, views, &board, session->width, session->height, error))
        return false;
    calibration->lens_rms_px = estimate.rms_px;
    memcpy(calibration->lens_sd, estimate.sd, sizeof estimate.sd);
    for (int s = 0; s < ALB_SIDES; s++) {
        alb_view *view = &calibration->views[s];
        view->camera.lens = estimate.lens;
        if (flat[s] < 0)
            continue;
        if (!alb_board_pose(&view->camera.camera_from_world, &view->rms_px, views, flat[s], &board, &estimate.lens,
                            error) ||
            !alb_board_length_sd(&view->relative_length_sd, views, flat[s], &board, &estimate.lens, terms, error))
            return false;
        view->known = true;
    }
    return true;
}

static int is_picture(const struct dirent *entry)
{
    static const char *const endings[] = {".png", ".jpg", ".jpeg", ".tif", ".tiff", ".exr", ".hdr", ".pfm"};
    const char *dot = strrchr(entry->d_name, '.');
    for (size_t i = 0; dot && i < sizeof endings / sizeof endings[0]; i++)
        if (!strcasecmp(dot, endings[i]))
            return 1;
    return 0;
}

static bool look_at_file(alb_board_views *views, int size[2], const char *folder, const char *name,
                         const alb_board *board, alb_error *error)
{
    char path[ALB_PATH_SIZE];
    alb_image photograph;
    if (!alb_path_join(path, folder, name, error) || !alb_image_read(&photograph, NULL, path, error))
        return false;
    bool ok = true;
    if (size[0] && (size[0] != photograph.width || size[1] != photograph.height))
        ok = alb_fail(error, ALB_BAD_DATA, "%s: %d x %d pixels, the photographs before it %d x %d", path,
                      photograph.width, photograph.height, size[0], size[1]);
    size[0] = photograph.width, size[1] = photograph.height;
    ok = ok && alb_board_look(views, &photograph, name, board, error);
    alb_image_free(&photograph);
    return ok;
}

bool alb_geometry_photographs(alb_lens_estimate *estimate, alb_board_views *views, const char *folder,
                              const alb_board *board, alb_error *error)
{
    struct dirent **entries = NULL;
    int size[2] = {0, 0}, terms;
    if (!alb_file_is_directory(folder))
        return alb_fail(error, ALB_ACCESS, "%s: no such folder", folder);
    const int count = scandir(folder, &entries, is_picture, alphasort);
    bool ok = count > 0 || alb_fail(error, ALB_BAD_DATA, "%s: no pictures in this folder", folder);
    for (int i = 0; i < count; i++) {
        ok = ok && look_at_file(views, size, folder, entries[i]->d_name, board, error);
        free(entries[i]);
    }
    free(entries);
    return ok && alb_board_lens(estimate, &terms, views, board, size[0], size[1], error);
}

void alb_geometry_print(const alb_board_views *views)
{
    for (int v = 0; v < views->count; v++)
        if (views->found[v])
            printf("  %-24s %6.3f px\n", views->name[v], views->rms_px[v]);
        else
            printf("  %-24s board not found\n", views->name[v]);
}

// Frame after frame: scene in, radiosity solved, picture out. Form factors and scattering know the meshes and materials
// alone: where a frame has those of the frame before, by their files' bytes, only its lights and the solution are made
// anew. The exposure is that of the first frame, so that brightness does not flicker.
#include "render/radiosity_command.h"
#include "base/memory.h"
#include "base/progress.h"
#include "render/solution.h"
#include "render/view.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef struct sequence {
    const alb_picture_files *to;
    double error_percent; // asked for by the user; 0: what the scene says
    alb_scene solved;     // lends its meshes to the solution
    alb_provenance from;  // of that scene
    alb_solution solution;
    bool as_good_as_can_be; // no error is asked for, or more rays than there are cannot be had
    double exposure;        // 0: none yet
    alb_json json;
    bool as_json, listed; // the list of frames is open
} sequence;

static bool write_mesh(const char *path, const alb_solution *solution, const alb_provenance *provenance,
                       alb_error *error)
{
    const size_t n = solution->patches.count;
    char comment[256];
    float(*rgb)[3] = alb_allocate(n, sizeof *rgb, error);
    if (!rgb)
        return false;
    for (size_t p = 0; p < n; p++)
        for (int c = 0; c < 3; c++)
            rgb[p][c] = (float)solution->radiosity[p][c];
    snprintf(comment, sizeof comment, "alabaster render: radiosity per face; scene sha256 %s",
             provenance->inputs[0].sha256);
    const bool ok = alb_mesh_write_ply(solution->patches.mesh, (const float(*)[3])rgb, comment, path, error);
    free(rgb);
    return ok;
}

static void warn(const alb_scene *scene, const alb_solution *s)
{
    size_t open = 0;
    if (scene->mesh.dropped)
        fprintf(stderr, "render: %zu faces left out: no area, or there twice\n", scene->mesh.dropped);
    if (scene->mesh.turned)
        fprintf(stderr, "render: %zu faces turned over: they faced against their neighbours\n", scene->mesh.turned);
    if (s->patches.culled)
        fprintf(stderr, "render: %zu patches lie inside other bodies or walls, in whole or in part: left out there\n",
                s->patches.culled);
    if (s->factors.back_rays)
        fprintf(stderr,
                "render: %.2f %% of the rays between patches meet the back of a patch, which is black; is a mesh open "
                "or turned?\n",
                100.0 * (double)s->factors.back_rays / (double)alb_hit_rows_rays(&s->factors.rows));
    for (size_t b = 0; b < s->scatter.body_count; b++)
        open += !s->scatter.bodies[b].closed;
    if (open)
        fprintf(stderr,
                "render: %zu translucent bodies are not closed; light paths inside them are taken as straight\n", open);
    alb_scatter_note(stderr, "render: ", &s->scatter);
    if (s->column_sum > 1)
        fprintf(stderr, "render: the mesh is coarse for its scattering: a patch gives back %.4f of its flux\n",
                s->column_sum);
}

static void put_json(alb_json *json, const alb_scene *scene, const alb_solution *s, double view_s, double exposure)
{
    double imbalance[3];
    const alb_balance *b = &s->balance;
    for (int c = 0; c < 3; c++)
        imbalance[c] = b->in[c] > 0 ? (b->in[c] - b->absorbed[c] - b->escaped[c] - b->lost[c]) / b->in[c] : 0;
    alb_json_integer(json, "patches", (long)s->patches.count);
    alb_json_integer(json, "dropped_faces", (long)scene->mesh.dropped);
    alb_json_integer(json, "turned_faces", (long)scene->mesh.turned);
    alb_json_integer(json, "culled_patches", (long)s->patches.culled);
    alb_json_integer(json, "rays_per_patch", s->factors.rays);
    alb_json_integer(json, "rays", (long)alb_hit_rows_rays(&s->factors.rows));
    alb_json_integer(json, "rays_cast_again", (long)s->factors.reshot_rays);
    alb_json_integer(json, "links", (long)s->scatter.link_count);
    alb_json_integer(json, "iterations", s->report.iterations);
    alb_json_number(json, "residual", s->report.residual);
    alb_json_number(json, "radiosity_bound_percent", 100 * s->bound);
    alb_json_number(json, "rays_error_percent", s->rays_error_percent);
    alb_json_number(json, "stated_error_percent", s->stated_error_percent);
    alb_json_number(json, "largest_row_sum", s->row_sum);
    alb_json_number(json, "largest_column_sum", s->column_sum);
    alb_json_object(json, "flux");
    alb_json_numbers(json, "in", b->in, 3);
    alb_json_numbers(json, "absorbed", b->absorbed, 3);
    alb_json_numbers(json, "escaped", b->escaped, 3);
    alb_json_numbers(json, "lost_on_backs", b->lost, 3);
    alb_json_numbers(json, "relative_imbalance", imbalance, 3);
    alb_json_end_object(json);
    alb_json_object(json, "seconds");
    for (int i = 0; i < ALB_STAGES; i++)
        alb_json_number(json, alb_stage_names[i], s->seconds[i]);
    alb_json_number(json, "view", view_s);
    alb_json_end_object(json);
    alb_json_object(json, "bytes");
    for (int i = 0; i < ALB_STAGES; i++)
        alb_json_integer(json, alb_stage_names[i], (long)s->bytes[i]);
    alb_json_end_object(json);
    alb_json_number(json, "png_exposure", exposure);
}

static void report(sequence *s, const alb_scene *scene, const alb_frame_files *files, bool relit, double view_s)
{
    const alb_solution *solution = &s->solution;
    double total_s = view_s;
    for (int i = 0; i < ALB_STAGES; i++)
        total_s += solution->seconds[i];
    if (s->as_json && scene->frames > 1) {
        if (!s->listed)
            alb_json_list(&s->json, "frames");
        s->listed = true;
        alb_json_object(&s->json, NULL);
        alb_json_string(&s->json, "picture", files->picture);
        alb_json_boolean(&s->json, "relit", relit);
        put_json(&s->json, scene, solution, view_s, s->exposure);
        alb_json_end_object(&s->json);
    } else if (s->as_json) {
        put_json(&s->json, scene, solution, view_s, s->exposure);
    } else {
        printf("%s: %zu patches, %d products to residual %.1e, stated error %.2f %%, largest row sum %.4f, %.1f s\n",
               files->picture, solution->patches.count, solution->report.iterations, solution->report.residual,
               solution->stated_error_percent, solution->row_sum, total_s);
        fflush(stdout);
    }
}

static bool same_bodies(const sequence *s, const alb_scene *scene, const alb_provenance *provenance)
{
    bool same = s->solution.patches.count && scene->body_inputs == s->solved.body_inputs;
    for (int i = 0; same && i < scene->body_inputs; i++)
        same = !strcmp(provenance->inputs[i].sha256, s->from.inputs[i].sha256);
    return same;
}

// The same bodies under other lights. Not enough: this light asks for more rays.
static bool relight(sequence *s, const alb_scene *scene, bool *enough, alb_error *error)
{
    for (int i = 0; i < ALB_STAGES; i++)
        s->solution.seconds[i] = 0;
    if (!alb_solution_relight(&s->solution, scene, error))
        return false;
    *enough = s->as_good_as_can_be || s->solution.rays_error_percent <= scene->error_percent;
    return true;
}

// Takes the scene where the solution is made of it; what is left of it the caller frees.
static bool solve(sequence *s, alb_scene *scene, const alb_provenance *provenance, bool *relit, alb_error *error)
{
    *relit = false;
    if (same_bodies(s, scene, provenance) && !relight(s, scene, relit, error))
        return false;
    if (*relit)
        return true;
    alb_solution_free(&s->solution);
    alb_scene_free(&s->solved);
    if (!alb_solution_create(&s->solution, scene, error))
        return false;
    warn(scene, &s->solution);
    s->from = *provenance;
    s->as_good_as_can_be = scene->error_percent <= 0 || s->solution.rays_error_percent > scene->error_percent;
    return true;
}

static bool take_picture(sequence *s, const alb_scene *scene, const alb_provenance *provenance,
                         const alb_frame_files *files, alb_error *error)
{
    alb_image picture = {0};
    bool ok = alb_view_render(&picture, scene, &s->solution, error);
    if (ok && !(s->exposure > 0))
        ok = alb_view_exposure(&s->exposure, &picture, alb_view_brightest(scene, &s->solution), error);
    ok = ok && alb_frame_files_write(files, &picture, s->exposure, provenance, error) &&
         (!files->mesh[0] || write_mesh(files->mesh, &s->solution, provenance, error));
    alb_image_free(&picture);
    return ok;
}

static bool render_frame(sequence *s, int frame, int *frames, alb_error *error)
{
    alb_scene scene;
    alb_frame_files files;
    alb_provenance provenance = {.command = "render"};
    bool relit = false;
    if (!alb_scene_read_frame(&scene, &provenance, s->to->scene, frame, error))
        return false;
    *frames = scene.frames;
    if (s->error_percent > 0)
        alb_scene_ask_error(&scene, s->error_percent);
    const int length = snprintf(provenance.options, sizeof provenance.options,
                                "rays_per_patch %d, error_percent %g, residual %g, seed %llu", scene.rays_per_patch,
                                scene.error_percent, scene.residual, (unsigned long long)scene.seed);
    if (scene.frames > 1)
        snprintf(provenance.options + length, sizeof provenance.options - (size_t)length, ", frame %d of %d", frame,
                 scene.frames);
    bool ok =
        alb_frame_files_name(&files, s->to, frame, scene.frames, error) && solve(s, &scene, &provenance, &relit, error);
    const double start_s = alb_clock_s();
    ok = ok && take_picture(s, &scene, &provenance, &files, error);
    if (ok)
        report(s, &scene, &files, relit, alb_clock_s() - start_s);
    if (ok && !relit)
        s->solved = scene;
    else
        alb_scene_free(&scene);
    return ok;
}

bool alb_radiosity_render(const alb_picture_files *files, double error_percent, bool json, alb_error *error)
{
    sequence s = {.to = files, .error_percent = error_percent, .as_json = json};
    alb_progress progress;
    int frames = 1;
    bool ok = true;
    alb_json_begin(&s.json, NULL);
    alb_progress_begin(&progress, "frames", 1);
    for (int frame = 0; ok && frame < frames; frame++) {
        ok = render_frame(&s, frame, &frames, error);
        progress.total = frames;
        alb_progress_at(&progress, frame + 1);
    }
    alb_progress_end(&progress);
    if (s.listed)
        alb_json_end_list(&s.json);
    ok = ok && (!json || alb_json_print(&s.json, error));
    alb_json_free(&s.json);
    alb_solution_free(&s.solution);
    alb_scene_free(&s.solved);
    return ok;
}

#include "render/shadow_studio.h"
#include "base/memory.h"
#include <omp.h>
#include <stdlib.h>

static bool create_works(alb_shadow_studio *s, int side, alb_error *error)
{
    const size_t n = s->shape.cluster_count, pixels = (size_t)(side * side);
    s->work_count = omp_get_max_threads();
    if (!(s->works = alb_allocate((size_t)s->work_count, sizeof *s->works, error)))
        return false;
    for (int t = 0; t < s->work_count; t++) {
        alb_shadow_work *w = &s->works[t];
        w->corners.count = n;
        if (!(w->corners.x = alb_allocate(n, sizeof(float), error)) ||
            !(w->corners.y = alb_allocate(n, sizeof(float), error)))
            return false;
        if (s->shape.face_colours && (!(w->corners.depth = alb_allocate(n, sizeof(float), error)) ||
                                      !(w->nearest = alb_allocate(pixels, sizeof *w->nearest, error)) ||
                                      !(w->seen = alb_allocate(pixels, sizeof *w->seen, error))))
            return false;
    }
    return true;
}

static bool create_nodes(alb_shadow_nodes *out, int cells, alb_error *error)
{
    const alb_shadow_grid grid = {cells};
    const size_t count = out->count = (size_t)alb_shadow_grid_count(grid);
    if (!(out->directions = alb_allocate(count, sizeof *out->directions, error)) ||
        !(out->axes = alb_allocate(3 * count, sizeof *out->axes, error)))
        return false;
    for (size_t n = 0; n < count; n++) {
        const alb_vector d = out->directions[n] = alb_shadow_grid_direction(grid, (int)n);
        out->axes[n] = (float)-d.x;
        out->axes[count + n] = (float)-d.y;
        out->axes[2 * count + n] = (float)-d.z;
    }
    return true;
}

bool alb_shadow_studio_create(alb_shadow_studio *studio, const alb_shadow_field *field, const alb_mesh *mesh,
                              const float (*face_radiance)[3], const char *name, alb_error *error)
{
    const alb_shadow_settings *settings = &field->settings;
    size_t most = 0;
    for (int i = 0; i < field->shell_count; i++) {
        const alb_shadow_shell *shell = &field->shells[i];
        if (!create_nodes(&studio->nodes[i], shell->cells, error) ||
            (i >= settings->inner &&
             !alb_shadow_lens_create(&studio->lenses[i], settings->pixels, shell->order, shell->radius, error)))
            return false;
        const size_t floats = studio->nodes[i].count * (size_t)field->channels * alb_shadow_shell_values(shell);
        most = floats > most ? floats : most;
    }
    return (studio->local = alb_allocate(most, sizeof *studio->local, error)) &&
           (studio->vertices = alb_allocate(mesh->vertex_count, sizeof *studio->vertices, error)) &&
           alb_shadow_shape_create(&studio->shape, mesh, face_radiance, settings->cluster * field->sphere.radius_mm,
                                   name, error) &&
           create_works(studio, settings->pixels, error) &&
           (!settings->inner || alb_shadow_lattice_create(&studio->rays, settings->rays, settings->order, error));
}

void alb_shadow_studio_free(alb_shadow_studio *s)
{
    for (int t = 0; t < s->work_count && s->works; t++) {
        free(s->works[t].corners.x);
        free(s->works[t].corners.y);
        free(s->works[t].corners.depth);
        free(s->works[t].nearest);
        free(s->works[t].seen);
    }
    free(s->works);
    for (int i = 0; i < ALB_SHADOW_SHELLS_MAX; i++) {
        alb_shadow_lens_free(&s->lenses[i]);
        free(s->nodes[i].directions);
        free(s->nodes[i].axes);
    }
    alb_shadow_shape_free(&s->shape);
    free(s->local);
    free(s->vertices);
    alb_shadow_lattice_free(&s->rays);
    *s = (alb_shadow_studio){0};
}

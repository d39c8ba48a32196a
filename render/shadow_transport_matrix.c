// Of a translucent body what goes in at one place comes out at others: the exitance of patch j is sum_i S_ji E_i
// (scatter.h), so with E_i = T_i . L each vertex has a vector for each of three colours, a matrix from the light's
// coefficients to the radiosity:
//     T'_v,c = sum over the faces j around v of w_j / rho_c sum_i S_ji,c T_i      w_j their shares of the area
// rho_c the total of the profile: T'_v,c . L is the even irradiance that would send out the same. T_i of a patch is the
// mean of its corners'. Opaque faces around the vertex keep its own vector.
#include "base/memory.h"
#include "render/patch.h"
#include "render/shadow_transport.h"
#include <stdlib.h>
#include <string.h>

typedef struct solid {
    alb_mesh mesh; // the faces that scatter
    uint16_t *materials;
    alb_patches patches;
    alb_scatter scatter;
    double *around_mm2;                       // of each row: area of the faces around
    double (*in)[3], (*out)[3], (*totals)[3]; // of patches; of materials: of their profiles
} solid;

static bool scatters(const alb_scene *scene, size_t face) { return scene->surfaces[scene->mesh.groups[face]].scatters; }

static bool find_totals(solid *s, const alb_scene *scene, alb_error *error)
{
    if (!(s->totals = alb_allocate(scene->surface_count, sizeof *s->totals, error)))
        return false;
    for (size_t i = 0; i < scene->surface_count; i++)
        for (int c = 0; c < 3 && scene->surfaces[i].scatters; c++)
            s->totals[i][c] = alb_profile_total(&scene->surfaces[i].profiles[ALB_REFLECTION][c]);
    return true;
}

static bool create_solid(solid *s, alb_shadow_transport *t, const alb_scene *scene, alb_error *error)
{
    const alb_mesh *all = &scene->mesh;
    bool ok = (s->materials = alb_allocate(all->face_count, sizeof *s->materials, error)) &&
              (s->around_mm2 = alb_allocate(t->row_count, sizeof *s->around_mm2, error)) &&
              (t->matrix_of = alb_allocate(t->row_count, sizeof *t->matrix_of, error));
    for (size_t row = 0; ok && row < t->row_count; row++)
        t->matrix_of[row] = ALB_TRANSPORT_NONE;
    for (size_t v = 0; ok && v < all->vertex_count; v++)
        ok = alb_mesh_add_vertex(&s->mesh, all->vertices[v], error);
    for (size_t f = 0; ok && f < all->face_count; f++) {
        const uint32_t *v = all->faces[f];
        if (t->rows[v[0]] == ALB_TRANSPORT_NONE)
            continue;
        const alb_vector a = all->vertices[v[0]],
                         twice = alb_cross(alb_sub(all->vertices[v[1]], a), alb_sub(all->vertices[v[2]], a));
        for (int k = 0; k < 3; k++)
            s->around_mm2[t->rows[v[k]]] += 0.5 * alb_length(twice);
        if (!scatters(scene, f))
            continue;
        for (int k = 0; k < 3; k++)
            if (t->matrix_of[t->rows[v[k]]] == ALB_TRANSPORT_NONE)
                t->matrix_of[t->rows[v[k]]] = (uint32_t)t->matrix_count++;
        const size_t before = s->mesh.face_count;
        ok = alb_mesh_add_face(&s->mesh, v[0], v[1], v[2], 0, error);
        if (s->mesh.face_count > before)
            s->materials[before] = all->groups[f];
    }
    const size_t n = s->mesh.face_count;
    return ok && (!n || ((t->matrices = alb_allocate(t->matrix_count, sizeof *t->matrices, error)) &&
                         (s->in = alb_allocate(n, sizeof *s->in, error)) &&
                         (s->out = alb_allocate(n, sizeof *s->out, error)) && find_totals(s, scene, error) &&
                         alb_patches_create(&s->patches, &s->mesh, error) &&
                         alb_scatter_create(&s->scatter, &s->patches, s->materials, scene->surfaces, 0.005, error)));
}

static void free_solid(solid *s)
{
    alb_scatter_free(&s->scatter);
    alb_patches_free(&s->patches);
    alb_mesh_free(&s->mesh);
    free(s->materials);
    free(s->around_mm2);
    free(s->in);
    free(s->out);
    free(s->totals);
}

// Coefficient i of all.
static void add_column(alb_shadow_transport *t, solid *s, size_t i)
{
    for (size_t p = 0; p < s->mesh.face_count; p++) {
        const uint32_t *v = s->mesh.faces[p];
        for (int c = 0; c < 3; c++)
            s->in[p][c] = 0;
        for (int k = 0; k < 9; k++)
            s->in[p][k % 3] += (double)t->vectors[t->rows[v[k / 3]]][i] / 3;
    }
    alb_scatter_apply(s->out, &s->scatter, (const double(*)[3])s->in);
    for (size_t p = 0; p < s->mesh.face_count; p++) {
        for (int k = 0; k < 9; k++) {
            const size_t row = t->rows[s->mesh.faces[p][k / 3]];
            const double total = s->totals[s->materials[p]][k % 3],
                         share = s->patches.areas_mm2[p] / s->around_mm2[row],
                         out = total > 0 ? s->out[p][k % 3] / total : 0;
            t->matrices[t->matrix_of[row]][k % 3][i] += (float)(share * (out - (double)t->vectors[row][i]));
        }
    }
}

bool alb_shadow_transport_scatter(alb_shadow_transport *t, const alb_scene *scene, alb_error *error)
{
    solid s = {0};
    const bool ok = create_solid(&s, t, scene, error);
    for (size_t row = 0; ok && row < t->row_count; row++)
        for (int c = 0; c < 3 && t->matrix_of[row] != ALB_TRANSPORT_NONE; c++)
            memcpy(t->matrices[t->matrix_of[row]][c], t->vectors[row], sizeof t->vectors[row]);
    for (size_t i = 0; ok && s.mesh.face_count && i < ALB_SH_COUNT_MAX; i++)
        add_column(t, &s, i);
    free_solid(&s);
    return ok;
}

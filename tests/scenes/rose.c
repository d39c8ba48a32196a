// Petals 0.4 mm thick: sheets of two opposing faces, corner over corner, joined by a rim. In polar form about the foot
// a petal is theta = opening_k + curl(s), s the distance from the foot: as the opening grows from petal to petal by
// more than the thickness over s, no petal meets another.
#include "scenes/parts.h"
#include "scenes/scenes.h"
#include "scenes/shapes.h"

enum { PETAL, TABLE, SURFACES };
enum { PETALS = 26 };
static const double thickness = 0.4, nearest = 11;

typedef struct petal {
    double opening, azimuth, half_width, length;
} petal;

static petal petal_at(int k)
{
    const double t = (double)k / (PETALS - 1);
    return (petal){.opening = (6 + 66 * t) * M_PI / 180,
                   .azimuth = 2.39996322972865332 * k, // the golden angle
                   .half_width = (100 - 52 * t) * M_PI / 180,
                   .length = 36 + 16 * t};
}

// The middle of the sheet at u in -1..1 across and v in 0..1 from the foot outwards.
static alb_vector middle_of(const petal *p, double u, double v)
{
    const double length = p->length * (1 - 0.22 * pow(fabs(u), 2.6)); // rounded tip
    const double width = p->half_width * (0.7 + 0.3 * sin(M_PI * (0.2 + 0.55 * v)));
    const double s = nearest + (length - nearest) * v, azimuth = p->azimuth + width * u, far = s / 50;
    const double theta = p->opening + 0.34 * far * far * far + 0.03 * far * far * sin(5 * azimuth);
    return (alb_vector){s * sin(theta) * cos(azimuth), s * sin(theta) * sin(azimuth), s * cos(theta)};
}

static alb_vector side_of(const petal *p, double u, double v, double side)
{
    const double d = 1e-5;
    const alb_vector along_u = alb_sub(middle_of(p, u + d, v), middle_of(p, u - d, v));
    const alb_vector along_v = alb_sub(middle_of(p, u, v + d), middle_of(p, u, v - d));
    const alb_vector normal = alb_unit(alb_cross(along_u, along_v));
    return alb_add(middle_of(p, u, v), alb_times(0.5 * side * thickness, normal));
}

static bool add_petal(alb_mesh *mesh, const petal *p, int columns, int rows, alb_error *error)
{
    const uint32_t wide = (uint32_t)columns + 1, start = (uint32_t)mesh->vertex_count;
    const uint32_t first[2] = {start, start + wide * ((uint32_t)rows + 1)};
    for (int side = -1; side <= 1; side += 2)
        for (int j = 0; j <= rows; j++)
            for (int i = 0; i <= columns; i++) {
                const alb_vector at = side_of(p, 2.0 * i / columns - 1, (double)j / rows, -side);
                if (!alb_mesh_add_vertex(mesh, alb_add(at, (alb_vector){0, 0, 2}), error))
                    return false;
            }
    for (int side = 0; side < 2; side++)
        for (int j = 0; j < rows; j++)
            for (int i = 0; i < columns; i++) {
                const uint32_t a = first[side] + (uint32_t)j * wide + (uint32_t)i, b = a + 1, c = b + wide,
                               d = a + wide;
                const uint32_t q[4] = {(i + j) % 2 ? b : a, (i + j) % 2 ? c : b, (i + j) % 2 ? d : c,
                                       (i + j) % 2 ? a : d};
                for (int k = 1; k < 3; k++)
                    if (!alb_mesh_add_face(mesh, q[0], q[side ? k + 1 : k], q[side ? k : k + 1], PETAL, error))
                        return false;
            }
    const int around = 2 * (columns + rows);
    for (int k = 0; k < around; k++) { // the rim, counter-clockwise in (u, v)
        uint32_t at[2];
        for (int e = 0; e < 2; e++) {
            const int step = (k + e) % around;
            const int i = step < columns              ? step
                          : step < columns + rows     ? columns
                          : step < 2 * columns + rows ? 2 * columns + rows - step
                                                      : 0;
            const int j = step < columns              ? 0
                          : step < columns + rows     ? step - columns
                          : step < 2 * columns + rows ? rows
                                                      : around - step;
            at[e] = (uint32_t)j * wide + (uint32_t)i;
        }
        if (!alb_mesh_add_face(mesh, first[0] + at[0], first[1] + at[0], first[1] + at[1], PETAL, error) ||
            !alb_mesh_add_face(mesh, first[0] + at[0], first[1] + at[1], first[0] + at[1], PETAL, error))
            return false;
    }
    return true;
}

bool scene_rose(alb_scene *scene, double detail, int frame, alb_error *error)
{
    (void)frame;
    const double reflected[3] = {0.42, 0.1, 0.13}, transmitted[3] = {0.36, 0.05, 0.07}, decay[3] = {1.2, 2.2, 2};
    alb_surface surfaces[SURFACES] = {surface_translucent("petal", reflected, decay),
                                      surface_opaque("table", 0.3, 0.3, 0.32)};
    const alb_surface through = surface_translucent("petal", transmitted, decay);
    surfaces[PETAL].slab = true;
    for (int c = 0; c < 3; c++)
        surfaces[PETAL].profiles[ALB_TRANSMISSION][c] = through.profiles[ALB_REFLECTION][c];
    const alb_light lights[2] = {
        {.kind = ALB_LIGHT_ENVIRONMENT, .radiance = {0.3, 0.35, 0.4}},
        {.kind = ALB_LIGHT_POINT, .position_mm = {-90, -60, 160}, .flux = {5e5, 4.8e5, 4.4e5}}};
    *scene = (alb_scene){.camera = alb_camera_look_at((alb_vector){30, -125, 110}, (alb_vector){0, 0, 20},
                                                      (alb_vector){0, 0, 1}, 45, 480, 480)};
    bool ok =
        scene_furnish(scene, surfaces, SURFACES, lights, 2, error) &&
        scene_add_box(scene, (alb_vector){0, 0, -10}, (alb_vector){240, 240, 8}, 0, 6 / detail, false, TABLE, error);
    const int cells = (int)fmax(4, round(24 * detail));
    for (int k = 0; ok && k < PETALS; k++) {
        const petal p = petal_at(k);
        ok = add_petal(&scene->mesh, &p, cells, cells, error);
    }
    if (!ok)
        alb_scene_free(scene);
    return ok;
}

// Everything round is a loft: closed rings of points along a path, both ends drawn together in a point.
#include "scenes/shadow_scenes.h"
#include "base/memory.h"
#include "render/shape.h"
#include "scenes/parts.h"
#include "scenes/shapes.h"
#include <math.h>

enum { FRAMES = 60, SKY_WIDTH = 64, SKY_HEIGHT = 32 };
typedef alb_vector (*ring_point)(const void *context, double along, double around); // both 0..1

static bool add_loft(alb_mesh *mesh, int rings, int points, ring_point at, const void *context, uint16_t group,
                     alb_error *error)
{
    const uint32_t first = (uint32_t)mesh->vertex_count, count = (uint32_t)(rings * points);
    for (int r = 0; r < rings; r++)
        for (int p = 0; p < points; p++)
            if (!alb_mesh_add_vertex(mesh, at(context, (r + 0.5) / rings, (double)p / points), error))
                return false;
    for (int end = 0; end < 2; end++) { // the middle of the first and of the last ring, a little beyond
        alb_vector middle = {0};
        for (int p = 0; p < points; p++)
            middle = alb_add(middle, alb_times(1.0 / points, at(context, end, (double)p / points)));
        if (!alb_mesh_add_vertex(mesh, middle, error))
            return false;
    }
    for (int r = 0; r + 1 < rings; r++)
        for (int p = 0; p < points; p++) {
            const uint32_t next = (uint32_t)((p + 1) % points), row = first + (uint32_t)(r * points),
                           a = row + (uint32_t)p, b = row + next, c = a + (uint32_t)points, d = b + (uint32_t)points;
            if (!alb_mesh_add_face(mesh, a, b, d, group, error) || !alb_mesh_add_face(mesh, a, d, c, group, error))
                return false;
        }
    for (int p = 0; p < points; p++) {
        const uint32_t next = (uint32_t)((p + 1) % points), last = first + count - (uint32_t)points;
        if (!alb_mesh_add_face(mesh, first + count, first + next, first + (uint32_t)p, group, error) ||
            !alb_mesh_add_face(mesh, first + count + 1, last + (uint32_t)p, last + next, group, error))
            return false;
    }
    return true;
}

static bool begin(alb_scene *scene, const alb_surface *surfaces, size_t surface_count, const alb_light *light,
                  alb_camera camera, alb_error *error)
{
    *scene = (alb_scene){.camera = camera, .frames = FRAMES};
    if (!scene_furnish(scene, surfaces, surface_count, light, light ? 1 : 0, error) ||
        !(scene->objects = alb_allocate(4, sizeof *scene->objects, error)))
        return false;
    const alb_object ground = {.receives_only = true};
    scene->objects[scene->object_count++] = ground;
    return true;
}

// What was added to the mesh since the last object is one.
static void close_object(alb_scene *scene, bool receives_only)
{
    alb_object *last = &scene->objects[scene->object_count - 1];
    last->vertex_count = scene->mesh.vertex_count - last->first_vertex;
    last->receives_only = receives_only;
}

static void next_object(alb_scene *scene)
{
    scene->objects[scene->object_count++] = (alb_object){.first_vertex = scene->mesh.vertex_count};
}

// 10,000 vertices: the ground is always the first object, of the first surface.
static bool add_plane(alb_scene *scene, double half_mm, alb_error *error)
{
    const bool ok = shape_sheet(&scene->mesh, (alb_vector){-half_mm, -half_mm, 0}, (alb_vector){2 * half_mm, 0, 0},
                                (alb_vector){0, 2 * half_mm, 0}, 99, 99, 0, error);
    close_object(scene, true);
    next_object(scene);
    return ok;
}

static bool finish(bool ok, alb_scene *scene)
{
    if (ok)
        close_object(scene, false);
    else
        alb_scene_free(scene);
    return ok;
}

// A picture of the sky: even, with soft round suns.
typedef struct sun {
    alb_vector towards;
    double half_angle_deg, radiance[3];
} sun;

static bool paint_sky(alb_light *light, const sun *suns, int count, const double even[3], alb_error *error)
{
    *light = (alb_light){.kind = ALB_LIGHT_ENVIRONMENT};
    if (!alb_image_create(&light->map, SKY_WIDTH, SKY_HEIGHT, "R,G,B", error))
        return false;
    for (int y = 0; y < SKY_HEIGHT; y++)
        for (int x = 0; x < SKY_WIDTH; x++) {
            const double theta = M_PI * (y + 0.5) / SKY_HEIGHT, phi = 2 * M_PI * ((x + 0.5) / SKY_WIDTH - 0.5);
            const alb_vector to = {sin(theta) * sin(phi), cos(theta), -sin(theta) * cos(phi)};
            for (int c = 0; c < 3; c++) {
                double sum = even[c];
                for (int k = 0; k < count; k++) {
                    const double edge = cos(M_PI / 180 * suns[k].half_angle_deg),
                                 into = alb_dot(alb_unit(suns[k].towards), to) - edge;
                    sum += suns[k].radiance[c] * fmin(fmax(0.5 + 4 * into, 0), 1);
                }
                alb_image_at(&light->map, x, y)[c] = (float)sum;
            }
        }
    return true;
}

// --- a flapping creature -------------------------------------------------------------------------------------------

typedef struct creature {
    double phase;
    int side; // of the wing
} creature;

static alb_vector body_ring(const void *context, double along, double around)
{
    const creature *c = context;
    const double x = 150 * (along - 0.5), wave = 2 * M_PI * (c->phase - along);
    const double thick = 4 + 20 * pow(sin(M_PI * pow(along, 0.75)), 3) + 8 * exp(-pow((along - 0.93) / 0.05, 2));
    const double z = 130 + 6 * sin(wave) + 40 * pow(fmax(along - 0.65, 0) / 0.35, 2), angle = 2 * M_PI * around;
    return (alb_vector){x, thick * cos(angle), z + 0.8 * thick * sin(angle)};
}

static alb_vector wing_ring(const void *context, double along, double around)
{
    const creature *c = context;
    const double span = 140, flap = 0.75 * sin(2 * M_PI * c->phase), lag = 0.5 * cos(2 * M_PI * c->phase);
    const double s = along * span, turn = flap + lag * along; // a wing that bends about its root
    const double chord = 62 * sqrt(fmax(1 - along * along, 0)) + 4, angle = -2 * M_PI * around;
    const double x = -8 - 25 * along + 0.5 * chord * cos(angle), off = 2.5 * sin(angle);
    return (alb_vector){x, c->side * (10 + s * cos(turn) - off * sin(turn) * c->side),
                        136 + 6 * sin(2 * M_PI * (c->phase - 0.5)) + s * sin(turn) + off * cos(turn) * c->side};
}

static bool create_dragon(alb_scene *scene, int frame, alb_error *error)
{
    const alb_surface surfaces[] = {surface_opaque("ground", 0.6, 0.58, 0.52), surface_opaque("skin", 0.35, 0.5, 0.3)};
    const sun suns[] = {{{-0.4, 0.7, 0.8}, 38, {2.2, 2, 1.6}}};
    const double even[3] = {0.25, 0.3, 0.4};
    const alb_camera camera =
        alb_camera_look_at((alb_vector){170, -520, 330}, (alb_vector){0, 0, 70}, (alb_vector){0, 0, 1}, 42, 640, 480);
    alb_light sky = {0};
    bool ok = paint_sky(&sky, suns, 1, even, error);
    ok = begin(scene, surfaces, 2, ok ? &sky : NULL, camera, error) && ok && add_plane(scene, 300, error);
    creature c = {.phase = (double)frame / FRAMES};
    ok = ok && add_loft(&scene->mesh, 30, 16, body_ring, &c, 1, error);
    for (c.side = -1; c.side <= 1; c.side += 2)
        ok = ok && add_loft(&scene->mesh, 17, 18, wing_ring, &c, 1, error);
    return finish(ok, scene);
}

// --- an egg under a light of two leaves ----------------------------------------------------------------------------

static alb_vector egg_ring(const void *context, double along, double around)
{
    const double phase = *(const double *)context, polar = M_PI * along, angle = 2 * M_PI * around;
    const double swell = 1 + 0.18 * sin(2 * M_PI * phase) * cos(2 * angle) * pow(sin(polar), 2) +
                         0.12 * cos(2 * M_PI * phase) * cos(3 * polar);
    const double r = 45 * swell * sin(polar) * (1 + 0.15 * cos(polar));
    return (alb_vector){r * cos(angle), r * sin(angle), 70 - 60 * swell * cos(polar)};
}

static bool create_egg(alb_scene *scene, int frame, alb_error *error)
{
    alb_surface surfaces[] = {surface_opaque("ground", 0.6, 0.6, 0.6), surface_opaque("shell", 0.75, 0.7, 0.6),
                              surface_opaque("red", 0, 0, 0), surface_opaque("green", 0, 0, 0)};
    const double glow[2][3] = {{40, 8, 5}, {6, 32, 8}};
    for (int k = 0; k < 2; k++)
        for (int c = 0; c < 3; c++)
            surfaces[2 + k].exitance[c] = glow[k][c];
    const double phase = (double)frame / FRAMES, fold = 0.35 + 0.3 * sin(2 * M_PI * phase);
    const alb_camera camera =
        alb_camera_look_at((alb_vector){60, -430, 260}, (alb_vector){0, 0, 45}, (alb_vector){0, 0, 1}, 42, 640, 480);
    bool ok = begin(scene, surfaces, 4, NULL, camera, error) && add_plane(scene, 250, error) &&
              add_loft(&scene->mesh, 22, 22, egg_ring, &phase, 1, error);
    if (ok)
        close_object(scene, false), next_object(scene);
    const alb_vector hinge = {90 * cos(2 * M_PI * phase) - 40, -60, 260}, up = {0, 120, 0}; // fronts face down
    const alb_vector leaf[2] = {{90 * cos(fold), 0, -90 * sin(fold)}, {-90 * cos(fold), 0, -90 * sin(fold)}};
    ok = ok && shape_sheet(&scene->mesh, hinge, up, leaf[0], 2, 2, 2, error) &&
         shape_sheet(&scene->mesh, hinge, leaf[1], up, 2, 2, 3, error);
    return finish(ok, scene);
}

// --- a bending sponge ----------------------------------------------------------------------------------------------

static bool create_sponge(alb_scene *scene, int frame, alb_error *error)
{
    const alb_surface surfaces[] = {surface_opaque("ground", 0.55, 0.55, 0.6),
                                    surface_opaque("sponge", 0.8, 0.65, 0.2)};
    const sun suns[] = {{{0.6, 0.6, 0.7}, 38, {2.4, 2.2, 1.9}}};
    const double even[3] = {0.25, 0.28, 0.35};
    const alb_camera camera =
        alb_camera_look_at((alb_vector){120, -470, 260}, (alb_vector){0, 0, 60}, (alb_vector){0, 0, 1}, 42, 640, 480);
    const alb_box box = {.size_mm = {180, 110, 70}, .cells = {50, 36, 28}, .grading = 1};
    const double phase = 2 * M_PI * frame / FRAMES, bend = 1.9 * sin(phase) / 180, twist = 0.9 * cos(phase) / 180;
    alb_light sky = {0};
    alb_mesh block = {0};
    bool ok = paint_sky(&sky, suns, 1, even, error);
    ok = begin(scene, surfaces, 2, ok ? &sky : NULL, camera, error) && ok && add_plane(scene, 300, error) &&
         alb_shape_box(&block, &box, error) && alb_mesh_append(&scene->mesh, &block, 1, (alb_vector){0}, error);
    for (size_t i = scene->mesh.vertex_count - block.vertex_count; ok && i < scene->mesh.vertex_count; i++) {
        alb_vector v = scene->mesh.vertices[i];
        const double t = twist * v.x, y = v.y * cos(t) - v.z * sin(t), z = v.y * sin(t) + v.z * cos(t);
        const double turn = bend * v.x, along = fabs(bend) > 1e-9 ? sin(turn) / bend : v.x,
                     lift = fabs(bend) > 1e-9 ? (1 - cos(turn)) / bend : 0;
        scene->mesh.vertices[i] = (alb_vector){along - z * sin(turn), y, 115 + lift + z * cos(turn)};
    }
    for (size_t f = scene->mesh.face_count - block.face_count; ok && f < scene->mesh.face_count; f++)
        scene->mesh.groups[f] = 1;
    alb_mesh_free(&block);
    return finish(ok, scene);
}

// --- a teapot on a plane in a room-sized environment ---------------------------------------------------------------

static alb_vector pot_ring(const void *context, double along, double around)
{
    (void)context;
    const double polar = M_PI * along, angle = 2 * M_PI * around, knob = exp(-pow((along - 0.965) / 0.02, 2));
    const double r = 62 * pow(sin(polar), 0.7) * (1 - 0.12 * along) + 9 * knob;
    return (alb_vector){r * cos(angle), r * sin(angle), 48 - 46 * cos(polar) + 18 * fmax(along - 0.93, 0) / 0.07};
}

static alb_vector spout_ring(const void *context, double along, double around)
{
    (void)context;
    const double angle = -2 * M_PI * around, r = 14 - 7 * along, slope = atan2(100 * along, 55);
    return (alb_vector){50 + 55 * along - r * cos(angle) * sin(slope), r * sin(angle),
                        38 + 50 * along * along + r * cos(angle) * cos(slope)};
}

static alb_vector handle_ring(const void *context, double along, double around)
{
    (void)context;
    const double angle = -2 * M_PI * around, bow = M_PI * (along - 0.5), r = 6;
    return (alb_vector){-40 - (50 + r * cos(angle)) * cos(bow), r * sin(angle), 50 + (30 + r * cos(angle)) * sin(bow)};
}

static bool create_teapot(alb_scene *scene, int frame, alb_error *error)
{
    const alb_surface surfaces[] = {surface_opaque("ground", 0.7, 0.7, 0.7), surface_opaque("china", 0.75, 0.72, 0.68)};
    const sun suns[] = {{{-0.9, 0.3, 0.7}, 38, {3.2, 0.5, 0.3}}, {{0.9, 0.2, 0.6}, 38, {0.3, 2.6, 0.5}}};
    const double even[3] = {0.15, 0.15, 0.18}, turn = 2 * M_PI * frame / FRAMES;
    const alb_camera camera =
        alb_camera_look_at((alb_vector){90, -400, 230}, (alb_vector){0, 0, 40}, (alb_vector){0, 0, 1}, 42, 640, 480);
    alb_light sky = {0};
    bool ok = paint_sky(&sky, suns, 2, even, error);
    sky.radius_mm = 800; // the table moves about in it: seen from the table the room moves
    sky.position_mm = (alb_vector){-200 * cos(turn), -120 * sin(turn), 60 * sin(2 * turn)};
    ok = begin(scene, surfaces, 2, ok ? &sky : NULL, camera, error) && ok && add_plane(scene, 220, error) &&
         add_loft(&scene->mesh, 84, 90, pot_ring, NULL, 1, error) &&
         add_loft(&scene->mesh, 34, 32, spout_ring, NULL, 1, error) &&
         add_loft(&scene->mesh, 44, 30, handle_ring, NULL, 1, error);
    for (size_t o = 0; ok && o < scene->object_count; o++)
        scene->objects[o].rigid = true;
    return finish(ok, scene);
}

const shadow_scene shadow_scenes[SHADOW_SCENES] = {
    {"dragon", "a creature that flaps over a plane, under the sky", 1100, 10000, 35.4, FRAMES, create_dragon},
    {"egg", "an egg that swells, under a red and a green leaf that fold", 500, 10000, 14.2, FRAMES, create_egg},
    {"sponge", "a sponge that bends and twists, under the sky", 8400, 10000, 13.4, FRAMES, create_sponge},
    {"teapot", "a teapot on a plane that moves about in an environment of finite size", 10000, 10000, 26.8, FRAMES,
     create_teapot},
};

// A room of 200 mm with a lamp (a point light) and, in most, a ball in it; then the damage.
#include "scenes/hostile.h"
#include "base/random.h"
#include "render/shape.h"
#include "scenes/parts.h"
#include "scenes/shapes.h"
#include <string.h>

enum { WALL, BODY, BLACK, WAX, SURFACES };
static const double room = 200;

static double uniform(alb_random *random, double low, double high)
{
    return low + (high - low) * alb_random_uniform(random);
}

static bool begin(alb_scene *scene, alb_error *error)
{
    const double total[3] = {0.6, 0.5, 0.4}, decay[3] = {0.15, 0.2, 0.3};
    const alb_surface surfaces[SURFACES] = {surface_opaque("wall", 0.7, 0.6, 0.5),
                                            surface_opaque("body", 0.5, 0.6, 0.7), surface_opaque("black", 0, 0, 0),
                                            surface_translucent("wax", total, decay)};
    const alb_light light = {.kind = ALB_LIGHT_POINT, .position_mm = {-31, 23, 57}, .flux = {1, 1, 1}};
    *scene = (alb_scene){0};
    if (!scene_furnish(scene, surfaces, SURFACES, &light, 1, error))
        return false;
    scene->rays_per_patch = 64;
    return true;
}

// Appends the shape with its damage done by the caller; empties it.
static bool put(alb_scene *scene, alb_mesh *shape, uint16_t group, alb_vector offset, alb_error *error)
{
    for (size_t f = 0; f < shape->face_count; f++)
        shape->groups[f] = group;
    const bool ok = alb_mesh_append(&scene->mesh, shape, 1, offset, error);
    alb_mesh_free(shape);
    return ok;
}

static bool add_room(alb_scene *scene, int cells, alb_error *error)
{
    return scene_add_box(scene, (alb_vector){0}, (alb_vector){room, room, room}, 0, room / cells, true, WALL, error);
}

static bool ball(alb_mesh *mesh, double radius, int subdivisions, alb_error *error)
{
    const alb_sphere sphere = {.radius_mm = radius, .subdivisions = subdivisions};
    return alb_shape_sphere(mesh, &sphere, error);
}

static bool add_ball(alb_scene *scene, alb_vector centre, double radius, uint16_t group, alb_error *error)
{
    alb_mesh mesh = {0};
    return ball(&mesh, radius, 2, error) && put(scene, &mesh, group, centre, error);
}

static bool add_triangle(alb_mesh *mesh, alb_vector a, alb_vector b, alb_vector c, uint16_t group, alb_error *error)
{
    const uint32_t first = (uint32_t)mesh->vertex_count;
    return alb_mesh_add_vertex(mesh, a, error) && alb_mesh_add_vertex(mesh, b, error) &&
           alb_mesh_add_vertex(mesh, c, error) && alb_mesh_add_face(mesh, first, first + 1, first + 2, group, error);
}

// A room whose floor is a fan of needles: strips 10^-variant of the room wide between strips of the rest.
static bool slivers(alb_scene *scene, int variant, alb_error *error)
{
    if (!begin(scene, error))
        return false;
    const double h = room / 2, width = room * pow(10, -variant);
    const alb_vector o = {-h, -h, -h}, x = {room, 0, 0}, y = {0, room, 0}, z = {0, 0, room};
    const alb_vector narrow = {0, width, 0}, rest = {0, room - width, 0};
    return shape_sheet(&scene->mesh, o, x, narrow, 1, 1, WALL, error) &&
           shape_sheet(&scene->mesh, alb_add(o, narrow), x, rest, 4, 4, WALL, error) &&
           shape_sheet(&scene->mesh, alb_add(o, z), y, x, 4, 4, WALL, error) &&
           shape_sheet(&scene->mesh, alb_add(o, y), x, z, 4, 4, WALL, error) &&
           shape_sheet(&scene->mesh, o, z, x, 4, 4, WALL, error) &&
           shape_sheet(&scene->mesh, o, y, z, 4, 4, WALL, error) &&
           shape_sheet(&scene->mesh, alb_add(o, x), z, y, 4, 4, WALL, error) &&
           add_ball(scene, (alb_vector){20, 0, -40}, 30, variant % 2 ? WAX : BODY, error);
}

// Faces without area: a corner twice, three corners in a line, and needles beside them.
static bool zero_area(alb_scene *scene, int variant, alb_error *error)
{
    alb_random random = alb_random_at(31, 0, (uint64_t)variant);
    if (!begin(scene, error) || !add_room(scene, 4, error))
        return false;
    const size_t n = scene->mesh.vertex_count;
    for (int k = 0; k < 20; k++) {
        const uint32_t a = (uint32_t)(uniform(&random, 0, 1) * (double)n),
                       b = (uint32_t)(uniform(&random, 0, 1) * (double)n);
        const alb_vector p = scene->mesh.vertices[a], q = scene->mesh.vertices[b];
        const alb_vector middle = alb_add(alb_times(0.3, p), alb_times(0.7, q));
        if (!alb_mesh_add_face(&scene->mesh, a, b, b, BODY, error) ||
            !add_triangle(&scene->mesh, p, middle, q, BODY, error))
            return false;
    }
    return add_ball(scene, (alb_vector){20, 0, -40}, 30, variant % 2 ? WAX : BODY, error);
}

// Every face of the room with corners of its own, moved by up to 1e-8 .. 1e-5 of the room.
static bool cracks(alb_scene *scene, int variant, alb_error *error)
{
    alb_random random = alb_random_at(32, 0, (uint64_t)variant);
    const double by = room * pow(10, -8 + variant % 4);
    alb_scene whole;
    if (!begin(scene, error) || !begin(&whole, error))
        return false;
    bool ok = add_room(&whole, 5, error);
    for (size_t f = 0; ok && f < whole.mesh.face_count; f++) {
        alb_vector t[3];
        for (int k = 0; k < 3; k++) {
            const alb_vector move = {uniform(&random, -by, by), uniform(&random, -by, by), uniform(&random, -by, by)};
            t[k] = alb_add(whole.mesh.vertices[whole.mesh.faces[f][k]], move);
        }
        ok = add_triangle(&scene->mesh, t[0], t[1], t[2], WALL, error);
    }
    alb_scene_free(&whole);
    return ok && add_ball(scene, (alb_vector){20, 0, -40}, 30, variant / 4 % 2 ? WAX : BODY, error);
}

// Walls of unlike lattices that meet: corners of one lie on edges of the other, off by rounding once the room is
// turned.
static bool t_vertices(alb_scene *scene, int variant, alb_error *error)
{
    const double h = room / 2;
    const alb_vector o = {-h, -h, -h}, x = {room, 0, 0}, y = {0, room, 0}, z = {0, 0, room};
    const int n = 3 + variant % 4, m = 2 * n + variant / 4 % 2; // 2:1, or no common corners
    if (!begin(scene, error) || !shape_sheet(&scene->mesh, o, x, y, n, n, WALL, error) ||
        !shape_sheet(&scene->mesh, alb_add(o, z), y, x, m, m, WALL, error) ||
        !shape_sheet(&scene->mesh, alb_add(o, y), x, z, m, n, WALL, error) ||
        !shape_sheet(&scene->mesh, o, z, x, n, m, WALL, error) ||
        !shape_sheet(&scene->mesh, o, y, z, m, m, WALL, error) ||
        !shape_sheet(&scene->mesh, alb_add(o, x), z, y, n, n, WALL, error))
        return false;
    const double turn = 0.1 + 0.37 * variant;
    for (size_t i = 0; i < scene->mesh.vertex_count; i++) {
        const alb_vector v = scene->mesh.vertices[i];
        const double a = cos(turn) * v.x - sin(turn) * v.y, b = sin(turn) * v.x + cos(turn) * v.y;
        scene->mesh.vertices[i] = (alb_vector){a, cos(turn) * b - sin(turn) * v.z, sin(turn) * b + cos(turn) * v.z};
    }
    scene->lights[0].position_mm = (alb_vector){0, 0, 0};
    return add_ball(scene, (alb_vector){20, 0, -40}, 30, variant % 2 ? WAX : BODY, error);
}

// A plate hangs in the room: twice the same way, twice back to back, or again with the other diagonals; beside it the
// ball twice.
static bool coincident(alb_scene *scene, int variant, alb_error *error)
{
    const alb_vector corner = {-60, -60, -20.3}, x = {80, 0, 0}, y = {0, 80, 7};
    const int n = 2 + variant / 6;
    if (!begin(scene, error) || !add_room(scene, 5, error) ||
        !shape_sheet(&scene->mesh, corner, x, y, n, n, BODY, error))
        return false;
    switch (variant % 6) {
    case 0: // twice the same
        return shape_sheet(&scene->mesh, corner, x, y, n, n, BODY, error);
    case 1: // back to back, other diagonals
        return shape_sheet(&scene->mesh, corner, y, x, n, n, BODY, error);
    case 2: // the same way, finer
        return shape_sheet(&scene->mesh, corner, x, y, 2 * n + 1, 2 * n + 1, BODY, error);
    case 3: // back to back, finer
        return shape_sheet(&scene->mesh, corner, y, x, 2 * n + 1, 2 * n + 1, BODY, error);
    case 4: // back to back, corner over corner
        for (size_t f = scene->mesh.face_count, first = f - 2 * (size_t)n * (size_t)n; first < f; first++) {
            const uint32_t *face = scene->mesh.faces[first], a = face[0], b = face[1], c = face[2];
            if (!alb_mesh_add_face(&scene->mesh, a, c, b, BODY, error))
                return false;
        }
        return true;
    default:
        return add_ball(scene, (alb_vector){30, 30, 30}, 25, BODY, error) &&
               add_ball(scene, (alb_vector){30, 30, 30}, 25, BODY, error);
    }
}

// Some faces of the ball turned inside out: a tenth, half, all but one, or all.
static bool turned(alb_scene *scene, int variant, alb_error *error)
{
    static const double shares[5] = {0.02, 0.1, 0.3, 0.9, 1};
    alb_random random = alb_random_at(33, 0, (uint64_t)variant);
    alb_mesh mesh = {0};
    if (!begin(scene, error) || !add_room(scene, 5, error) || !ball(&mesh, 40, 2, error))
        return false;
    for (size_t f = 0; f < mesh.face_count; f++)
        if (uniform(&random, 0, 1) < shares[variant % 5]) {
            const uint32_t swap = mesh.faces[f][1];
            mesh.faces[f][1] = mesh.faces[f][2];
            mesh.faces[f][2] = swap;
        }
    return put(scene, &mesh, variant / 5 % 2 ? WAX : BODY, (alb_vector){20, 0, -40}, error);
}

// The ball without some faces: one, a cap, half, most.
static bool holes(alb_scene *scene, int variant, alb_error *error)
{
    static const double cuts[5] = {0.97, 0.8, 0.3, 0, -0.8};
    alb_mesh mesh = {0};
    if (!begin(scene, error) || !add_room(scene, 5, error) || !ball(&mesh, 40, 2, error))
        return false;
    size_t kept = 0;
    for (size_t f = 0; f < mesh.face_count; f++) {
        const alb_vector corner = mesh.vertices[mesh.faces[f][0]];
        if ((variant % 2 ? corner.z : corner.x) > 40 * cuts[variant / 2 % 5])
            continue;
        memmove(mesh.faces[kept++], mesh.faces[f], sizeof *mesh.faces);
    }
    mesh.face_count = kept;
    return put(scene, &mesh, variant / 10 % 2 ? WAX : BODY, (alb_vector){20, 0, -40}, error);
}

// Plates as closed boxes, 10 .. 1e-6 mm thick.
static bool thin(alb_scene *scene, int variant, alb_error *error)
{
    const double thickness = pow(10, 1 - variant % 8);
    alb_mesh mesh = {0};
    const alb_box box = {.size_mm = {70, 90, thickness}, .cells = {5, 6, 1}, .grading = 1};
    return begin(scene, error) && add_room(scene, 5, error) && alb_shape_box(&mesh, &box, error) &&
           put(scene, &mesh, variant / 8 % 2 ? WAX : BODY, (alb_vector){10, 5, -22}, error);
}

// Balls that overlap, touch in a point, or lie one within the other.
static bool overlapping(alb_scene *scene, int variant, alb_error *error)
{
    static const double distances[6] = {1e-7, 10, 30, 59.9, 60, 60.1};
    const alb_vector at = {-20, 0, -40}, by = {distances[variant % 6], 0, 0};
    const uint16_t group = variant / 6 % 2 ? WAX : BODY;
    return begin(scene, error) && add_room(scene, 5, error) && add_ball(scene, at, 30, group, error) &&
           add_ball(scene, alb_add(at, by), 30, variant / 12 % 2 ? WAX : BODY, error);
}

// A block that stands above the floor, flush on it, through it, or in the corner through three walls.
static bool at_the_wall(alb_scene *scene, int variant, alb_error *error)
{
    static const double heights[6] = {1e-3, 1e-6, 0, -1e-6, -7, -59};
    const double low = -room / 2 + heights[variant % 6];
    const bool in_corner = variant / 12 % 2;
    const alb_vector centre = {in_corner ? low + 30 : 13, in_corner ? low + 30 : 7, low + 30};
    return begin(scene, error) && add_room(scene, 6, error) &&
           scene_add_box(scene, centre, (alb_vector){60, 60, 60}, in_corner ? 0 : 20, 15, false,
                         variant / 6 % 2 ? WAX : BODY, error);
}

// Nothing, one face, two faces, all black, all wax, in a room or in the open.
static bool few(alb_scene *scene, int variant, alb_error *error)
{
    const alb_vector a = {0, 0, 0}, b = {30, 0, 0}, c = {0, 40, 0}, d = {0, 0, 50};
    if (!begin(scene, error))
        return false;
    switch (variant) {
    case 0:
        return true;
    case 1:
        return add_triangle(&scene->mesh, a, b, c, BODY, error);
    case 2:
        return add_triangle(&scene->mesh, a, b, c, WAX, error);
    case 3:
        return add_triangle(&scene->mesh, a, b, c, BODY, error) && add_triangle(&scene->mesh, a, b, d, BODY, error);
    case 4:
        return add_triangle(&scene->mesh, a, b, a, BODY, error); // dropped: nothing is left
    case 5:
        return add_ball(scene, a, 30, BLACK, error);
    case 6:
        return add_ball(scene, a, 30, WAX, error);
    case 7:
        return add_ball(scene, (alb_vector){-31, 23, 57}, 30, WAX, error); // the light inside
    default:
        scene->light_count = 0;
        return add_ball(scene, a, 30, WAX, error);
    }
}

static bool all_one(alb_scene *scene, int variant, alb_error *error)
{
    static const uint16_t groups[3] = {BLACK, WAX, WALL};
    if (!begin(scene, error) || !add_room(scene, 3 + variant / 3, error) ||
        !add_ball(scene, (alb_vector){20, 0, -40}, 30, BODY, error))
        return false;
    for (size_t f = 0; f < scene->mesh.face_count; f++)
        scene->mesh.groups[f] = groups[variant % 3];
    return true;
}

static void move_all(alb_scene *scene, double scale, alb_vector by)
{
    for (size_t i = 0; i < scene->mesh.vertex_count; i++)
        scene->mesh.vertices[i] = alb_add(by, alb_times(scale, scene->mesh.vertices[i]));
    scene->lights[0].position_mm = alb_add(by, alb_times(scale, scene->lights[0].position_mm));
    for (int c = 0; c < 3; c++) {
        double *p = scene->surfaces[WAX].profiles[ALB_REFLECTION][c].parameters;
        p[0] /= scale * scale, p[1] /= scale, p[2] /= scale * scale, p[3] /= scale;
    }
}

// 1e-4 .. 1e4 of the size.
static bool scaled(alb_scene *scene, int variant, alb_error *error)
{
    if (!begin(scene, error) || !add_room(scene, 5, error) ||
        !add_ball(scene, (alb_vector){20, 0, -40}, 30, variant / 9 % 2 ? WAX : BODY, error))
        return false;
    move_all(scene, pow(10, variant % 9 - 4), (alb_vector){0});
    return true;
}

// The room 1e2 .. 1e7 mm from the origin: at 1e7 coordinates in single precision are 1 mm apart.
static bool far_away(alb_scene *scene, int variant, alb_error *error)
{
    const double far = pow(10, 2 + variant % 6);
    if (!begin(scene, error) || !add_room(scene, 5, error) ||
        !add_ball(scene, (alb_vector){20, 0, -40}, 30, variant / 6 % 2 ? WAX : BODY, error))
        return false;
    move_all(scene, 1, (alb_vector){far, -0.7 * far, 0.3 * far});
    return true;
}

// Triangles at random, of all sizes and orders.
static bool soup(alb_scene *scene, int variant, alb_error *error)
{
    alb_random random = alb_random_at(34, 0, (uint64_t)variant);
    if (!begin(scene, error) || (variant % 2 && !add_room(scene, 5, error)))
        return false;
    for (int k = 0; k < 20 * (variant + 1); k++) {
        alb_vector t[3];
        const double size = pow(10, uniform(&random, -4, 1.7));
        t[0] = (alb_vector){uniform(&random, -40, 40), uniform(&random, -40, 40), uniform(&random, -40, 40)};
        for (int c = 1; c < 3; c++)
            t[c] = alb_add(t[0], (alb_vector){uniform(&random, -size, size), uniform(&random, -size, size),
                                              uniform(&random, -size, size)});
        if (!add_triangle(&scene->mesh, t[0], t[1], t[2], (uint16_t)(k % 3 ? BODY : WAX), error))
            return false;
    }
    return true;
}

// Three or more faces on one edge: fins on a ball, plates that cross in an edge, balls that share a corner.
static bool not_manifold(alb_scene *scene, int variant, alb_error *error)
{
    alb_mesh mesh = {0};
    if (!begin(scene, error) || !add_room(scene, 5, error) || !ball(&mesh, 30, 2, error))
        return false;
    bool ok = true;
    const size_t faces = mesh.face_count;
    for (size_t f = 0; ok && f < faces; f += 7 + (size_t)variant) {
        const alb_vector tip = alb_times(1.4, mesh.vertices[mesh.faces[f][0]]);
        const uint32_t a = mesh.faces[f][0], b = mesh.faces[f][1], c = (uint32_t)mesh.vertex_count;
        ok = alb_mesh_add_vertex(&mesh, tip, error) && alb_mesh_add_face(&mesh, a, b, c, 0, error) &&
             (variant % 2 || alb_mesh_add_face(&mesh, b, a, c, 0, error));
    }
    return ok && put(scene, &mesh, variant / 2 % 2 ? WAX : BODY, (alb_vector){20, 0, -40}, error);
}

// The light on a face, on a corner, in the plane of a wall, inside a body, on top of a patch.
static bool light_on_surface(alb_scene *scene, int variant, alb_error *error)
{
    const double h = room / 2, gaps[4] = {0, 1e-9, 1e-5, 1e-2};
    const double gap = gaps[variant / 4 % 4];
    if (!begin(scene, error) || !add_room(scene, 5, error) ||
        !add_ball(scene, (alb_vector){20, 0, -40}, 30, variant / 16 % 2 ? WAX : BODY, error))
        return false;
    const size_t f = scene->mesh.face_count - 50;
    alb_vector middle = {0};
    for (int k = 0; k < 3; k++)
        middle = alb_add(middle, alb_times(1.0 / 3, scene->mesh.vertices[scene->mesh.faces[f][k]]));
    const alb_vector out = alb_unit(alb_sub(middle, (alb_vector){20, 0, -40}));
    const alb_vector places[4] = {{h - gap, 3.1, 2.2},
                                  {h - gap, h - gap, h - gap},
                                  alb_add(middle, alb_times(gap, out)),
                                  alb_add(scene->mesh.vertices[scene->mesh.faces[f][0]], alb_times(gap, out))};
    scene->lights[0].position_mm = places[variant % 4];
    return true;
}

const hostile_kind hostile_kinds[] = {
    {"slivers", 9, true, slivers},
    {"zero_area", 6, true, zero_area},
    {"cracks", 8, true, cracks},
    {"t_vertices", 16, true, t_vertices},
    {"coincident", 18, true, coincident},
    {"turned", 10, true, turned},
    {"holes", 20, true, holes},
    {"thin", 16, true, thin},
    {"overlapping", 24, true, overlapping},
    {"at_the_wall", 24, true, at_the_wall},
    {"few", 9, false, few},
    {"all_one", 9, true, all_one},
    {"scaled", 18, true, scaled},
    {"far_away", 12, true, far_away},
    {"soup", 12, false, soup},
    {"not_manifold", 8, true, not_manifold},
    {"light_on_surface", 32, true, light_on_surface},
};
const int hostile_kind_count = sizeof hostile_kinds / sizeof *hostile_kinds;

const hostile_kind *hostile_find(const char *name)
{
    for (int i = 0; i < hostile_kind_count; i++)
        if (!strcmp(hostile_kinds[i].name, name))
            return &hostile_kinds[i];
    return NULL;
}

// A closed room of 900 x 900 x 700 mm; a board on its floor, ten pieces of jade and ivory on the board, above it a
// hanging shade of alabaster with a light inside. Pieces stand 0.5 mm above the board and the board 1 mm above the
// floor.
#include "scenes/parts.h"
#include "scenes/scenes.h"
#include "scenes/shapes.h"
#include <math.h>

enum { WALL, FRAME, DARK, LIGHT, JADE, IVORY, SHADE, SURFACES };
static const double board = 405, board_top = 21, square = 45; // a frame of half a square around 8 x 8

#define OUTLINE(name, ...) static const double name[][2] = {__VA_ARGS__}
#define FOOT                                                                                                           \
    {0, 0}, {16, 0}, {17, 1.5}, {17, 4}, {15, 6}, {13.5, 8}, {13.5, 9.5}, { 11, 12 }
OUTLINE(pawn, FOOT, {7.5, 18}, {6, 26}, {6, 29}, {9.5, 30.5}, {9.5, 32}, {6.5, 33.5}, {8.6, 36}, {9.6, 40}, {8.6, 44},
        {6, 47}, {3, 48.4}, {0, 48.8});
OUTLINE(rook, FOOT, {9, 18}, {8, 28}, {8, 36}, {12, 39}, {12.5, 41}, {12.5, 52}, {11.5, 53}, {9, 53}, {8.5, 52},
        {8.5, 47}, {7.5, 46}, {0, 46});
OUTLINE(bishop, FOOT, {8, 19}, {6, 34}, {5.5, 42}, {9.5, 44}, {9.5, 46}, {6, 48}, {8.5, 53}, {9, 57}, {7.5, 63},
        {4.5, 68}, {2.5, 70}, {3.6, 72}, {3.6, 74}, {2, 76}, {0, 76.5});
OUTLINE(queen, FOOT, {8.5, 20}, {6.5, 40}, {6, 52}, {11, 54}, {11, 56}, {7, 58}, {7, 61}, {11.5, 74}, {12, 76},
        {10.5, 77.5}, {8.5, 76}, {4.5, 79}, {4.5, 81.5}, {3.5, 83.5}, {0, 84.5});
OUTLINE(king, FOOT, {9, 20}, {7, 42}, {6.5, 58}, {11.5, 60}, {11.5, 62}, {7.5, 64}, {7.5, 67}, {11.5, 82}, {10.5, 84.5},
        {5, 86}, {3.5, 88}, {5, 91}, {5, 95}, {3.5, 97.5}, {0, 98});
#define COUNT(outline) ((int)(sizeof(outline) / sizeof(outline)[0]))

// Blended balls and capsules over a round foot.
static double knight(const void *context, alb_vector p)
{
    static const double parts[][8] = {{0, 0, 15, 5, 0, 28, 11, 10},
                                      {5, 0, 28, -1, 0, 50, 10, 8.5},
                                      {-1, 0, 50, -14, 0, 43, 8, 5.5},
                                      {2, 3.5, 55, 4, 4.5, 62, 3.5, 2.5},
                                      {2, -3.5, 55, 4, -4.5, 62, 3.5, 2.5}};
    (void)context;
    const double r = hypot(p.x, p.y), past = fmax(r - 15, 0), above = fmax(fabs(p.z - 5) - 3, 0);
    double sum = exp(-(hypot(past, above) - 2) / 1.5);
    for (int i = 0; i < 5; i++) {
        const double *q = parts[i];
        const alb_vector from = {q[0], q[1], q[2]}, along = alb_sub((alb_vector){q[3], q[4], q[5]}, from);
        const alb_vector off = alb_sub(p, from);
        const double t = fmin(fmax(alb_dot(off, along) / alb_dot(along, along), 0), 1);
        sum += exp(-(alb_length(alb_sub(off, alb_times(t, along))) - (q[6] + t * (q[7] - q[6]))) / 1.5);
    }
    return -1.5 * log(sum);
}

// From the top of the inside down to the rim and up the outside: open below.
static bool add_shade(alb_mesh *mesh, alb_vector middle, double edge_mm, alb_error *error)
{
    enum { ARC = 30 };
    double outline[2 * ARC + 2][2];
    const double inner = 66, outer = 71, rim = 125 * M_PI / 180; // from straight up
    for (int k = 0; k <= ARC; k++) {
        const double angle = rim * k / ARC;
        outline[k][0] = inner * sin(angle), outline[k][1] = inner * cos(angle);
        outline[2 * ARC + 1 - k][0] = outer * sin(angle), outline[2 * ARC + 1 - k][1] = outer * cos(angle);
    }
    return shape_lathe(mesh, (const double(*)[2])outline, 2 * ARC + 2, middle, edge_mm, SHADE, error);
}

static bool add_board(alb_scene *scene, double edge_mm, alb_error *error)
{
    const double cells = 18 * fmax(1, round(board / 18 / edge_mm));
    const size_t first = scene->mesh.face_count;
    if (!scene_add_box(scene, (alb_vector){0, 0, 1 + 10}, (alb_vector){board, board, 20}, 0, board / cells, false,
                       FRAME, error))
        return false;
    for (size_t f = first; f < scene->mesh.face_count; f++) {
        alb_vector middle = {0};
        for (int k = 0; k < 3; k++)
            middle = alb_add(middle, alb_times(1.0 / 3, scene->mesh.vertices[scene->mesh.faces[f][k]]));
        const int i = (int)floor(middle.x / square + 4), j = (int)floor(middle.y / square + 4);
        if (middle.z > board_top - 0.1 && i >= 0 && i < 8 && j >= 0 && j < 8)
            scene->mesh.groups[f] = (i + j) % 2 ? LIGHT : DARK;
    }
    return true;
}

static bool add_pieces(alb_mesh *mesh, double edge_mm, alb_error *error)
{
    static const struct {
        const double (*outline)[2];
        int count, column, row;
        uint16_t material;
    } pieces[8] = {
        {king, COUNT(king), 4, 1, IVORY}, {queen, COUNT(queen), 2, 3, IVORY},   {rook, COUNT(rook), 6, 2, IVORY},
        {pawn, COUNT(pawn), 3, 1, IVORY}, {bishop, COUNT(bishop), 1, 2, IVORY}, {king, COUNT(king), 3, 6, JADE},
        {pawn, COUNT(pawn), 5, 4, JADE},  {bishop, COUNT(bishop), 6, 5, JADE},
    };
    static const int knights[2][3] = {{5, 0, IVORY}, {1, 5, JADE}};
    for (int k = 0; k < 8; k++) {
        const alb_vector at = {square * (pieces[k].column - 3.5), square * (pieces[k].row - 3.5), board_top + 0.5};
        if (!shape_lathe(mesh, pieces[k].outline, pieces[k].count, at, edge_mm, pieces[k].material, error))
            return false;
    }
    for (int k = 0; k < 2; k++) {
        const alb_vector at = {square * (knights[k][0] - 3.5), square * (knights[k][1] - 3.5), board_top + 0.5};
        const size_t first = mesh->vertex_count;
        if (!shape_implicit(mesh, knight, NULL, (alb_vector){-22, -20, -2}, (alb_vector){22, 20, 70}, 1.2 * edge_mm,
                            (uint16_t)knights[k][2], error))
            return false;
        for (size_t i = first; i < mesh->vertex_count; i++)
            mesh->vertices[i] = alb_add(at, mesh->vertices[i]);
    }
    return true;
}

bool scene_chess(alb_scene *scene, double detail, int frame, alb_error *error)
{
    (void)frame;
    const double totals[3][3] = {{0.28, 0.55, 0.38}, {0.6, 0.55, 0.46}, {0.47, 0.45, 0.4}};
    const double decays[3][3] = {{0.6, 0.4, 0.5}, {0.4, 0.45, 0.6}, {0.14, 0.16, 0.2}};
    const alb_surface surfaces[SURFACES] = {
        surface_opaque("wall", 0.62, 0.6, 0.56),           surface_opaque("frame", 0.25, 0.13, 0.07),
        surface_opaque("dark", 0.12, 0.09, 0.08),          surface_opaque("light", 0.7, 0.64, 0.5),
        surface_translucent("jade", totals[0], decays[0]), surface_translucent("ivory", totals[1], decays[1]),
        surface_translucent("shade", totals[2], decays[2])};
    const alb_vector lamp = {-40, 60, 290};
    const alb_light lights[2] = {{.kind = ALB_LIGHT_POINT, .position_mm = lamp, .flux = {5e6, 4.6e6, 4e6}},
                                 {.kind = ALB_LIGHT_SPOT,
                                  .position_mm = {400, 380, 600},
                                  .direction = alb_unit((alb_vector){-400, -380, -560}),
                                  .half_angle_deg = 20,
                                  .flux = {2e6, 2.1e6, 2.3e6}}};
    *scene = (alb_scene){.camera = alb_camera_look_at((alb_vector){120, -430, 300}, (alb_vector){0, -5, 95},
                                                      (alb_vector){0, 0, 1}, 50, 640, 480)};
    if (scene_furnish(scene, surfaces, SURFACES, lights, 2, error) &&
        scene_add_box(scene, (alb_vector){0, 0, 350}, (alb_vector){900, 900, 700}, 0, 12.5 / detail, true, WALL,
                      error) &&
        add_board(scene, 5 / detail, error) && add_pieces(&scene->mesh, 0.955 / detail, error) &&
        add_shade(&scene->mesh, lamp, 2 / detail, error))
        return true;
    alb_scene_free(scene);
    return false;
}

// Skin: f(x) = -k ln sum exp(-d_i(x) / k) = 0, d_i the distance to capsule i, k the blend. The gallop turns each bone
// about its joint, joints following their parents, and moves each corner of the standing skin with the bones near it,
// weighted by exp(-d_i / 4 mm): faces and their count stay, which is what an animation needs.
#include "scenes/animal.h"
#include "scenes/shapes.h"

typedef struct bone {
    int parent; // -1: the root
    alb_vector from, to;
    double radius_from, radius_to;
    double swing_deg, lag, rest_deg; // turns by rest + swing sin(2 pi (phase - lag)) about y, where it starts
} bone;

enum { BONES = 19 };
static const bone bones[BONES] = {
    {-1, {0, 0, 64}, {-34, 0, 64}, 19, 18, 7, 0, 0},           // back
    {0, {0, 0, 64}, {34, 0, 66}, 19, 18, -10, 0, 0},           // chest
    {1, {38, 0, 72}, {60, 0, 98}, 13, 9, 9, 0.3, 0},           // neck
    {2, {58, 0, 99}, {80, 0, 88}, 9, 6, -6, 0.3, 0},           // head
    {3, {59, 5, 104}, {56, 7, 115}, 4, 3, 0, 0, 0},            // ears
    {3, {59, -5, 104}, {56, -7, 115}, 4, 3, 0, 0, 0},          //
    {0, {-50, 0, 70}, {-72, 0, 52}, 5, 4, 14, 0.1, -12},       // tail
    {1, {32, 12, 58}, {33, 12, 33}, 10, 6, 26, 0.00, 0},       // left fore leg: upper, lower, hoof
    {7, {33, 12, 33}, {32, 12, 12}, 6, 4.5, 24, 0.27, 16},     //
    {8, {32, 12, 12}, {35, 12, 5}, 4.5, 5, 20, 0.35, 10},      //
    {1, {32, -12, 58}, {33, -12, 33}, 10, 6, 26, 0.12, 0},     // right fore leg
    {10, {33, -12, 33}, {32, -12, 12}, 6, 4.5, 24, 0.39, 16},  //
    {11, {32, -12, 12}, {35, -12, 5}, 4.5, 5, 20, 0.47, 10},   //
    {0, {-36, 12, 60}, {-30, 12, 34}, 13, 7, 23, 0.55, 0},     // left hind leg
    {13, {-30, 12, 34}, {-39, 12, 14}, 7, 4.5, 22, 0.85, -18}, //
    {14, {-39, 12, 14}, {-35, 12, 5}, 4.5, 5, 20, 0.9, 8},     //
    {0, {-36, -12, 60}, {-30, -12, 34}, 13, 7, 23, 0.65, 0},   // right hind leg
    {16, {-30, -12, 34}, {-39, -12, 14}, 7, 4.5, 22, 0.95, -12},
    {17, {-39, -12, 14}, {-35, -12, 5}, 4.5, 5, 20, 0, 8},
};
static const double blend_mm = 2.5, skin_mm = 4;

static double distance_to(const bone *b, alb_vector at)
{
    const alb_vector along = alb_sub(b->to, b->from), off = alb_sub(at, b->from);
    const double t = fmin(fmax(alb_dot(off, along) / alb_dot(along, along), 0), 1);
    return alb_length(alb_sub(off, alb_times(t, along))) - (b->radius_from + t * (b->radius_to - b->radius_from));
}

static double skin(const void *context, alb_vector at)
{
    const double bumps_mm = *(const double *)context, wave = 2 * M_PI / 12;
    double distance[BONES], least = INFINITY, sum = 0;
    for (int i = 0; i < BONES; i++) {
        distance[i] = distance_to(&bones[i], at);
        least = fmin(least, distance[i]);
    }
    for (int i = 0; i < BONES; i++)
        sum += exp((least - distance[i]) / blend_mm);
    return least - blend_mm * log(sum) + bumps_mm * sin(wave * at.x) * sin(wave * at.y) * sin(wave * at.z);
}

// Where each bone carries its joint and how far it is turned, summed along its parents.
typedef struct pose {
    alb_vector joint[BONES];
    double turn[BONES];
} pose;

static alb_vector turned(alb_vector v, double angle) // about y, nose down for positive angles
{
    return (alb_vector){cos(angle) * v.x + sin(angle) * v.z, v.y, cos(angle) * v.z - sin(angle) * v.x};
}

static pose pose_at(double phase)
{
    pose p;
    for (int i = 0; i < BONES; i++) {
        const bone *b = &bones[i];
        const double own = M_PI / 180 * (b->rest_deg + b->swing_deg * sin(2 * M_PI * (phase - b->lag)));
        const alb_vector bounce = {0, 0, 7 + 5 * sin(2 * M_PI * (phase + 0.2))};
        p.turn[i] = own + (b->parent >= 0 ? p.turn[b->parent] : 0);
        p.joint[i] = b->parent < 0 ? alb_add(b->from, bounce)
                                   : alb_add(p.joint[b->parent],
                                             turned(alb_sub(b->from, bones[b->parent].from), p.turn[b->parent]));
    }
    return p;
}

static alb_vector posed(const pose *p, alb_vector at)
{
    alb_vector sum = {0};
    double weights = 0;
    for (int i = 0; i < BONES; i++) {
        const double weight = exp(-fmax(distance_to(&bones[i], at), -skin_mm) / skin_mm);
        sum = alb_add(sum, alb_times(weight, alb_add(p->joint[i], turned(alb_sub(at, bones[i].from), p->turn[i]))));
        weights += weight;
    }
    return alb_times(1 / weights, sum);
}

static bool add(alb_mesh *mesh, alb_vector feet, double cell_mm, double bumps_mm, const pose *p, uint16_t group,
                alb_error *error)
{
    const size_t first = mesh->vertex_count;
    const alb_vector low = {-90, -36, -6}, high = {98, 36, 128};
    if (!shape_implicit(mesh, skin, &bumps_mm, low, high, cell_mm, group, error))
        return false;
#pragma omp parallel for schedule(static)
    for (size_t i = first; i < mesh->vertex_count; i++)
        mesh->vertices[i] = alb_add(feet, p ? posed(p, mesh->vertices[i]) : mesh->vertices[i]);
    return true;
}

bool animal_add(alb_mesh *mesh, alb_vector feet, double cell_mm, double bumps_mm, uint16_t group, alb_error *error)
{
    return add(mesh, feet, cell_mm, bumps_mm, NULL, group, error);
}

bool animal_gallop_add(alb_mesh *mesh, alb_vector feet, double cell_mm, double phase, uint16_t group, alb_error *error)
{
    const pose p = pose_at(phase);
    return add(mesh, feet, cell_mm, 0, &p, group, error);
}

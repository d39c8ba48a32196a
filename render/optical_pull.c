// Pulling a path tight.
//
// Corners are left out where their neighbours see each other, and stretches of the path are replaced by plane sections
// through their ends (optical_slice.c): first the whole, then halves and so on to single corners.
#include "render/optical_solid.h"
#include <string.h>

enum { ROUNDS = 3 };
static const double worth_another_round = 3e-4; // relative gain of the last

// Leaves out corners whose neighbours see each other.
static bool shorten(alb_bends *path, const alb_optical_solid *solid)
{
    int kept = 1;
    for (int i = 1; i + 1 < path->count; i++)
        if (!alb_voxels_inside(&solid->voxels, path->at[kept - 1], path->at[i + 1]))
            path->at[kept++] = path->at[i];
    path->at[kept++] = path->at[path->count - 1];
    const bool fewer = kept < path->count;
    path->count = kept;
    return fewer;
}

static double between(const alb_bends *path, int first, int last)
{
    double length = 0;
    for (int i = first; i < last; i++)
        length += alb_length(alb_sub(path->at[i + 1], path->at[i]));
    return length;
}

// Replaces what lies between two corners by the section through them and the mean of the corners, or the best one
// turned from it, where that is shorter.
static bool pull(alb_bends *path, const alb_optical_solid *solid, int first, int last, bool turn)
{
    alb_bends section;
    const alb_chord chord = alb_chord_between(solid, path->at[first], path->at[last]);
    const double so_far = between(path, first, last);
    alb_vector towards = {0};
    for (int i = first + 1; i < last; i++) {
        const alb_vector at = alb_sub(path->at[i], chord.from);
        towards = alb_add(towards, alb_sub(at, alb_times(alb_dot(at, chord.along), chord.along)));
    }
    if (!(turn ? alb_slice_best(&section, solid, &chord, towards, true)
               : alb_slice(&section, solid, &chord, towards, so_far)) ||
        !(section.length_mm < so_far))
        return false;
    const int more = section.count - (last - first + 1); // corners
    if (path->count + more > ALB_BENDS_MAX)
        return false;
    memmove(&path->at[last + more], &path->at[last], (size_t)(path->count - last) * sizeof *path->at);
    memcpy(&path->at[first + 1], &section.at[1], (size_t)(section.count - 2) * sizeof *path->at);
    path->count += more;
    return true;
}

// All of it, then halves that overlap, then quarters, until corner by corner; less where the whole could be replaced
// and parts gain nothing.
static void tighten(alb_bends *path, const alb_optical_solid *solid)
{
    const bool whole = pull(path, solid, 0, path->count - 1, true);
    for (int span = path->count / 2; span > 1; span = span > 3 ? span / 2 : span - 1) {
        const double before = between(path, 0, path->count - 1);
        for (int first = 0; first + 2 < path->count; first += (span + 1) / 2)
            pull(path, solid, first, first + span < path->count - 1 ? first + span : path->count - 1, false);
        if (whole && between(path, 0, path->count - 1) > (1 - 3e-4) * before)
            break;
    }
}

// Length; a leg that is blocked (within a piece of surface, or between joined ones) is measured along its section.
static double length_of(const alb_bends *path, const alb_optical_solid *solid)
{
    double length = 0;
    for (int i = 1; i < path->count; i++) {
        const alb_vector a = path->at[i - 1], b = path->at[i];
        double leg = alb_length(alb_sub(b, a));
        if (!alb_voxels_inside(&solid->voxels, a, b)) {
            const alb_chord chord = alb_chord_between(solid, a, b);
            alb_bends section;
            alb_vector towards;
            if (alb_slice_direction(&towards, solid, &chord) &&
                alb_slice(&section, solid, &chord, towards, (double)INFINITY))
                leg = section.length_mm;
        }
        length += leg;
    }
    return length;
}

// Pulls the path tight and measures it.
void alb_bends_pull(alb_bends *path, const alb_optical_solid *solid)
{
    shorten(path, solid);
    path->length_mm = length_of(path, solid);
    for (int round = 0; round < ROUNDS; round++) {
        const double before = path->length_mm;
        tighten(path, solid);
        shorten(path, solid);
        path->length_mm = fmin(before, length_of(path, solid));
        if (path->length_mm > (1 - worth_another_round) * before)
            break;
    }
}

// A body in voxels: which are inside, which hold the surface, and whether a segment stays inside.
#pragma once
#include "base/error.h"
#include "base/vector.h"
#include <stddef.h>
#include <stdint.h>

enum { ALB_VOXEL_OUTSIDE, ALB_VOXEL_INSIDE, ALB_VOXEL_SURFACE };

typedef struct alb_voxels {
    const alb_vector (*triangles)[3]; // borrowed; counter-clockwise seen from outside
    size_t triangle_count;
    alb_vector low; // corner of voxel (0, 0, 0)
    double size_mm;
    int n[3];                 // the outermost voxels are outside
    unsigned char *state;     // [(k n[1] + j) n[0] + i]
    unsigned char *clear;     // within so many voxels in every direction all have the same state; of surface voxels 0
    uint32_t *starts, *lists; // triangles that touch a surface voxel; starts has one entry more than there are voxels
    float (*planes)[4];       // of each entry of the lists, in voxels from low: unit normal, its product with a corner
    float margin;             // what those may be wrong by
    size_t unsure;            // voxels whose winding number is more than 0.1 away from a whole number
} alb_voxels;

// Where a segment meets the surface.
typedef struct alb_crossing {
    double at; // 0 start, 1 end
    uint32_t triangle;
    bool leaves;
} alb_crossing;

// Voxels of size_mm, or larger so that at most `most` are needed. Regions free of surface are told apart by the winding
// number: one evaluation a region where `closed`, one a voxel where not. Fails for want of memory alone.
bool alb_voxels_create(alb_voxels *voxels, const alb_vector (*triangles)[3], size_t count, double size_mm, size_t most,
                       bool closed, alb_error *error);
void alb_voxels_free(alb_voxels *voxels);
size_t alb_voxels_bytes(const alb_voxels *voxels);
int alb_voxels_state(const alb_voxels *voxels, alb_vector point);
// Whether the segment meets no surface and no voxel outside. The ends must not lie on the surface.
bool alb_voxels_inside(const alb_voxels *voxels, alb_vector from, alb_vector to);
// All crossings of the segment in ascending order, each triangle once; at most `most`, and `most + 1` says there are
// more.
size_t alb_voxels_crossings(alb_crossing *crossings, size_t most, const alb_voxels *voxels, alb_vector from,
                            alb_vector to);

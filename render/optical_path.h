// Optical paths: how far light has to go inside one body from a patch to other patches of it.
//
// Where the straight segment stays inside the body its length is the answer, exactly. Elsewhere it is the length of the
// shortest path inside: any-angle over a voxel graph for solids, along the faces for thin sheets. Lengths in mm.
#pragma once
#include "render/patch.h"

typedef enum alb_optical_kind {
    ALB_OPTICAL_CONVEX, // every segment stays inside
    ALB_OPTICAL_SOLID,  // paths through the volume
    ALB_OPTICAL_SHEET,  // two faces closer than light can tell: geodesics along them
    ALB_OPTICAL_KINDS
} alb_optical_kind;
extern const char *const alb_optical_kind_names[ALB_OPTICAL_KINDS]; // "convex", "solid", "sheet"

typedef struct alb_optical_options {
    double reach_mm;          // longer paths are not looked for; 0: no limit
    double mean_free_path_mm; // transport mean free path; a wall thinner than this may be a sheet; 0: never
    double voxel_mm;          // of the path graph; 0: chosen from the patches
} alb_optical_options;

typedef struct alb_optical_paths {
    alb_optical_kind kind;
    double reach_mm;       // INFINITY: no limit
    double voxel_mm;       // of the path graph; 0 where there is none
    double thickness_mm;   // median distance to the opposing face, along the normal inwards; 0 if not measured
    size_t bytes;          // all that is kept
    size_t unsure_voxels;  // whose winding number is far from a whole number: the surface has holes there
    char description[256]; // one sentence: which kind, why, how fine; for the log
    const alb_patches *patches;
    struct alb_optical_solid *solid;
    struct alb_optical_sheet *sheet;
} alb_optical_paths;

// A place to go to: a patch of the body and a point on it or near it (its centroid, a part's centroid, the mean of a
// cluster that the patch stands for). The path is that of the patch, swung about its last corner to end at the point.
typedef struct alb_optical_target {
    uint32_t patch;
    float x_mm, y_mm, z_mm;
} alb_optical_target;

// Which face of a sheet the patch belongs to; light crosses between the two. ALB_RIM of what is no sheet.
typedef enum alb_sheet_face { ALB_RIM, ALB_FRONT, ALB_BACK } alb_sheet_face;
alb_sheet_face alb_optical_paths_face(const alb_optical_paths *paths, uint32_t patch);

// Workspace of one thread. It keeps the last search: ask for exit patches in spatial order.
typedef struct alb_optical_workspace {
    struct alb_optical_memory *memory;
} alb_optical_workspace;

// Prepares the body. patches (and its mesh) is borrowed for the life of the paths; body is only read here. The body
// should be closed; where it is not, the inside is where the winding number is at least a half.
bool alb_optical_paths_create(alb_optical_paths *paths, const alb_body *body, const alb_patches *patches,
                              const alb_optical_options *options, alb_error *error);
void alb_optical_paths_free(alb_optical_paths *paths);

bool alb_optical_workspace_create(alb_optical_workspace *work, const alb_optical_paths *paths, alb_error *error);
void alb_optical_workspace_free(alb_optical_workspace *work);

// distances_mm[k]: from the centroid of patch `from` to targets[k], INFINITY beyond the reach or where no path was
// found; both patches belong to the body. opposite (may be NULL): 1 where the target lies on the other face of a sheet,
// and its distance is measured along the faces, thickness left out; else 0. Cannot fail; safe from many threads, each
// with its workspace; the answer depends on neither the order of the calls nor the number of threads.
void alb_optical_paths_measure(float *distances_mm, unsigned char *opposite, alb_optical_workspace *work,
                               const alb_optical_paths *paths, uint32_t from, const alb_optical_target *targets,
                               size_t count);

// Paths inside one body: what the parts that find them share. Points are relative to the body's middle.
#pragma once
#include "base/heap.h"
#include "render/geodesic.h"
#include "render/optical_path.h"
#include "render/voxels.h"

enum { ALB_BENDS_MAX = 128, ALB_CROSSINGS_MAX = 48 };

// A triangle entered across one of its edges: the corner that is not on it, and what lies across the edges before and
// after.
typedef struct alb_door {
    alb_vector third;
    uint32_t across[2]; // 3 * triangle + edge there; UINT32_MAX: none
} alb_door;

// The triangles of a body and how they join.
typedef struct alb_surface_net {
    size_t count;
    alb_vector (*triangles)[3], *normals, *middles; // relative to `origin`
    // Across edge k -> k + 1: 3 * triangle + edge there, which runs the other way; UINT32_MAX: none, or more than one.
    uint32_t (*neighbours)[3];
    alb_door *doors;              // [3 * triangle + edge]
    uint32_t *local, first, last; // local[patch - first]: triangle
    alb_vector origin;
    double edge_mm; // median of the longest edges
} alb_surface_net;

bool alb_surface_net_create(alb_surface_net *net, const alb_body *body, const alb_patches *patches, alb_error *error);
void alb_surface_net_free(alb_surface_net *net);

// Corners of a path, ends included, and its length.
typedef struct alb_bends {
    int count;
    alb_vector at[ALB_BENDS_MAX];
    double length_mm;
} alb_bends;

// A place where paths may turn: a piece of surface in one voxel that faces one way, or the middle of a voxel inside.
typedef struct alb_turns {
    double size_mm;
    int n[3];
    alb_vector low;
    size_t count, surface_count; // the pieces of surface come first
    float (*at)[3];
    uint32_t *voxel_starts, *voxel_nodes; // nodes of each voxel
    uint32_t *adjacent_starts, *adjacent; // of surface pieces: those joined to it along edges
    uint32_t *of_triangle;
} alb_turns;

typedef struct alb_optical_solid {
    alb_surface_net net;
    alb_voxels voxels;
    alb_vector *starts; // of each triangle: its middle, a little way in
    double lift_mm;     // by how much corners of paths are kept off the surface
    alb_turns turns;
    double reach_mm;
} alb_optical_solid;

bool alb_turns_create(alb_turns *turns, const alb_optical_solid *solid, double size_mm, alb_error *error);
void alb_turns_free(alb_turns *turns);

// The search from one node: length and parent of every node within reach.
typedef struct alb_search {
    uint32_t source, *parents, *stamps, stamp;
    float *lengths;
    unsigned char *states;
    alb_heap heap; // of nodes; one that is full drops an entry, and the node stays as far as it was
} alb_search;
bool alb_search_create(alb_search *search, size_t nodes, alb_error *error);
void alb_search_free(alb_search *search);
// Whether the last search got there.
bool alb_search_found(const alb_search *search, uint32_t node);
void alb_search_run(alb_search *search, const alb_optical_solid *solid, uint32_t source);

// From the middle of one triangle to that of another along the curve in the plane through both that holds the sum of
// their normals: how long a string is, drawn tight about it. False where the curve does not lead there or is longer
// than most_mm.
bool alb_slice_along(double *length_mm, const alb_surface_net *net, uint32_t from, uint32_t to, double most_mm);
// A segment between two points of the body, and where it meets the surface.
typedef struct alb_chord {
    alb_vector from, to, along; // along: unit
    double length_mm;
    size_t count; // more than ALB_CROSSINGS_MAX: too many to be kept
    alb_crossing crossings[ALB_CROSSINGS_MAX];
} alb_chord;
alb_chord alb_chord_between(const alb_optical_solid *solid, alb_vector from, alb_vector to);
// The shortest path from end to end of the chord in the half plane through it that `towards` points into, along the
// surface where the chord leaves the body. False where the surface does not lead back to the chord, or leads through
// another part of the outside; the latter is looked for only where the path is shorter than most_mm. False, too, where
// it is longer than twice that, or than the reach by a fifth.
bool alb_slice(alb_bends *bends, const alb_optical_solid *solid, const alb_chord *chord, alb_vector towards,
               double most_mm);
// The same in the best of the half planes turned from that one by up to about half a radian; beside: also where that
// one leads nowhere.
bool alb_slice_best(alb_bends *bends, const alb_optical_solid *solid, const alb_chord *chord, alb_vector towards,
                    bool beside);
// The best of half planes all around the chord.
bool alb_slice_any(alb_bends *bends, const alb_optical_solid *solid, const alb_chord *chord);
// Which half plane the surface where the chord leaves and returns speaks for; false where it does not.
bool alb_slice_direction(alb_vector *towards, const alb_optical_solid *solid, const alb_chord *chord);

// Pulls a path tight and measures it.
void alb_bends_pull(alb_bends *path, const alb_optical_solid *solid);

// The net, the voxels and the starts.
bool alb_optical_solid_create(alb_optical_solid *solid, const alb_body *body, const alb_patches *patches,
                              alb_error *error);
// The graph, from voxels of voxel_mm; what alb_optical_solid_measure needs besides.
bool alb_optical_solid_prepare(alb_optical_solid *solid, double voxel_mm, double reach_mm, alb_error *error);
void alb_optical_solid_free(alb_optical_solid *solid);
// From triangle to triangle; the last leg ends at `point`.
double alb_optical_solid_measure(alb_search *search, const alb_optical_solid *solid, uint32_t from, uint32_t to,
                                 alb_vector point);

// A sheet: the faces of a body and what lies opposite.
typedef struct alb_optical_sheet {
    uint32_t *facing;  // of each triangle: that which faces it across the sheet; UINT32_MAX: none
    uint32_t *face;    // of each triangle: which face it belongs to, 1 and up; 0: the rim
    uint8_t *sides;    // of each triangle: alb_sheet_face
    alb_vector *feet;  // where the normal inwards meets that
    double *thickness; // how far off; INFINITY: none
    double median_mm;  // by area
    alb_geodesic_surface surface;
} alb_optical_sheet;

// Measures the thickness: facing, feet and thickness, up to longest_mm.
bool alb_optical_sheet_create(alb_optical_sheet *sheet, const alb_optical_solid *solid, double longest_mm,
                              alb_error *error);
void alb_optical_sheet_free(alb_optical_sheet *sheet);
// Share of the area whose opposing face is nearer than limit_mm.
double alb_optical_sheet_share(const alb_optical_sheet *sheet, const alb_surface_net *net, double limit_mm);
// What alb_optical_sheet_measure needs besides. What faces nothing within limit_mm is rim.
bool alb_optical_sheet_prepare(alb_optical_sheet *sheet, const alb_surface_net *net, double limit_mm, alb_error *error);

enum { ALB_SHEET_TARGETS = 1024 };
typedef struct alb_sheet_memory {
    alb_geodesic_memory geodesic;
    alb_geodesic_target targets[2 * ALB_SHEET_TARGETS];
} alb_sheet_memory;
// From a triangle to at most ALB_SHEET_TARGETS others; points[k] is the end of path k, relative to the net's origin.
void alb_optical_sheet_measure(float *distances_mm, unsigned char *opposite, alb_sheet_memory *memory,
                               const alb_optical_sheet *sheet, const alb_surface_net *net, uint32_t from,
                               const uint32_t *to, const alb_vector *points, size_t count, double reach_mm);

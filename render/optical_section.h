// Curves in which a plane cuts the surface of a body, and the string drawn tight about them. In coordinates of the
// plane: x along a chord of the body from its start, y upwards to the side of the path.
#pragma once
#include "render/optical_solid.h"

enum { ALB_CUTS_MAX = 1024 };

typedef struct alb_section_plane {
    alb_vector origin, along, up, normal;
} alb_section_plane;

// Where the section crosses an edge of the mesh.
typedef struct alb_cut {
    double x, y;
    uint32_t place; // 3 * triangle + edge, of the triangle that the curve enters there
    int order;      // along the curve; the next curve begins with a gap
} alb_cut;

// The plane through the line that holds `towards`; up is zero where that lies on the line.
alb_section_plane alb_section_through(alb_vector origin, alb_vector along, alb_vector towards);
// Follows the curve (its number for the order) upwards from where the chord leaves, by crossing `first`, until it is
// back at the chord, and adds its cuts, at most ALB_CUTS_MAX in all. The crossing by which it returns; -1 where it does
// not, or where a string about it is seen to be longer than most_mm.
int alb_section_follow(alb_cut *cuts, int *cut_count, int curve, const alb_surface_net *net,
                       const alb_section_plane *plane, const alb_chord *chord, size_t first, double most_mm);
// The string from (0, 0) over the cuts to (length, 0): those it touches, in place; how many.
int alb_section_tighten(alb_cut *cuts, int count, double length);
// The path from end to end of the chord over the cuts that the string touches, its corners moved in space to where it
// is shortest or near that. False where it leaves the body; that is not looked into where it is not shorter than
// most_mm.
bool alb_string(alb_bends *bends, const alb_cut *hull, int kept, const alb_optical_solid *solid, const alb_chord *chord,
                const alb_section_plane *plane, double most_mm);

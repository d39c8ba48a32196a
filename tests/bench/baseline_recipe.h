// The recipe of Sheng et al. 2014 as a baseline: F by hemicube, S by distances between centroids, both stored as sparse
// matrices, B = S'(E + F B) by Jacobi. For bodies that are convex: distances are straight, so that its 26-neighbour
// paths (bench.optical_path) cost it nothing here.
#pragma once
#include "render/solution.h"

typedef struct recipe {
    size_t patches, form_entries, scatter_entries;
    double form_seconds, scatter_seconds, solve_seconds; // of one relighting
    int products;
    size_t bytes;                             // index and float of each entry of F, and of S once a channel
    double (*irradiance)[3], (*radiosity)[3]; // F B, B
} recipe;

// Runs it on a scene already solved, of which patches, tracer, E and M are taken: relative residual of 1e-3.
bool recipe_run(recipe *out, const alb_scene *scene, const alb_solution *solution, int hemicube_side, double threshold,
                alb_error *error);
void recipe_free(recipe *out);

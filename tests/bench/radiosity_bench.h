// What the parts of bench.radiosity share: its figures, the oracle of irradiance, and what is measured against it.
#pragma once
#include "baseline_recipe.h"
#include "scenes/scenes.h"

enum { SWEEP = 4 };

typedef double rgb[3];

typedef struct figures {
    size_t patches;
    double forms_s, scatter_s, bytes_mb, lights_s, relight_s, change_s, change_times;
    double error_percent, rays_error_percent, stated_percent;
    int products, jacobi_products;
} figures;

// Rows of the sweep: rays, hemicube, hemicube with small values dropped.
typedef struct bench {
    bool quick;
    int oracle_rays;
    size_t oracle_rows;
    figures of[TEST_SCENES];
    double frame_s;
    double narrow_made_s, narrow_s, narrow_mb, narrow_error_percent; // render/relight.h on the bowls
    size_t *rows;                                                    // of the oracle, for the scene at hand
    rgb *truth, *direct;                                             // by rays; what else falls there
    double sweep_seconds[3][SWEEP], sweep_bytes[3][SWEEP], sweep_error[3][SWEEP]; // lattice, hemicube, hemicube dropped
    recipe baseline;
    double baseline_error;
    figures beside; // ours on the baseline's scene
    double albedo_products[ALB_SOLVERS][4];
} bench;

// --- radiosity_oracle.c: what falls on some patches, drawn at random, in b->truth and b->direct
bool make_oracle(bench *b, const alb_scene *scene, const alb_solution *s, const rgb *radiosity, alb_error *error);
// F B and the sky by the form factors, of all patches.
void gather_all(rgb *out, const alb_scene *scene, const alb_solution *s, const alb_form_factors *factors,
                const rgb *radiosity);
// rms of what was found on the oracle's rows against it in percent, relative to all that falls there or to what comes
// by rays. found[row] or, by patch, found[rows[row]].
double error_of(const bench *b, const rgb *found, bool by_patch, bool whole);
// B without what small lamps send directly, which is in E; to be freed.
rgb *bounced(const alb_solution *s, alb_error *error);

// --- bench_radiosity.c: a scene
void note_creation(figures *out, const alb_solution *s);
bool solve_again(double *seconds, int *products, alb_solution *s, alb_solver solver, alb_error *error);
bool measure_error(bench *b, figures *out, const alb_scene *scene, const alb_solution *s, alb_error *error);

// --- radiosity_against.c: against the paper's recipe, and solvers by albedo
bool run_sweep(bench *b, alb_error *error);
bool run_recipe(bench *b, alb_error *error);
bool run_albedos(bench *b, alb_error *error);
// Pixels along the hemicube's edge.
int hemicube_side(const bench *b, int setting);

// --- radiosity_report.c
void print_scene(const bench *b, int i);
void print_rest(const bench *b);
bool write_json(const bench *b, const char *path, alb_error *error);
bool draw_chart(const bench *b, const char *path, alb_error *error);

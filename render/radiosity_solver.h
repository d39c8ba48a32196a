// Solvers of x = b + K x, three channels at once, K one bounce of light (S'F for radiosity) known by its products
// alone.
#pragma once
#include "render/radiosity_vectors.h"

typedef enum alb_solver {
    ALB_SOLVER_JACOBI,           // one bounce after the other
    ALB_SOLVER_GAUSS_SEIDEL,     // the same with what is new already, patch by patch
    ALB_SOLVER_ENERGY_CORRECTED, // Jacobi, and even light added until the power balances
    ALB_SOLVER_GMRES,            // smallest residual over all bounces so far
    ALB_SOLVER_TWO_LEVEL,        // on clusters of patches first: needs S' and F apart (alb_radiosity_solve)
    ALB_SOLVERS
} alb_solver;
extern const char *const alb_solver_names[ALB_SOLVERS]; // "jacobi", "gauss_seidel", ...

// Products of single precision hold 1e-7 or so: a smaller residual than this, times |x| / |b|, is not promised where it
// is asked for.
#define ALB_RESIDUAL_LEAST 1e-6
enum { ALB_PRODUCTS_MAX = 500 };

typedef struct alb_bounce {
    size_t count;
    const double *areas_mm2;
    const void *data;
    void (*apply)(alb_rgb *out, const void *data, const alb_rgb *x); // out = K x
    // x = right + K x in place, row by row with the rows already done. NULL: no Gauss-Seidel.
    void (*sweep)(alb_rgb *x, const void *data, const alb_rgb *right);
    const alb_rgb *even; // K of even light, or like it: the direction of the energy correction. NULL: ones
} alb_bounce;

typedef struct alb_radiosity_report {
    int iterations;                       // products with K; two_level: with S', and one more with F at the start
    double residual;                      // |b + K x - x| / |b|, area-weighted 2-norm, worst channel; of the vectors
                                          // themselves, no estimate. What is returned is b + K x, one bounce better.
                                          // Two_level: a bound of it, for what is returned (radiosity_two_level.c)
    double residual_flux[3];              // mean over area of |b + K x - x|; two_level: of |E + F B - (E + h)|
    double history[ALB_PRODUCTS_MAX + 1]; // residual after each product
} alb_radiosity_report;

// Solves to the relative residual, or as near as rounding lets it come (ALB_RESIDUAL_LEAST). start (may be NULL) is
// a guess, and costs one product. ALB_INTERNAL with the numbers where ALB_PRODUCTS_MAX products do not reach it;
// ALB_BAD_DATA where light or products with it are not finite;
// ALB_USAGE where the solver lacks what it needs of the bounce, as two_level does.
bool alb_solver_run(alb_rgb *x, alb_radiosity_report *report, alb_solver solver, const alb_bounce *bounce,
                    const alb_rgb *right, const alb_rgb *start, double residual, alb_error *error);

// What the solvers share: one run under way.
typedef struct alb_run {
    const alb_bounce *bounce;
    const alb_rgb *right;
    alb_space space;
    alb_rgb *x, *residual;
    double scale[3];      // |b|
    double wanted, floor; // residual asked for; below which rounding has the say
    alb_radiosity_report *report;
} alb_run;

// One product: residual = b + K x - x, noted. True where the run is over: it is small enough or no number, or products
// are spent.
bool alb_run_residual(alb_run *run);
// Sets the floor for x as it stands.
void alb_run_find_floor(alb_run *run);
// Largest of length[c] / scale[c]; NAN where one is no number.
double alb_run_worst(const alb_run *run, const double length[3]);
// Counts a product and notes the residual after it.
void alb_run_note(alb_run *run, double residual);
bool alb_run_gmres(alb_run *run, alb_error *error);
// ALB_INTERNAL with the numbers where neither the residual asked for nor the floor is reached; ALB_BAD_DATA where the
// residual is no number, with the patch of the light (b, or the irradiance that it comes from; may be NULL) that is
// none.
bool alb_solver_check(const alb_radiosity_report *report, alb_solver solver, double residual, double floor,
                      const alb_rgb *light, size_t count, alb_error *error);

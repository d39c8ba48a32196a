// Stationary iterations, and the table of all solvers. r = b + K x - x:
//     Jacobi            x += r                                        (Sheng et al. 2014 solve so)
//     Gauss-Seidel      the same row by row, with the rows already done
//     energy-corrected  x += t z + (r - t y),  z = K 1, y = z - K z, t = <1,r> / <1,y> per channel, <,> weighted by
//     area
// The last is Jacobi after a step along z that leaves the residual without net power: what decays slowest in a closed
// room is even light.
// Each ends with a bounce: the last residual r, by a product or from the Krylov basis, also makes x + r = b + K x,
// whose residual K r is smaller still.
//
// Convergence: ||K||_inf <= (largest row sum of S') (largest row sum of F) < 1 bounds the spectral radius; rows are
// what ray-cast factors hold exactly. (The bound rho(SF) <= rho(S) rho(F) of Sheng et al. 2014, sec. 3.3, is false in
// general.) Chebyshev iteration is not here: it needs an interval that holds the eigenvalues of K, facing plates have
// one near -albedo, and an interval [-0.3, albedo] then diverges from an albedo of 0.8 on.
#include "render/radiosity_solver.h"
#include "base/memory.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

const char *const alb_solver_names[ALB_SOLVERS] = {"jacobi", "gauss_seidel", "energy_corrected", "gmres", "two_level"};

double alb_run_worst(const alb_run *run, const double length[3])
{
    double shares[3];
    for (int c = 0; c < 3; c++)
        shares[c] = run->scale[c] == 0 ? 0 : fabs(length[c]) / run->scale[c];
    return alb_rgb_largest(shares);
}

void alb_run_note(alb_run *run, double residual)
{
    alb_radiosity_report *report = run->report;
    report->history[report->iterations < ALB_PRODUCTS_MAX ? report->iterations : ALB_PRODUCTS_MAX] = residual;
    report->iterations++;
}

void alb_run_find_floor(alb_run *run)
{
    double size[3];
    alb_space_norm(size, &run->space, (const alb_rgb *)run->x);
    run->floor = ALB_RESIDUAL_LEAST * fmax(1, alb_run_worst(run, size));
}

bool alb_run_residual(alb_run *run)
{
    double length[3];
    run->bounce->apply(run->residual, run->bounce->data, (const alb_rgb *)run->x);
    alb_space_residual(length, run->report->residual_flux, &run->space, run->residual, run->right,
                       (const alb_rgb *)run->x);
    alb_run_find_floor(run);
    run->report->residual = alb_run_worst(run, length);
    alb_run_note(run, run->report->residual);
    return !(run->report->residual > run->wanted) || run->report->iterations >= ALB_PRODUCTS_MAX;
}

static const double one[1][3] = {{1, 1, 1}}, minus_one[1][3] = {{-1, -1, -1}};

// x += r: where the residual comes from a product, the bounce b + K x.
static void add_residual(alb_run *run) { alb_space_add(NULL, &run->space, run->x, one, &run->residual, 1); }

static bool jacobi(alb_run *run, alb_error *error)
{
    (void)error;
    do
        add_residual(run);
    while (!alb_run_residual(run));
    return true;
}

// A sweep changes x by about its residual: a product that finds it is spent only when the change is small enough.
static bool gauss_seidel(alb_run *run, alb_error *error)
{
    const alb_bounce *bounce = run->bounce;
    if (!bounce->sweep)
        return alb_fail(error, ALB_USAGE, "gauss_seidel needs the rows of the matrix, and has its products alone");
    do {
        for (double change = INFINITY, length[3];
             change > run->wanted && run->report->iterations < ALB_PRODUCTS_MAX - 1;) {
            memcpy(run->residual, run->x, run->space.count * sizeof *run->x);
            bounce->sweep(run->x, bounce->data, run->right);
            alb_space_add(length, &run->space, run->residual, minus_one, &run->x, 1);
            alb_run_note(run, change = alb_run_worst(run, length));
        }
    } while (!alb_run_residual(run));
    return true;
}

// t z + (r - t y)
static bool energy_corrected(alb_run *run, alb_error *error)
{
    const alb_bounce *bounce = run->bounce;
    const alb_space *space = &run->space;
    const size_t n = space->count;
    bool ok = false;
    double power[1][3], needed[1][3];
    alb_rgb *ones = alb_allocate(n, sizeof *ones, error), *z = alb_allocate(n, sizeof *z, error),
            *y = alb_allocate(n, sizeof *y, error);
    if (!ones || !z || !y)
        goto done;
    for (size_t i = 0; i < n; i++)
        ones[i][0] = ones[i][1] = ones[i][2] = 1;
    memcpy(z, bounce->even ? bounce->even : (const alb_rgb *)ones, n * sizeof *z);
    bounce->apply(y, bounce->data, (const alb_rgb *)z);
    alb_run_note(run, 1);
    alb_space_add(NULL, space, y, minus_one, &z, 1); // K z - z = -y
    alb_space_dots(needed, space, (const alb_rgb *)y, &ones, 1);
    do {
        double factors[3][3] = {{0}, {1, 1, 1}, {0}};
        alb_space_dots(power, space, (const alb_rgb *)run->residual, &ones, 1);
        for (int c = 0; c < 3; c++)
            factors[0][c] = factors[2][c] = needed[0][c] < 0 ? -power[0][c] / needed[0][c] : 0;
        alb_space_add(NULL, space, run->x, (const double(*)[3])factors, (alb_rgb *const[]){z, run->residual, y}, 3);
    } while (!alb_run_residual(run));
    ok = true;
done:
    free(ones);
    free(z);
    free(y);
    return ok;
}

static bool two_level(alb_run *run, alb_error *error)
{
    (void)run;
    return alb_fail(error, ALB_USAGE, "two_level needs scattering and form factors apart, and has their product alone");
}

static bool (*const solvers[ALB_SOLVERS])(alb_run *, alb_error *) = {jacobi, gauss_seidel, energy_corrected,
                                                                     alb_run_gmres, two_level};

// Takes the guess where it helps: the multiple of it with the smallest residual, for each channel.
static bool take_start(alb_run *run, const alb_rgb *start, alb_error *error)
{
    const alb_space *space = &run->space;
    const size_t n = space->count;
    double dots[2][3], factors[1][3];
    alb_rgb *minus = alb_allocate(n, sizeof *minus, error); // (K - I) start
    if (!minus)
        return false;
    run->bounce->apply(minus, run->bounce->data, start);
    alb_space_add(NULL, space, minus, minus_one, (alb_rgb *const[]){(alb_rgb *)start}, 1);
    alb_space_dots(dots, space, (const alb_rgb *)minus, (alb_rgb *const[]){minus, run->residual}, 2);
    for (int c = 0; c < 3; c++)
        factors[0][c] = dots[0][c] > 0 ? -dots[1][c] / dots[0][c] : 0;
    memcpy(run->x, start, n * sizeof *run->x);
    alb_space_scale(space, run->x, factors[0]);
    alb_space_add(dots[0], space, run->residual, (const double(*)[3])factors, &minus, 1);
    alb_space_mean(run->report->residual_flux, space, (const alb_rgb *)run->residual);
    run->report->residual = alb_run_worst(run, dots[0]);
    alb_run_note(run, run->report->residual);
    free(minus);
    return true;
}

// Names the first that is not finite.
static bool check_light(const alb_rgb *light, size_t count, alb_error *error)
{
    for (size_t i = 0; light && i < count; i++)
        for (int c = 0; c < 3; c++)
            if (!isfinite(light[i][c]))
                return alb_fail(error, ALB_BAD_DATA, "radiosity: the light on patch %zu, channel %c, is %g", i,
                                "RGB"[c], light[i][c]);
    return true;
}

bool alb_solver_check(const alb_radiosity_report *report, alb_solver solver, double residual, double floor,
                      const alb_rgb *light, size_t count, alb_error *error)
{
    if (isnan(report->residual))
        return check_light(light, count, error) &&
               alb_fail(error, ALB_BAD_DATA,
                        "radiosity: the residual is no number after %d products of %s: light, or what a product "
                        "makes of it, is not finite or too bright for its square",
                        report->iterations, alb_solver_names[solver]);
    return report->residual <= fmax(residual, floor) ||
           alb_fail(error, ALB_INTERNAL, "radiosity: residual %.3g after %d products of %s, asked for %.3g",
                    report->residual, report->iterations, alb_solver_names[solver], residual);
}

bool alb_solver_run(alb_rgb *x, alb_radiosity_report *report, alb_solver solver, const alb_bounce *bounce,
                    const alb_rgb *right, const alb_rgb *start, double residual, alb_error *error)
{
    const size_t n = bounce->count;
    alb_run run = {.bounce = bounce, .right = right, .x = x, .wanted = residual, .report = report};
    *report = (alb_radiosity_report){.residual = 1};
    bool ok = alb_space_create(&run.space, bounce->areas_mm2, n, error) &&
              (run.residual = alb_allocate(n, sizeof *run.residual, error));
    if (ok) {
        alb_space_norm(run.scale, &run.space, right);
        for (int c = 0; c < 3; c++)
            run.scale[c] = isfinite(run.scale[c]) ? run.scale[c] : (double)NAN; // or all would be small beside it
        memset(x, 0, n * sizeof *x);
        memcpy(run.residual, right, n * sizeof *x);
        if (run.scale[0] + run.scale[1] + run.scale[2] == 0)
            report->residual = 0; // dark: nothing to do
        else
            ok = (!start || take_start(&run, start, error)) &&
                 (report->residual <= residual || solvers[solver](&run, error));
    }
    if (ok && report->iterations)
        add_residual(&run); // the last bounce
    ok = ok && alb_solver_check(report, solver, residual, run.floor, right, n, error);
    alb_space_free(&run.space);
    free(run.residual);
    return ok;
}

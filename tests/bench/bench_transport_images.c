// Absorption and scattering from the images of both sides with an unknown scale: error over the Cramer-Rao bound
// against time, by transport (fit/joint.h) and by the diffusion multipole with the same readings, weights and free
// scale. Prints a table and draws the chart: bench.transport_images CHART.svg
//
// Truth: photons. Readings: rings from 1 to 25 transport mean free paths, some 45 a side, 1 % noise each, a scale of
// +-2 %. The bound has the photons' own noise in it. Diffusion starts from the truth.
#include "base/plot.h"
#include "base/progress.h"
#include "fit/diffusion.h"
#include "fit/solve.h"
#include "tests/slab_rings.h"
#include <stdio.h>

enum { SLABS = 6, TRIALS = 100, METHODS = 2, PARAMETERS = 2 };
static const double noise = 0.01, scale_sd = 0.02;

typedef struct specimen {
    const char *name;
    alb_slab slab;
    long photons;
} specimen;

static const specimen specimens[SLABS] = {{"marble 20 mfp'", {0.0041, 2.62, 0, 1.5, 7.6}, 6000000},
                                          {"marble 12 mfp' g 0.9", {0.0041, 26.2, 0.9, 1.5, 4.6}, 1000000},
                                          {"skim milk 12 mfp'", {0.0014, 0.70, 0, 1.33, 17.2}, 6000000},
                                          {"skim milk 24 mfp'", {0.0025, 1.22, 0, 1.33, 19.7}, 6000000},
                                          {"wax 10 mfp'", {0.02, 1, 0, 1.44, 10}, 6000000},
                                          {"marble 5 mfp'", {0.0041, 2.62, 0, 1.5, 2}, 6000000}};

typedef struct result {
    double bias[PARAMETERS], rmse[PARAMETERS], bound[PARAMETERS], seconds, chi_square;
} result;

typedef struct diffusion_problem {
    const slab_rings *rings;
    const alb_readings *readings;
    alb_diffusion_face face;
} diffusion_problem;

static void diffusion_evaluate(double *residuals, double *jacobian, const double *p, const void *context)
{
    const diffusion_problem *problem = context;
    const alb_slab *slab = &problem->rings->slab;
    const double n = slab->refractive_index, entry = 4 * n / ((n + 1) * (n + 1)), scale = entry * exp(p[2]);
    const alb_diffusion light = alb_diffusion_at(&problem->face, exp(p[0]), exp(p[1]), slab->thickness_mm);
    int row = 0;
    for (int side = 0; side < ALB_SIDES; side++)
        for (int k = 0; k < problem->readings[side].count; k++, row++) {
            const alb_readings *readings = &problem->readings[side];
            double gradient[2];
            const double value =
                scale * alb_diffusion_value(jacobian ? gradient : NULL, &light, (alb_side)side, readings->r_mm[k]);
            residuals[row] = (value - readings->value[k]) / readings->sd[k];
            for (int c = 0; jacobian && c < 3; c++)
                jacobian[3 * row + c] = (c < 2 ? scale * gradient[c] * exp(p[c]) : value) / readings->sd[k];
        }
    residuals[row] = p[2] / scale_sd;
    for (int c = 0; jacobian && c < 3; c++)
        jacobian[3 * row + c] = c == 2 ? 1 / scale_sd : 0;
}

static bool diffusion_fit(double found[PARAMETERS], const slab_rings *rings, double scale, uint64_t trial)
{
    alb_readings readings[ALB_SIDES] = {{0}};
    const diffusion_problem problem = {rings, readings,
                                       alb_diffusion_face_at(ALB_DIFFUSION_GROSJEAN, rings->slab.refractive_index)};
    double p[3] = {log(rings->slab.absorption_per_mm),
                   log(rings->slab.scattering_per_mm * (1 - rings->slab.anisotropy)), 0};
    const double lower[3] = {p[0] - 8, p[1] - 3, -1}, upper[3] = {p[0] + 8, p[1] + 3, 1};
    double chi_square;
    bool ok = slab_rings_photograph(readings, rings, noise, scale, trial, NULL);
    const alb_problem least_squares = {
        3, readings[0].count + readings[1].count + 1, diffusion_evaluate, &problem, lower, upper};
    ok = ok && alb_solve(p, &chi_square, &least_squares, NULL);
    found[0] = exp(p[0]), found[1] = exp(p[1]);
    alb_readings_free(&readings[0]);
    alb_readings_free(&readings[1]);
    return ok;
}

static bool measure(result out[METHODS], const slab_rings *rings)
{
    const double truth[PARAMETERS] = {rings->slab.absorption_per_mm,
                                      rings->slab.scattering_per_mm * (1 - rings->slab.anisotropy)};
    for (int method = 0; method < METHODS; method++) {
        const double start_s = alb_clock_s();
        out[method] = (result){0};
        for (int t = 0; t < TRIALS; t++) {
            alb_random random = alb_random_at(5, 1, (uint64_t)t);
            const double scale = exp(scale_sd * alb_random_normal(&random));
            alb_joint joint;
            double found[PARAMETERS];
            if (method == 0) {
                if (!slab_rings_fit(&joint, rings, noise, scale, scale_sd, (uint64_t)t, false, NULL))
                    return false;
                found[0] = joint.absorption_per_mm, found[1] = joint.reduced_scattering_per_mm;
                out[0].chi_square += joint.chi_square / joint.degrees_of_freedom / TRIALS;
                out[0].bound[0] += joint.relative_bound[0] / TRIALS,
                    out[0].bound[1] += joint.relative_bound[1] / TRIALS;
            } else if (!diffusion_fit(found, rings, scale, (uint64_t)t)) {
                return false;
            }
            for (int p = 0; p < PARAMETERS; p++) {
                const double off = log(found[p] / truth[p]);
                out[method].bias[p] += off / TRIALS;
                out[method].rmse[p] += off * off / TRIALS;
            }
        }
        out[method].seconds = (alb_clock_s() - start_s) / TRIALS;
        for (int p = 0; p < PARAMETERS; p++)
            out[method].rmse[p] = sqrt(out[method].rmse[p]);
    }
    return true;
}

static bool chart(result results[SLABS][METHODS], const char *path, alb_error *error)
{
    static const char *const labels[4] = {"transport: absorption", "transport: scattering", "diffusion: absorption",
                                          "diffusion: scattering"};
    double seconds[METHODS][SLABS], ratio[METHODS * PARAMETERS][SLABS];
    alb_curve curves[METHODS * PARAMETERS] = {{0}};
    for (int i = 0; i < METHODS * PARAMETERS; i++) {
        for (int s = 0; s < SLABS; s++) {
            seconds[i / PARAMETERS][s] = results[s][i / PARAMETERS].seconds;
            ratio[i][s] = results[s][i / PARAMETERS].rmse[i % PARAMETERS] / results[s][0].bound[i % PARAMETERS];
        }
        curves[i] = (alb_curve){
            .label = labels[i], .x = seconds[i / PARAMETERS], .y = ratio[i], .count = SLABS, .mark = ALB_MARK_POINTS};
    }
    const alb_panel panel = {.title = "Absorption and scattering from images of both sides, scale unknown by 2 %",
                             .x_label = "seconds a fit",
                             .y_label = "rms error over the Cramer-Rao bound",
                             .log_x = true,
                             .log_y = true,
                             .curves = curves,
                             .curve_count = METHODS * PARAMETERS,
                             .height = 1};
    return alb_plot_write(path, &panel, 1, 800, 450, error);
}

int main(int argc, char **argv)
{
    static result results[SLABS][METHODS];
    static const char *const names[METHODS] = {"transport", "diffusion"};
    alb_error error = {0};
    bool ok = true;
    printf("%-22s %-10s %27s   %27s\n%-22s %-10s %9s %8s %8s   %9s %8s %8s %9s %8s\n", "", "", "absorption, %",
           "scattering, %", "slab", "method", "bias", "rmse", "/bound", "bias", "rmse", "/bound", "chi^2/dof",
           "seconds");
    for (int s = 0; ok && s < SLABS; s++) {
        slab_rings rings;
        ok = slab_rings_create(&rings, &specimens[s].slab, specimens[s].photons, &error) &&
             (measure(results[s], &rings) || alb_fail(&error, ALB_INTERNAL, "%s: a fit failed", specimens[s].name));
        slab_rings_free(&rings);
        for (int m = 0; ok && m < METHODS; m++) {
            const result *r = &results[s][m];
            printf("%-22s %-10s %+9.2f %8.2f %8.2f   %+9.2f %8.2f %8.2f %9.2f %8.3f\n", m ? "" : specimens[s].name,
                   names[m], 100 * r->bias[0], 100 * r->rmse[0], r->rmse[0] / results[s][0].bound[0], 100 * r->bias[1],
                   100 * r->rmse[1], r->rmse[1] / results[s][0].bound[1], r->chi_square, r->seconds);
            fflush(stdout);
        }
    }
    if (ok && argc > 1)
        ok = chart(results, argv[1], &error);
    if (!ok)
        fprintf(stderr, "bench.transport_images: %s\n", error.text);
    return ok ? 0 : (int)error.status;
}

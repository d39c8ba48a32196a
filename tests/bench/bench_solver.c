// Solvers: products with S'F and seconds against residual, for albedos from 0.5 to 0.99. Prints a table and draws the
// chart: bench.solver CHART.svg [cells of a wall, 40]
//
// Scene: a closed room of 4 x 4 x 4, walls of one reflectance, with a translucent ball, a diffuse one and a translucent
// block, all of the same albedo (profile exp(-20 r)), lit by a small spot. Every solver starts from nothing. The time
// of a run is spread evenly over its products.
#include "base/plot.h"
#include "base/progress.h"
#include "render/radiosity.h"
#include "render/shape.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { ALBEDOS = 4 };
static const double albedos[ALBEDOS] = {0.5, 0.8, 0.95, 0.99};
static const double finest = 1e-6;

typedef struct bench {
    alb_mesh mesh;
    alb_patches patches;
    alb_tracer tracer;
    alb_form_factors factors;
    alb_scatter scatter;
    alb_radiosity equations;
    alb_surface surfaces[2];
    alb_rgb *light, *radiosity;
    // of the last albedo, for the chart
    double products[ALB_SOLVERS][ALB_PRODUCTS_MAX + 1], seconds[ALB_SOLVERS][ALB_PRODUCTS_MAX + 1],
        residuals[ALB_SOLVERS][ALB_PRODUCTS_MAX + 1];
    size_t counts[ALB_SOLVERS];
} bench;

static bool add(alb_mesh *mesh, alb_mesh *part, uint16_t group, alb_error *error)
{
    for (size_t i = 0; i < part->face_count; i++)
        part->groups[i] = group;
    const bool ok = alb_mesh_append(mesh, part, 1, (alb_vector){0}, error);
    for (size_t i = mesh->face_count - part->face_count; ok && i < mesh->face_count; i++)
        mesh->groups[i] = group;
    alb_mesh_free(part);
    return ok;
}

static bool build(bench *b, int cells, alb_error *error)
{
    alb_mesh ball = {0}, other = {0}, block = {0};
    const alb_box room = {
        .centre_mm = {2, 2, 2}, .size_mm = {4, 4, 4}, .cells = {cells, cells, cells}, .grading = 1, .inward = true};
    const alb_box solid = {
        .centre_mm = {2.9, 1, 1.2}, .size_mm = {1, 1, 2}, .cells = {cells / 3, cells / 3, cells / 2}, .grading = 1};
    const int levels = cells >= 64 ? 5 : cells >= 24 ? 4 : 3;
    const alb_sphere wax = {.centre_mm = {1.2, 1.3, 0.9}, .radius_mm = 0.7, .subdivisions = levels},
                     clay = {.centre_mm = {1.4, 2.9, 0.8}, .radius_mm = 0.6, .subdivisions = levels - 1};
    bool ok = alb_shape_box(&b->mesh, &room, error) && alb_shape_sphere(&ball, &wax, error) &&
              alb_shape_sphere(&other, &clay, error) && alb_shape_box(&block, &solid, error) &&
              add(&b->mesh, &ball, 1, error) && add(&b->mesh, &other, 0, error) && add(&b->mesh, &block, 1, error) &&
              alb_patches_create(&b->patches, &b->mesh, error) && alb_tracer_create(&b->tracer, &b->mesh, error) &&
              alb_form_factors_create(&b->factors, &b->patches, &b->tracer, 256, 1, ALB_SAMPLING_LATTICE, error);
    const size_t n = b->patches.count;
    b->light = calloc(n, sizeof *b->light);
    b->radiosity = calloc(n, sizeof *b->radiosity);
    if (ok && (!b->light || !b->radiosity))
        ok = alb_fail(error, ALB_NO_MEMORY, "out of memory for %zu patches", n);
    for (size_t p = 0; ok && p < n; p++) {
        const alb_vector c = b->patches.centroids[p];
        if (b->patches.normals[p].z > 0.5 && hypot(c.x - 1.4, c.y - 1.4) < 0.6)
            b->light[p][0] = b->light[p][1] = b->light[p][2] = b->patches.normals[p].z;
    }
    return ok;
}

static bool set_albedo(bench *b, double albedo, alb_error *error)
{
    alb_radiosity_free(&b->equations);
    alb_scatter_free(&b->scatter);
    b->surfaces[0] = (alb_surface){.name = "clay", .reflectance = {albedo, albedo, albedo}};
    b->surfaces[1] = (alb_surface){.name = "wax", .scatters = true};
    for (int c = 0; c < 3; c++) // 2 pi a / b^2 is the albedo
        b->surfaces[1].profiles[0][c] = (alb_profile){ALB_FORM_EXPONENTIAL, {albedo * 400 / (2 * M_PI), 20}};
    return alb_scatter_create(&b->scatter, &b->patches, b->mesh.groups, b->surfaces, 0.005, error) &&
           alb_radiosity_create(&b->equations, &b->patches, &b->scatter, &b->factors, error);
}

static int products_to(const alb_radiosity_report *report, double residual)
{
    int k = 0;
    while (k < report->iterations && report->history[k] > residual)
        k++;
    return k + 1;
}

// One solution, its seconds too; products spent without reaching the residual is a result here.
static bool solve(bench *b, alb_radiosity_report *report, double *seconds, alb_solver solver, double residual,
                  alb_error *error)
{
    const double start_s = alb_clock_s();
    const bool ok = alb_radiosity_solve(b->radiosity, report, &b->equations, solver, (const alb_rgb *)b->light, NULL,
                                        NULL, residual, error);
    *seconds = alb_clock_s() - start_s;
    if (!ok && report->iterations < ALB_PRODUCTS_MAX)
        return false;
    *error = (alb_error){0};
    return true;
}

static void print_products(int products)
{
    if (products < ALB_PRODUCTS_MAX)
        printf(" %8d", products);
    else
        printf(" %8s", "> 500");
}

// To 1e-3 from nothing, and the way to 1e-6.
static bool measure(bench *b, alb_solver solver, double albedo, alb_error *error)
{
    alb_radiosity_report report;
    double seconds, all_s;
    if (!solve(b, &report, &seconds, solver, 1e-3, error))
        return false;
    printf("%6.2f %-16s", albedo, alb_solver_names[solver]);
    print_products(report.iterations);
    if (!solve(b, &report, &all_s, solver, finest, error))
        return false;
    const double each_s = all_s / report.iterations;
    print_products(products_to(&report, finest));
    printf(" %10.4f %10.4f\n", seconds, each_s);
    b->counts[solver] = (size_t)report.iterations;
    for (int k = 0; k < report.iterations; k++) {
        b->products[solver][k] = k + 1;
        b->seconds[solver][k] = (k + 1) * each_s;
        b->residuals[solver][k] = report.history[k];
    }
    return true;
}

static bool chart(const bench *b, const char *path, alb_error *error)
{
    alb_curve by_products[ALB_SOLVERS] = {{0}}, by_time[ALB_SOLVERS] = {{0}};
    for (int k = 0; k < ALB_SOLVERS; k++) {
        by_products[k] = (alb_curve){.label = alb_solver_names[k],
                                     .x = b->products[k],
                                     .y = b->residuals[k],
                                     .count = b->counts[k],
                                     .mark = b->counts[k] < 50 ? ALB_MARK_LINE_AND_POINTS : ALB_MARK_LINE};
        by_time[k] = by_products[k];
        by_time[k].x = b->seconds[k];
    }
    const alb_panel panels[2] = {{.title = "Solvers at albedo 0.99, closed room: residual against products with S'F",
                                  .x_label = "products",
                                  .y_label = "relative residual",
                                  .log_x = true,
                                  .log_y = true,
                                  .curves = by_products,
                                  .curve_count = ALB_SOLVERS,
                                  .height = 1},
                                 {.title = "The same against time",
                                  .x_label = "seconds",
                                  .y_label = "relative residual",
                                  .log_x = true,
                                  .log_y = true,
                                  .curves = by_time,
                                  .curve_count = ALB_SOLVERS,
                                  .height = 1}};
    return alb_plot_write(path, panels, 2, 800, 800, error);
}

int main(int argc, char **argv)
{
    static bench b;
    alb_error error = {0};
    bool ok = build(&b, argc > 2 ? atoi(argv[2]) : 40, &error);
    printf("%zu patches; products to a residual of\n%6s %-16s %8s %8s %10s %10s\n", b.patches.count, "albedo", "solver",
           "1e-3", "1e-6", "s to 1e-3", "s/product");
    for (int k = 0; ok && k < ALBEDOS; k++) {
        ok = set_albedo(&b, albedos[k], &error);
        for (int solver = 0; ok && solver < ALB_SOLVERS; solver++)
            ok = measure(&b, (alb_solver)solver, albedos[k], &error);
    }
    if (ok && argc > 1)
        ok = chart(&b, argv[1], &error);
    if (!ok)
        fprintf(stderr, "bench.solver: %s\n", error.text);
    free(b.light);
    free(b.radiosity);
    alb_radiosity_free(&b.equations);
    alb_scatter_free(&b.scatter);
    alb_form_factors_free(&b.factors);
    alb_tracer_free(&b.tracer);
    alb_patches_free(&b.patches);
    alb_mesh_free(&b.mesh);
    return ok ? 0 : (int)error.status;
}

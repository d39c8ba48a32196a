// Optical paths: error against time for ours at several voxel sizes and for the paper's recipe, Dijkstra over 26
// neighbours, on two prisms whose shortest paths are known. Prints a table and draws the chart:
// bench.optical_path CHART.svg
//
// Error: of all pairs from 40 patches to 200 each, mean and largest of |found / true - 1|. Seconds: of one thread, per
// source with 200 targets, without what is made once a body. The recipe measures from voxel to voxel; pairs nearer than
// four of its largest voxels are left out for both, so that its rounding of the ends is not what is compared.
#include "base/plot.h"
#include "base/progress.h"
#include "base/random.h"
#include "baseline_dijkstra.h"
#include "render/optical_solid.h"
#include "render/prisms.h"
#include <stdio.h>

enum { SHAPES = 2, SETTINGS = 4, SOURCES = 40, TARGETS = 200 };
static const char *const shape_names[SHAPES] = {"pipe", "U block"};
static const double voxels_ours[SETTINGS] = {0.12, 0.2, 0.3, 0.45}, voxels_grid[SETTINGS] = {0.025, 0.035, 0.05, 0.07};
static const squares u_block = {3, 3, {"###", "#.#", "#.#"}};

typedef struct bench {
    int shape;
    double unit; // the size of the shape against the pipe's
    alb_mesh mesh;
    alb_patches patches;
    alb_bodies bodies;
    plane_region region;
} bench;

typedef struct result {
    double mean_percent, largest_percent, seconds, create_seconds;
    long bent;
} result;

static bool build(bench *b, int shape, alb_error *error)
{
    *b = (bench){.shape = shape, .unit = shape ? 1.5 : 1};
    make_region(&b->region, &u_block);
    if (!(shape ? make_squares(&b->mesh, &u_block, 16, 1, error)
                : make_ring(&b->mesh, 0.5, 1, 0.6, 128, 10, 12, error)) ||
        !alb_patches_create(&b->patches, &b->mesh, error))
        return false;
    int *labels = calloc(b->patches.count, sizeof *labels);
    const bool ok = labels && alb_bodies_find(&b->bodies, &b->patches, labels, error);
    free(labels);
    return ok;
}

static void destroy(bench *b)
{
    alb_bodies_free(&b->bodies);
    alb_patches_free(&b->patches);
    alb_mesh_free(&b->mesh);
}

static double truth(const bench *b, uint32_t from, uint32_t to)
{
    const alb_vector a = b->patches.centroids[from], c = b->patches.centroids[to];
    const double p[2] = {a.x, a.y}, q[2] = {c.x, c.y};
    return hypot(b->shape ? region_distance(&b->region, &u_block, p, q) : ring_distance(0.5, p, q), a.z - c.z);
}

static uint32_t pick(const bench *b, uint64_t index)
{
    alb_random random = alb_random_at(9, 1, index);
    return (uint32_t)(alb_random_uniform(&random) * (double)b->patches.count);
}

static void add(result *r, const bench *b, uint32_t from, uint32_t to, double found)
{
    const double exact = truth(b, from, to), error = 100 * fabs(found / exact - 1);
    if (exact < 4 * voxels_grid[SETTINGS - 1] * b->unit)
        return;
    r->mean_percent += error;
    r->largest_percent = fmax(r->largest_percent, error);
    r->bent++;
}

static bool measure_ours(result *r, const bench *b, double voxel_mm, alb_error *error)
{
    alb_optical_paths paths;
    alb_optical_workspace work = {0};
    alb_optical_target targets[TARGETS];
    float distances[TARGETS];
    *r = (result){0};
    double before_s = alb_clock_s();
    if (!alb_optical_paths_create(&paths, &b->bodies.bodies[0], &b->patches,
                                  &(alb_optical_options){.voxel_mm = voxel_mm * b->unit}, error))
        return false;
    r->create_seconds = alb_clock_s() - before_s;
    const bool ok = alb_optical_workspace_create(&work, &paths, error);
    for (uint64_t s = 0; ok && s < SOURCES; s++) {
        const uint32_t from = pick(b, s);
        for (uint64_t i = 0; i < TARGETS; i++) {
            const uint32_t to = pick(b, 1000 + s * TARGETS + i);
            const alb_vector c = b->patches.centroids[to];
            targets[i] = (alb_optical_target){to, (float)c.x, (float)c.y, (float)c.z};
        }
        before_s = alb_clock_s();
        alb_optical_paths_measure(distances, NULL, &work, &paths, from, targets, TARGETS);
        r->seconds += (alb_clock_s() - before_s) / SOURCES;
        for (int i = 0; i < TARGETS; i++)
            add(r, b, from, targets[i].patch, (double)distances[i]);
    }
    r->mean_percent /= (double)r->bent;
    alb_optical_workspace_free(&work);
    alb_optical_paths_free(&paths);
    return ok;
}

static bool measure_grid(result *r, const bench *b, double voxel_mm, alb_error *error)
{
    alb_optical_solid solid = {0};
    alb_voxels voxels = {0};
    baseline_dijkstra grid = {0};
    *r = (result){0};
    double before_s = alb_clock_s();
    const bool ok = alb_surface_net_create(&solid.net, &b->bodies.bodies[0], &b->patches, error) &&
                    alb_voxels_create(&voxels, (const alb_vector(*)[3])solid.net.triangles, solid.net.count,
                                      voxel_mm * b->unit, 100000000, true, error) &&
                    baseline_dijkstra_create(&grid, &voxels, error);
    r->create_seconds = alb_clock_s() - before_s;
    for (uint64_t s = 0; ok && s < SOURCES; s++) {
        const uint32_t from = pick(b, s);
        before_s = alb_clock_s();
        baseline_dijkstra_run(&grid, solid.net.middles[from]);
        r->seconds += (alb_clock_s() - before_s) / SOURCES;
        for (uint64_t i = 0; i < TARGETS; i++) {
            const uint32_t to = pick(b, 1000 + s * TARGETS + i);
            add(r, b, from, to, baseline_dijkstra_length(&grid, solid.net.middles[to]));
        }
    }
    r->mean_percent /= (double)r->bent;
    baseline_dijkstra_free(&grid);
    alb_voxels_free(&voxels);
    alb_surface_net_free(&solid.net);
    return ok;
}

static bool draw(result results[SHAPES][2][SETTINGS], const char *path, alb_error *error)
{
    double x[SHAPES][2][SETTINGS], mean[SHAPES][2][SETTINGS], largest[SHAPES][2][SETTINGS];
    alb_curve curves[2][4];
    static const char *const labels[4] = {"pipe, any-angle", "pipe, 26 neighbours", "U block, any-angle",
                                          "U block, 26 neighbours"};
    for (int k = 0; k < 4; k++) {
        for (int i = 0; i < SETTINGS; i++) {
            const result *r = &results[k / 2][k % 2][i];
            x[k / 2][k % 2][i] = 1000 * r->seconds;
            mean[k / 2][k % 2][i] = r->mean_percent, largest[k / 2][k % 2][i] = r->largest_percent;
        }
        curves[0][k] = (alb_curve){.label = labels[k],
                                   .x = x[k / 2][k % 2],
                                   .y = mean[k / 2][k % 2],
                                   .count = SETTINGS,
                                   .mark = ALB_MARK_LINE_AND_POINTS};
        curves[1][k] = curves[0][k];
        curves[1][k].y = largest[k / 2][k % 2];
    }
    alb_panel panels[2];
    for (int k = 0; k < 2; k++)
        panels[k] = (alb_panel){.title = k ? "The largest error of the same" : "Optical paths: mean error against time",
                                .x_label = "milliseconds a source, 200 targets, one thread",
                                .y_label = k ? "largest error, %" : "mean error, %",
                                .log_x = true,
                                .log_y = true,
                                .curves = curves[k],
                                .curve_count = 4,
                                .height = 1};
    return alb_plot_write(path, panels, 2, 800, 800, error);
}

int main(int argc, char **argv)
{
    static result results[SHAPES][2][SETTINGS];
    alb_error error = {0};
    bool ok = true;
    printf("%-8s %-14s %8s %10s %10s %14s %12s\n", "shape", "method", "voxel", "mean, %", "largest, %", "ms a source",
           "prepared, s");
    for (int shape = 0; ok && shape < SHAPES; shape++) {
        bench b;
        ok = build(&b, shape, &error);
        for (int method = 0; ok && method < 2; method++)
            for (int k = 0; ok && k < SETTINGS; k++) {
                result *r = &results[shape][method][k];
                const double voxel = method ? voxels_grid[k] : voxels_ours[k];
                ok = (method ? measure_grid : measure_ours)(r, &b, voxel, &error);
                printf("%-8s %-14s %8.3f %10.4f %10.3f %14.3f %12.3f\n", shape_names[shape],
                       method ? "26 neighbours" : "any-angle", voxel * b.unit, r->mean_percent, r->largest_percent,
                       1000 * r->seconds, r->create_seconds);
            }
        destroy(&b);
    }
    if (ok && argc > 1)
        ok = draw(results, argv[1], &error);
    if (!ok)
        fprintf(stderr, "bench.optical_path: %s\n", error.text);
    return ok ? 0 : (int)error.status;
}

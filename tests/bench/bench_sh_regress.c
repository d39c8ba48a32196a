// The regressed law of occlusion: fits it, says whether render/sh_regress_data.c holds what it fitted, and draws the
// error against the distance beside the paper's matrix, the windowed ones and leaving the object out.
// bench.sh_regress CHART.svg [--write render/sh_regress_data.c]
//
// Fit: at each k, one matrix per |m| from the occlusion coefficients at the sample to (k^2 S(k) - S) / u, u = 1 - 1/k,
// ridge least squares, lambda 1e-4 per sample, over 1500 random clusters of one to five spheres, each seen from four
// sides, sample at 1.02 of the bounding sphere; the k are the Chebyshev points in u. Error: rms over the sphere of the
// band-limited occlusion, over 400 clusters that the fit has not seen.
#include "base/file.h"
#include "base/memory.h"
#include "base/plot.h"
#include "base/random.h"
#include "render/sh_regress.h"
#include "render/tracer.h"
#include "scenes/animal.h"
#include "scenes/shapes.h"
#include "scenes/sphere_cluster.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum {
    ORDER = ALB_SH_REGRESS_ORDER,
    COUNT = ORDER * ORDER,
    POWERS = ALB_SH_REGRESS_POWERS,
    TRAINING = 6000,
    FRESH = 400
};
enum { VALUES = ALB_SH_REGRESS_VALUES, DISTANCES = 25, LAWS = 5 };
static const double sample_distance = 1.02, ridge = 1e-4;

typedef double row[COUNT];

// x = A^-1 b by Gauss-Jordan, A symmetric and positive, n <= ORDER.
static void solve(double *x, double a[ORDER][ORDER], const double *b, int n)
{
    double work[ORDER][ORDER + 1];
    for (int i = 0; i < n; i++) {
        memcpy(work[i], a[i], (size_t)n * sizeof(double));
        work[i][n] = b[i];
    }
    for (int p = 0; p < n; p++)
        for (int i = 0; i < n; i++) {
            const double factor = i == p ? 0 : work[i][p] / work[p][p];
            for (int j = p; j <= n && i != p; j++)
                work[i][j] -= factor * work[p][j];
        }
    for (int i = 0; i < n; i++)
        x[i] = work[i][n] / work[i][i];
}

// The values of one k: in[l'], out[l] of every training sample and both signs of m.
static void regress(double values[VALUES], const row *in, const row *out, double k)
{
    const double u = 1 - 1 / k;
    for (int m = 0; m < ORDER; m++) {
        double gram[ORDER][ORDER] = {{0}}, right[ORDER][ORDER] = {{0}};
        for (int s = 0; s < TRAINING; s++)
            for (int sign = -1; sign <= (m ? 1 : -1); sign += 2)
                for (int i = m; i < ORDER; i++) {
                    const double from = in[s][alb_sh_index(i, sign * m)];
                    for (int j = m; j < ORDER; j++) {
                        const int at = alb_sh_index(j, sign * m);
                        gram[i - m][j - m] += from * in[s][at];
                        right[j - m][i - m] += from * (k * k * out[s][at] - in[s][at]) / u;
                    }
                }
        for (int i = 0; i < ORDER - m; i++)
            gram[i][i] += ridge * TRAINING;
        for (int l = m; l < ORDER; l++)
            solve(values + alb_sh_scaling_index(ORDER, ORDER, m, l, m), gram, right[l - m], ORDER - m);
    }
}

static bool fit(float coefficients[POWERS][VALUES], alb_error *error)
{
    double values[POWERS][VALUES];
    row *in = alb_allocate(TRAINING, sizeof *in, error), *out = alb_allocate(TRAINING, sizeof *out, error);
    const bool ok = in && out;
    for (int p = -1; p < POWERS && ok; p++) {
        const double u = 0.5 + 0.5 * cos((p + 0.5) * M_PI / POWERS), k = p < 0 ? 1 : 1 / (1 - u);
#pragma omp parallel for
        for (int s = 0; s < TRAINING; s++) { // four sides: the same cluster turned by 90 degrees
            sphere_cluster cluster = sphere_cluster_random(1, (uint64_t)(s / 4));
            for (int i = 0; i < cluster.count; i++) {
                double *c = cluster.centre[i];
                const double x = c[0], z = c[2];
                const double cosine[] = {1, 0, -1, 0}, sine[] = {0, 1, 0, -1};
                c[0] = cosine[s % 4] * x + sine[s % 4] * z, c[2] = cosine[s % 4] * z - sine[s % 4] * x;
            }
            sphere_cluster_occlusion(p < 0 ? in[s] : out[s], ORDER, &cluster, sample_distance * k);
        }
        if (p >= 0)
            regress(values[p], (const row *)in, (const row *)out, k);
    }
    for (int j = 0; j < POWERS && ok; j++)
        for (int v = 0; v < VALUES; v++) {
            double sum = 0;
            for (int p = 0; p < POWERS; p++)
                sum += (j ? 2. : 1.) / POWERS * values[p][v] * cos(j * (p + 0.5) * M_PI / POWERS);
            coefficients[j][v] = (float)sum;
        }
    free(in), free(out);
    return ok;
}

static bool write_data(float coefficients[POWERS][VALUES], const char *path, alb_error *error)
{
    alb_text text = {0};
    alb_text_add(&text, "// Written by bench.sh_regress --write: Chebyshev coefficients of the regressed law (render/"
                        "sh_regress.h).\n#include \"render/sh_regress.h\"\n\n// clang-format off\nconst float "
                        "alb_sh_regress_coefficients[ALB_SH_REGRESS_POWERS][ALB_SH_REGRESS_VALUES] = {\n");
    for (int j = 0; j < POWERS; j++)
        for (int v = 0; v < VALUES; v++)
            alb_text_add(&text, "%s%.5ef,%s",
                         v % 10 ? " "
                         : v    ? "     "
                                : "    {",
                         (double)coefficients[j][v],
                         v + 1 == VALUES ? "},\n"
                         : v % 10 == 9   ? "\n"
                                         : "");
    alb_text_add(&text, "};\n");
    const bool ok = alb_file_write_text(path, &text, error);
    alb_text_free(&text);
    return ok;
}

static double norm(const double *a, const double *b)
{
    double sum = 0;
    for (int i = 0; i < COUNT; i++)
        sum += (a[i] - (b ? b[i] : 0)) * (a[i] - (b ? b[i] : 0));
    return sum / (4 * M_PI);
}

// rms errors of the laws at k and, behind them, the signal.
static bool measure(double rms[LAWS + 1], const alb_sh_law *laws, double k, alb_error *error)
{
    alb_sh_scaling m[LAWS];
    for (int i = 0; i < LAWS; i++) {
        rms[i] = 0;
        if (!alb_sh_law_at(&m[i], &laws[i], k, error))
            return false;
    }
    rms[LAWS] = 0;
    for (int s = 0; s < FRESH; s++) {
        const sphere_cluster cluster = sphere_cluster_random(2, (uint64_t)s);
        double four[COUNT], eight[64], truth[COUNT], found[COUNT];
        sphere_cluster_occlusion(four, ORDER, &cluster, sample_distance);
        sphere_cluster_occlusion(eight, 8, &cluster, sample_distance);
        sphere_cluster_occlusion(truth, ORDER, &cluster, sample_distance * k);
        for (int i = 0; i < LAWS; i++) {
            alb_sh_scaling_apply(found, &m[i], laws[i].order_in == 8 ? eight : four);
            rms[i] += norm(found, truth) / FRESH;
        }
        rms[LAWS] += norm(truth, NULL) / FRESH;
    }
    for (int i = 0; i <= LAWS; i++)
        rms[i] = sqrt(rms[i]);
    return true;
}

// Objects of another kind than the fit's: meshes, seen by rays.
enum { MESHES = 4, SIDES = 40, RINGS = 64, TURNS = 128 };
static const char *const mesh_names[MESHES] = {"animal", "animal in gallop", "plate", "vase"};

static bool make_mesh(alb_mesh *mesh, int which, alb_error *error)
{
    const alb_vector origin = {0, 0, 0};
    const double vase[][2] = {{0, 0}, {20, 0}, {35, 30}, {12, 70}, {22, 90}, {18, 90}, {9, 70}, {30, 30}, {0, 5}};
    switch (which) {
    case 0:
        return animal_add(mesh, origin, 4, 0, 0, error);
    case 1:
        return animal_gallop_add(mesh, origin, 4, 0.4, 0, error);
    case 2:
        return shape_sheet(mesh, origin, (alb_vector){60, 0, 0}, (alb_vector){0, 40, 0}, 1, 1, 0, error);
    default:
        return shape_lathe(mesh, vase, sizeof vase / sizeof *vase, origin, 4, 0, error);
    }
}

// The middle of the box around, and the distance of the farthest corner of a face from there.
static double bounding_sphere(alb_vector *centre, const alb_mesh *mesh)
{
    alb_vector low = mesh->vertices[0], high = low;
    double radius = 0;
    for (size_t i = 0; i < mesh->vertex_count; i++) {
        const alb_vector v = mesh->vertices[i];
        low = (alb_vector){fmin(low.x, v.x), fmin(low.y, v.y), fmin(low.z, v.z)};
        high = (alb_vector){fmax(high.x, v.x), fmax(high.y, v.y), fmax(high.z, v.z)};
    }
    *centre = alb_times(0.5, alb_add(low, high));
    for (size_t i = 0; i < mesh->vertex_count; i++)
        radius = fmax(radius, alb_length(alb_sub(mesh->vertices[i], *centre)));
    return radius;
}

// Occlusion at `distance` radii from the centre in direction -axis, in the frame (across, over, axis), by rays evenly
// in the cone that holds the bounding sphere.
static void mesh_occlusion(double coefficients[COUNT], const alb_tracer *tracer, alb_vector centre, double radius,
                           double distance, const alb_vector frame[3])
{
    const double far = distance * radius, open = 1 - sqrt(1 - 1 / (distance * distance));
    const alb_vector from = alb_sub(centre, alb_times(far, frame[2]));
    memset(coefficients, 0, COUNT * sizeof *coefficients);
    for (int i = 0; i < RINGS * TURNS; i++) {
        const double c = 1 - open * ((i / TURNS) + 0.5) / RINGS, s = sqrt(1 - c * c),
                     turn = 2 * M_PI * (i % TURNS + 0.5) / TURNS;
        const alb_vector local = {s * cos(turn), s * sin(turn), c};
        const alb_vector across = alb_add(alb_times(local.x, frame[0]), alb_times(local.y, frame[1]));
        const alb_vector ray = alb_add(across, alb_times(c, frame[2]));
        alb_hit hit;
        double values[COUNT];
        if (!alb_tracer_closest(&hit, tracer, from, ray))
            continue;
        alb_sh_evaluate(values, ORDER, local);
        for (int v = 0; v < COUNT; v++)
            coefficients[v] += 2 * M_PI * open / (RINGS * TURNS) * values[v];
    }
}

// An axis at random and two at right angles to it.
static void random_frame(alb_vector frame[3], uint64_t index)
{
    alb_random random = alb_random_at(3, 0, index);
    const double c = 2 * alb_random_uniform(&random) - 1, s = sqrt(1 - c * c),
                 turn = 2 * M_PI * alb_random_uniform(&random);
    frame[2] = (alb_vector){s * cos(turn), s * sin(turn), c};
    alb_tangents(&frame[0], &frame[1], frame[2]);
}

static bool measure_mesh(int which, alb_error *error)
{
    const alb_sh_law laws[3] = {{ALB_SH_LAW_VISIBILITY, ALB_SH_MAP_CONE, 45, 4, 4},
                                {ALB_SH_LAW_OCCLUSION, ALB_SH_MAP_CONE, 45, 4, 4},
                                {ALB_SH_LAW_REGRESSED, ALB_SH_MAP_CONE, 45, 4, 4}};
    static const double ratios[] = {1.3, 2, 4, 8, 100, 1000};
    alb_mesh mesh = {0};
    alb_tracer tracer = {0};
    alb_vector centre;
    bool ok = make_mesh(&mesh, which, error) && alb_tracer_create(&tracer, &mesh, error);
    const double radius = ok ? bounding_sphere(&centre, &mesh) : 1;
    for (size_t n = 0; n < sizeof ratios / sizeof *ratios && ok; n++) {
        double squares[SIDES][4] = {{0}}, rms[4] = {0};
        alb_sh_scaling m[3];
        for (int law = 0; law < 3 && ok; law++)
            ok = alb_sh_law_at(&m[law], &laws[law], ratios[n], error);
#pragma omp parallel for
        for (int side = 0; side < SIDES; side++) {
            alb_vector frame[3];
            double sample[COUNT], truth[COUNT], found[COUNT];
            random_frame(frame, (uint64_t)side);
            mesh_occlusion(sample, &tracer, centre, radius, sample_distance, frame);
            mesh_occlusion(truth, &tracer, centre, radius, sample_distance * ratios[n], frame);
            for (int law = 0; law < 3; law++) {
                alb_sh_scaling_apply(found, &m[law], sample);
                squares[side][law] = norm(found, truth);
            }
            squares[side][3] = norm(truth, NULL);
        }
        printf("%-18s %8g", n ? "" : mesh_names[which], ratios[n]);
        for (int i = 0; i < 4; i++) {
            for (int side = 0; side < SIDES; side++)
                rms[i] += squares[side][i] / SIDES;
            printf(" %12.3g", sqrt(rms[i]));
        }
        printf("\n");
    }
    alb_tracer_free(&tracer);
    alb_mesh_free(&mesh);
    return ok;
}

static bool measure_meshes(alb_error *error)
{
    printf("\n%-18s %8s %12s %12s %12s %12s\n", "meshes", "k", "as printed", "windowed", "regressed", "left out");
    for (int which = 0; which < MESHES; which++)
        if (!measure_mesh(which, error))
            return false;
    return true;
}

static bool chart(const char *path, alb_error *error)
{
    const alb_sh_law laws[LAWS] = {{ALB_SH_LAW_VISIBILITY, ALB_SH_MAP_CONE, 45, 4, 4},
                                   {ALB_SH_LAW_OCCLUSION, ALB_SH_MAP_CONE, 45, 4, 4},
                                   {ALB_SH_LAW_OCCLUSION, ALB_SH_MAP_CONE, 45, 4, 8},
                                   {ALB_SH_LAW_OCCLUSION, ALB_SH_MAP_SPHERE, 0, 4, 8},
                                   {ALB_SH_LAW_REGRESSED, ALB_SH_MAP_CONE, 45, 4, 4}};
    const char *const labels[LAWS + 1] = {"as printed",           "windowed",  "windowed, order 8 to 4",
                                          "sphere, order 8 to 4", "regressed", "the object left out"};
    double k[DISTANCES], curve[LAWS + 1][DISTANCES], rms[LAWS + 1];
    printf("%8s", "k");
    for (int i = 0; i <= LAWS; i++)
        printf(" %22s", labels[i]);
    const double named[] = {1.3, 2, 4, 8};
    for (int j = 0; j < DISTANCES + 4; j++) {
        const double at = j < 4 ? named[j] : 1.05 * pow(1000 / 1.05, (j - 4.) / (DISTANCES - 1));
        if (!measure(rms, laws, at, error))
            return false;
        printf("\n%8.3g", at);
        for (int i = 0; i <= LAWS; i++) {
            printf(" %22.3g", rms[i]);
            if (j >= 4)
                k[j - 4] = at, curve[i][j - 4] = rms[i];
        }
    }
    printf("\n");
    alb_curve curves[LAWS + 1];
    for (int i = 0; i <= LAWS; i++)
        curves[i] =
            (alb_curve){labels[i], NULL, k, curve[i], NULL, DISTANCES, i < LAWS ? ALB_MARK_LINE : ALB_MARK_DASHES};
    const alb_panel panel = {"Occlusion by clusters of spheres, scaled from one sample",
                             "distance over the sample's",
                             "rms error, order 4",
                             true,
                             true,
                             1e-7,
                             1,
                             curves,
                             LAWS + 1,
                             1};
    return !path || alb_plot_write(path, &panel, 1, 900, 520, error);
}

int main(int argc, char **argv)
{
    static float coefficients[POWERS][VALUES];
    alb_error error = {0};
    float off = 0;
    bool ok = fit(coefficients, &error);
    if (ok && argc > 3 && !strcmp(argv[2], "--write"))
        ok = write_data(coefficients, argv[3], &error);
    for (int j = 0; j < POWERS && ok; j++)
        for (int v = 0; v < VALUES; v++)
            off = fmaxf(off, fabsf(coefficients[j][v] - alb_sh_regress_coefficients[j][v]));
    if (ok)
        printf("refitted: coefficients differ from those of the library by %.1e at most\n", (double)off);
    if (!ok || !chart(argc > 1 ? argv[1] : NULL, &error) || !measure_meshes(&error)) {
        fprintf(stderr, "bench.sh_regress: %s\n", error.text);
        return error.status;
    }
    return 0;
}

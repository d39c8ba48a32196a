// Solvers of x = b + K x on small dense systems, against elimination and closed forms.
#include "base/random.h"
#include "check.h"
#include "render/radiosity_solver.h"

enum { N_MAX = 96 };

typedef struct dense {
    size_t n;
    double k[3][N_MAX][N_MAX], areas[N_MAX];
} dense;

static void apply(alb_rgb *out, const void *data, const alb_rgb *x)
{
    const dense *d = data;
    for (size_t i = 0; i < d->n; i++)
        for (int c = 0; c < 3; c++) {
            double sum = 0;
            for (size_t j = 0; j < d->n; j++)
                sum += d->k[c][i][j] * x[j][c];
            out[i][c] = sum;
        }
}

static void sweep(alb_rgb *x, const void *data, const alb_rgb *right)
{
    const dense *d = data;
    for (size_t i = 0; i < d->n; i++)
        for (int c = 0; c < 3; c++) {
            double sum = right[i][c];
            for (size_t j = 0; j < d->n; j++)
                sum += d->k[c][i][j] * x[j][c];
            x[i][c] = sum;
        }
}

static alb_bounce bounce_of(const dense *d)
{
    return (alb_bounce){.count = d->n, .areas_mm2 = d->areas, .data = d, .apply = apply, .sweep = sweep};
}

// Elimination with pivots: (I - K) x = right, one channel.
static void eliminate(double *x, const dense *d, int c, const alb_rgb *right)
{
    static double a[N_MAX][N_MAX + 1];
    const size_t n = d->n;
    for (size_t i = 0; i < n; i++) {
        for (size_t j = 0; j < n; j++)
            a[i][j] = (double)(i == j) - d->k[c][i][j];
        a[i][n] = right[i][c];
    }
    for (size_t k = 0; k < n; k++) {
        size_t pivot = k;
        for (size_t i = k; i < n; i++)
            pivot = fabs(a[i][k]) > fabs(a[pivot][k]) ? i : pivot;
        for (size_t j = 0; j <= n; j++) {
            const double swap = a[k][j];
            a[k][j] = a[pivot][j], a[pivot][j] = swap;
        }
        for (size_t i = k + 1; i < n; i++)
            for (size_t j = n + 1; j-- > k;)
                a[i][j] -= a[i][k] / a[k][k] * a[k][j];
    }
    for (size_t k = n; k-- > 0;) {
        x[k] = a[k][n];
        for (size_t j = k + 1; j < n; j++)
            x[k] -= a[k][j] * x[j];
        x[k] /= a[k][k];
    }
}

// S' times F with random reciprocal parts: A_i F_ij and A_i S'_ij symmetric, rows of F at most 1, of S' at most `most`.
static void fill_random(dense *d, size_t n, double most, uint64_t seed)
{
    static double f[N_MAX][N_MAX], s[N_MAX][N_MAX];
    d->n = n;
    for (size_t i = 0; i < n; i++) {
        alb_random random = alb_random_at(seed, 0, i);
        d->areas[i] = pow(10, 2 * alb_random_uniform(&random) - 1); // 100 : 1
    }
    for (int c = -1; c < 3; c++) { // F, then S' of each channel
        double(*m)[N_MAX] = c < 0 ? f : s, largest = 0;
        for (size_t i = 0; i < n; i++)
            for (size_t j = 0; j <= i; j++) {
                alb_random random = alb_random_at(seed, (uint64_t)(c + 2), i * n + j);
                const double u = alb_random_uniform(&random), shared = d->areas[i] * d->areas[j] * u * u * u;
                m[i][j] = shared / d->areas[i], m[j][i] = shared / d->areas[j];
            }
        for (size_t i = 0; i < n; i++) {
            double row = 0;
            for (size_t j = 0; j < n; j++)
                row += m[i][j];
            largest = fmax(largest, row);
        }
        for (size_t i = 0; i < n; i++)
            for (size_t j = 0; j < n; j++)
                m[i][j] *= (c < 0 ? 1 : most) / largest;
        for (size_t i = 0; c >= 0 && i < n; i++)
            for (size_t j = 0; j < n; j++) {
                d->k[c][i][j] = 0;
                for (size_t l = 0; l < n; l++)
                    d->k[c][i][j] += s[i][l] * f[l][j];
            }
    }
}

static void fill_light(alb_rgb *light, size_t n, uint64_t seed)
{
    for (size_t i = 0; i < n; i++) {
        alb_random random = alb_random_at(seed, 9, i);
        for (int c = 0; c < 3; c++)
            light[i][c] = alb_random_uniform(&random);
    }
}

static void solvers_agree_with_elimination(void **state)
{
    (void)state;
    static dense d;
    alb_rgb light[N_MAX], found[N_MAX];
    double expected[N_MAX];
    for (uint64_t trial = 0; trial < 4; trial++) {
        fill_random(&d, 7 + 29 * trial, 0.9, trial);
        fill_light(light, d.n, trial);
        const alb_bounce bounce = bounce_of(&d);
        for (int solver = 0; solver < ALB_SOLVER_TWO_LEVEL; solver++) {
            alb_error error = {0};
            alb_radiosity_report report;
            check_ok(alb_solver_run(found, &report, (alb_solver)solver, &bounce, (const alb_rgb *)light, NULL, 1e-11,
                                    &error),
                     &error);
            for (int c = 0; c < 3; c++) {
                eliminate(expected, &d, c, (const alb_rgb *)light);
                for (size_t i = 0; i < d.n; i++) // residual / (1 - 0.9), and areas of 1/10 weigh little in its norm
                    check_relative(found[i][c], expected[i], 1e-8);
            }
        }
    }
}

// On a spherical enclosure F = 1 w^T (w the shares of area), so that for any S' and E (Sherman-Morrison)
//     B = S'E + S'1 (w^T S'E) / (1 - w^T S'1)
static void any_scattering_on_a_sphere_is_exact(void **state)
{
    (void)state;
    enum { N = 60 };
    static dense d;
    static double s[3][N][N];
    alb_error error = {0};
    alb_radiosity_report report;
    alb_rgb light[N], first[N], rows[N], found[N];
    double all = 0;
    d.n = N;
    for (size_t i = 0; i < N; i++) {
        alb_random random = alb_random_at(22, 0, i);
        all += d.areas[i] = 0.01 + alb_random_uniform(&random);
    }
    fill_light(light, N, 23);
    for (int c = 0; c < 3; c++)
        for (size_t j = 0; j < N; j++) {
            alb_random random = alb_random_at(21, (uint64_t)c, j);
            const double albedo = 0.3 + 0.68 * alb_random_uniform(&random);
            double row = 0;
            for (size_t i = 0; i < N; i++)
                row += s[c][j][i] = pow(alb_random_uniform(&random), 4);
            rows[j][c] = first[j][c] = 0;
            for (size_t i = 0; i < N; i++) {
                s[c][j][i] *= albedo / row;
                rows[j][c] += s[c][j][i];
                first[j][c] += s[c][j][i] * light[i][c];
            }
            for (size_t i = 0; i < N; i++)
                d.k[c][j][i] = rows[j][c] * d.areas[i] / all;
        }
    const alb_bounce bounce = bounce_of(&d);
    for (int solver = 0; solver < ALB_SOLVER_TWO_LEVEL; solver++) {
        check_ok(
            alb_solver_run(found, &report, (alb_solver)solver, &bounce, (const alb_rgb *)first, NULL, 1e-12, &error),
            &error);
        for (int c = 0; c < 3; c++) {
            double lit = 0, kept = 0;
            for (size_t p = 0; p < N; p++) {
                lit += d.areas[p] / all * first[p][c];
                kept += d.areas[p] / all * rows[p][c];
            }
            for (size_t p = 0; p < N; p++)
                check_relative(found[p][c], first[p][c] + rows[p][c] * lit / (1 - kept), 1e-9);
        }
        if (solver == ALB_SOLVER_GMRES) // F has rank one: the space is exhausted after two products
            assert_true(report.iterations <= 4);
    }
}

// The residual in the report is that of the iterate before the last bounce: |K x - x + b| for x + residual = result, so
// that one more bounce changes the result by K times it at most.
static void residual_is_what_it_says(void **state)
{
    (void)state;
    static dense d;
    alb_rgb light[N_MAX], found[N_MAX], again[N_MAX];
    fill_random(&d, 80, 0.95, 3);
    fill_light(light, d.n, 3);
    const alb_bounce bounce = bounce_of(&d);
    // Jacobi with one product: x = b, r = K b, and out comes b + K b
    alb_error none = {0};
    alb_radiosity_report once;
    check_ok(alb_solver_run(found, &once, ALB_SOLVER_JACOBI, &bounce, (const alb_rgb *)light, NULL, 0.999, &none),
             &none);
    apply(again, &d, (const alb_rgb *)light);
    double bounced[3] = {0}, lit[3] = {0};
    for (size_t i = 0; i < d.n; i++)
        for (int c = 0; c < 3; c++) {
            check_relative(found[i][c], light[i][c] + again[i][c], 1e-14);
            bounced[c] += d.areas[i] * pow(again[i][c], 2);
            lit[c] += d.areas[i] * pow(light[i][c], 2);
        }
    check_relative(once.residual, sqrt(fmax(bounced[0] / lit[0], fmax(bounced[1] / lit[1], bounced[2] / lit[2]))),
                   1e-12);
    for (int solver = 0; solver < ALB_SOLVER_TWO_LEVEL; solver++) {
        alb_error error = {0};
        alb_radiosity_report report;
        check_ok(
            alb_solver_run(found, &report, (alb_solver)solver, &bounce, (const alb_rgb *)light, NULL, 1e-3, &error),
            &error);
        check_below(report.residual, 1.0000001e-3);
        assert_true(report.history[report.iterations - 1] == report.residual);
        apply(again, &d, (const alb_rgb *)found);
        double left[3] = {0}, all[3] = {0}, worst = 0;
        for (size_t i = 0; i < d.n; i++)
            for (int c = 0; c < 3; c++) {
                left[c] += d.areas[i] * pow(again[i][c] + light[i][c] - found[i][c], 2);
                all[c] += d.areas[i] * pow(light[i][c], 2);
            }
        for (int c = 0; c < 3; c++)
            worst = fmax(worst, sqrt(left[c] / all[c]));
        check_below(worst, report.residual + 1e-15); // K is self-adjoint here in all but S, and below 1
    }
}

// Facing plates have the eigenvalues +albedo and -albedo. Chebyshev iteration for I - K with eigenvalues taken to lie
// in [1 - albedo, 1 + 0.3 albedo] grows without end from an albedo of 0.8 on, which is why it is not a solver here.
static void chebyshev_interval(void **state)
{
    (void)state;
    static dense d = {.n = 2, .areas = {1, 1}};
    const alb_rgb light[2] = {{1, 1, 1}, {0, 0, 0}};
    for (int step = 0; step < 2; step++) {
        const double albedo = step ? 0.9 : 0.5, low = 1 - albedo, high = 1 + 0.3 * albedo;
        for (int c = 0; c < 3; c++)
            d.k[c][0][1] = d.k[c][1][0] = albedo;
        // Saad, Iterative Methods, algorithm 12.1
        const double theta = 0.5 * (high + low), delta = 0.5 * (high - low), sigma = theta / delta;
        double x[2] = {0}, r[2] = {1, 0}, direction[2] = {1 / theta, 0}, rho = 1 / sigma;
        for (int k = 0; k < 200; k++) {
            const double next = 1 / (2 * sigma - rho);
            x[0] += direction[0], x[1] += direction[1];
            r[0] = 1 + albedo * x[1] - x[0], r[1] = albedo * x[0] - x[1];
            for (int i = 0; i < 2; i++)
                direction[i] = next * rho * direction[i] + 2 * next / delta * r[i];
            rho = next;
        }
        if (step)
            assert_true(!(hypot(r[0], r[1]) < 1e3)); // grown
        else
            check_below(hypot(r[0], r[1]), 1e-6);
        const alb_bounce bounce = bounce_of(&d);
        for (int solver = 0; solver < ALB_SOLVER_TWO_LEVEL; solver++) {
            alb_error error = {0};
            alb_radiosity_report report;
            alb_rgb found[2];
            check_ok(alb_solver_run(found, &report, (alb_solver)solver, &bounce, light, NULL, 1e-9, &error), &error);
            check_relative(found[0][0], 1 / (1 - albedo * albedo), 1e-7);
            check_relative(found[1][2], albedo / (1 - albedo * albedo), 1e-7);
        }
    }
}

// As the albedo goes to 1 in a closed room, Jacobi's products go as 1 / (1 - albedo); what keeps the balance of energy
// does not notice.
static void albedo_to_one_closed(void **state)
{
    (void)state;
    enum { N = 64 };
    static dense d;
    alb_rgb light[N], found[N];
    fill_light(light, N, 5);
    const double albedos[] = {0.9, 0.99, 0.9999, 0.999999};
    for (int k = 0; k < 4; k++) {
        fill_random(&d, N, 1, 31);
        for (int c = 0; c < 3; c++)
            for (size_t i = 0; i < N; i++) { // rows of one sum: closed
                double row = 0;
                for (size_t j = 0; j < N; j++)
                    row += d.k[0][i][j];
                for (size_t j = 0; c == 2 && j < N; j++)
                    d.k[0][i][j] *= albedos[k] / row;
            }
        memcpy(d.k[1], d.k[0], sizeof d.k[0]);
        memcpy(d.k[2], d.k[0], sizeof d.k[0]);
        const alb_bounce bounce = bounce_of(&d);
        for (int solver = ALB_SOLVER_ENERGY_CORRECTED; solver < ALB_SOLVER_TWO_LEVEL; solver++) {
            alb_error error = {0};
            alb_radiosity_report report;
            check_ok(
                alb_solver_run(found, &report, (alb_solver)solver, &bounce, (const alb_rgb *)light, NULL, 1e-3, &error),
                &error);
            assert_in_range(report.iterations, 1, 12);
        }
        alb_error error = {0};
        alb_radiosity_report report;
        const bool ok =
            alb_solver_run(found, &report, ALB_SOLVER_JACOBI, &bounce, (const alb_rgb *)light, NULL, 1e-3, &error);
        if (k < 2)
            assert_in_range(report.iterations, k ? 100 : 10, k ? 500 : 70); // ln 1000 / (1 - albedo) less a part
        else
            check_fails(ok, &error, ALB_INTERNAL, "after 500 products of jacobi");
    }
}

static void starts_cost_one_product_and_never_harm(void **state)
{
    (void)state;
    static dense d;
    alb_rgb light[N_MAX], exact[N_MAX], start[N_MAX], found[N_MAX];
    alb_error error = {0};
    alb_radiosity_report report;
    fill_random(&d, N_MAX, 0.97, 11);
    fill_light(light, d.n, 11);
    const alb_bounce bounce = bounce_of(&d);
    check_ok(alb_solver_run(exact, &report, ALB_SOLVER_GMRES, &bounce, (const alb_rgb *)light, NULL, 1e-12, &error),
             &error);
    check_ok(alb_solver_run(found, &report, ALB_SOLVER_GMRES, &bounce, (const alb_rgb *)light, NULL, 1e-3, &error),
             &error);
    const int cold = report.iterations;
    for (int kind = 0; kind < 3; kind++) {
        for (size_t i = 0; i < d.n; i++)
            for (int c = 0; c < 3; c++)
                start[i][c] = kind == 0 ? exact[i][c] : kind == 1 ? 7 * (c + 1) * exact[i][c] : light[d.n - 1 - i][c];
        check_ok(alb_solver_run(found, &report, ALB_SOLVER_GMRES, &bounce, (const alb_rgb *)light,
                                (const alb_rgb *)start, 1e-3, &error),
                 &error);
        assert_in_range(report.iterations, 1, kind < 2 ? 1 : cold + 1);
        for (size_t i = 0; i < d.n; i++)
            check_relative(found[i][0], exact[i][0], 0.02);
    }
}

// Vectors, more than are taken at once, become orthonormal in the mean over area, and images under a map, here half the
// vector from back to front, stay that; one that lies in the span of those before becomes zero.
static void vectors_become_orthonormal(void **state)
{
    (void)state;
    enum { COUNT = ALB_SPACE_VECTORS + 5, ROWS = 80, TWICE = 9 };
    static alb_rgb vectors[COUNT][ROWS], images[COUNT][ROWS];
    alb_rgb *v[COUNT], *image[COUNT];
    double areas[ROWS], all = 0;
    alb_error error = {0};
    alb_space space;
    for (size_t i = 0; i < ROWS; i++) {
        alb_random random = alb_random_at(31, 0, i);
        all += areas[i] = 0.01 + alb_random_uniform(&random);
    }
    check_ok(alb_space_create(&space, areas, ROWS, &error), &error);
    for (int k = 0; k < COUNT; k++) {
        v[k] = vectors[k], image[k] = images[k];
        fill_light(vectors[k], ROWS, (uint64_t)(k == TWICE ? TWICE - 1 : k));
        for (size_t i = 0; i < ROWS; i++)
            for (int c = 0; c < 3; c++)
                images[k][i][c] = 0.5 * vectors[k][ROWS - 1 - i][c];
        alb_space_orthonormalise(&space, v, image, k, 1e-8);
        for (int j = 0; j <= k; j++)
            for (int c = 0; c < 3; c++) {
                double dot = 0;
                for (size_t i = 0; i < ROWS; i++)
                    dot += areas[i] / all * vectors[j][i][c] * vectors[k][i][c];
                check_near(dot, j == k && k != TWICE, 1e-13);
            }
        for (size_t i = 0; i < ROWS; i++)
            for (int c = 0; c < 3; c++)
                check_near(images[k][i][c], 0.5 * vectors[k][ROWS - 1 - i][c], 1e-11);
    }
    alb_space_free(&space);
}

static void empty(void **state)
{
    (void)state;
    static dense d;
    alb_rgb dark[1] = {{0}}, found[1] = {{5, 5, 5}};
    for (size_t n = 0; n < 2; n++) { // no patch; one, in the dark
        fill_random(&d, n, 0.5, 1);
        const alb_bounce bounce = bounce_of(&d);
        for (int solver = 0; solver < ALB_SOLVER_TWO_LEVEL; solver++) {
            alb_error error = {0};
            alb_radiosity_report report;
            check_ok(
                alb_solver_run(found, &report, (alb_solver)solver, &bounce, (const alb_rgb *)dark, NULL, 1e-3, &error),
                &error);
            assert_int_equal(report.iterations, 0);
            check_near(report.residual, 0, 0);
            if (n)
                check_near(found[0][1], 0, 0);
        }
    }
}

// A number that is none, anywhere in the light or in K and in one channel alone, is never taken for convergence: each
// solver ends at once and says so.
static void a_number_that_is_none_never_converges(void **state)
{
    (void)state;
    static dense d;
    for (uint64_t trial = 0; trial < 40; trial++)
        for (int solver = 0; solver < ALB_SOLVER_TWO_LEVEL; solver++) {
            alb_random random = alb_random_at(71, 0, trial);
            alb_rgb light[N_MAX], found[N_MAX];
            alb_error error = {0};
            alb_radiosity_report report;
            fill_random(&d, 5 + trial, 0.9, trial);
            fill_light(light, d.n, trial);
            const size_t i = (size_t)(alb_random_uniform(&random) * (double)d.n),
                         j = (size_t)(alb_random_uniform(&random) * (double)d.n);
            const int c = (int)(3 * alb_random_uniform(&random));
            const double none = trial % 4 < 2 ? (double)NAN : (double)INFINITY;
            char named[64] = "is not finite";
            if (trial % 2) {
                d.k[c][i][j] = none;
            } else {
                light[i][c] = none;
                snprintf(named, sizeof named, "patch %zu, channel %c", i, "RGB"[c]);
            }
            const alb_bounce bounce = bounce_of(&d);
            check_fails(
                alb_solver_run(found, &report, (alb_solver)solver, &bounce, (const alb_rgb *)light, NULL, 1e-3, &error),
                &error, ALB_BAD_DATA, named);
            assert_in_range(report.iterations, 1, 5);
        }
}

static void says_what_a_solver_lacks(void **state)
{
    (void)state;
    static dense d;
    alb_rgb light[8], found[8];
    alb_error error = {0};
    alb_radiosity_report report;
    fill_random(&d, 8, 0.5, 1);
    fill_light(light, 8, 1);
    alb_bounce bounce = bounce_of(&d);
    bounce.sweep = NULL;
    check_fails(
        alb_solver_run(found, &report, ALB_SOLVER_GAUSS_SEIDEL, &bounce, (const alb_rgb *)light, NULL, 1e-3, &error),
        &error, ALB_USAGE, "rows");
    check_fails(
        alb_solver_run(found, &report, ALB_SOLVER_TWO_LEVEL, &bounce, (const alb_rgb *)light, NULL, 1e-3, &error),
        &error, ALB_USAGE, "apart");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(solvers_agree_with_elimination),
        cmocka_unit_test(any_scattering_on_a_sphere_is_exact),
        cmocka_unit_test(residual_is_what_it_says),
        cmocka_unit_test(chebyshev_interval),
        cmocka_unit_test(albedo_to_one_closed),
        cmocka_unit_test(starts_cost_one_product_and_never_harm),
        cmocka_unit_test(vectors_become_orthonormal),
        cmocka_unit_test(empty),
        cmocka_unit_test(a_number_that_is_none_never_converges),
        cmocka_unit_test(says_what_a_solver_lacks),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

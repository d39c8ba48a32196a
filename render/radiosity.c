// Restarted GMRES (Saad & Schultz 1986) on (I - S'F) B = S'E + M, without a matrix, in the inner product weighted by
// area, the three channels in step: one product serves all, each has its own small least-squares problem.
//
// Convergence: ||S'F||_inf <= (largest row sum of S') (largest row sum of F) < 1 bounds the spectral radius; rows are
// what ray-cast factors hold exactly. (The bound rho(SF) <= rho(S) rho(F) of Sheng et al. 2014, sec. 3.3, is false in
// general.) Jacobi iteration would take ~150 products where GMRES takes 10 (albedo 0.99, residual 1e-3).
#include "render/radiosity.h"
#include "base/memory.h"
#include <stdlib.h>
#include <string.h>

enum { RESTART = 20, PRODUCTS_MAX = 500 };

typedef double rgb[3];

typedef struct solver {
    size_t n;
    const alb_scatter *scatter;
    const alb_form_factors *factors;
    const double *areas;
    double total_area;
    rgb *basis[RESTART + 1]; // orthonormal per channel
    rgb *gathered;
    double hessenberg[3][RESTART + 1][RESTART], cosine[3][RESTART], sine[3][RESTART], rhs[3][RESTART + 1];
} solver;

static void dot(double out[3], const solver *s, const rgb *a, const rgb *b)
{
    out[0] = out[1] = out[2] = 0;
    for (size_t i = 0; i < s->n; i++)
        for (int c = 0; c < 3; c++)
            out[c] += s->areas[i] / s->total_area * a[i][c] * b[i][c];
}

// a += factor b, per channel.
static void add(const solver *s, rgb *a, const double factor[3], const rgb *b)
{
    for (size_t i = 0; i < s->n; i++)
        for (int c = 0; c < 3; c++)
            a[i][c] += factor[c] * b[i][c];
}

static void norm(double out[3], const solver *s, const rgb *a)
{
    dot(out, s, a, a);
    for (int c = 0; c < 3; c++)
        out[c] = sqrt(out[c]);
}

// Divides each channel by its norm; a channel that has died out stays zero.
static void normalise(const solver *s, rgb *a, const double length[3])
{
    for (size_t i = 0; i < s->n; i++)
        for (int c = 0; c < 3; c++)
            a[i][c] = length[c] > 0 ? a[i][c] / length[c] : 0;
}

// out = (I - S'F) x
static void transport(const solver *s, rgb *out, const rgb *x)
{
    alb_form_factors_apply(s->gathered, s->factors, x);
    alb_scatter_apply(out, s->scatter, (const rgb *)s->gathered);
    for (size_t i = 0; i < s->n; i++)
        for (int c = 0; c < 3; c++)
            out[i][c] = x[i][c] - out[i][c];
}

// Givens rotations keep the Hessenberg matrix triangular; |rhs[k + 1]| is then the residual.
static void rotate(solver *s, int c, int k)
{
    double(*h)[RESTART] = s->hessenberg[c];
    for (int i = 0; i < k; i++) {
        const double upper = s->cosine[c][i] * h[i][k] + s->sine[c][i] * h[i + 1][k];
        h[i + 1][k] = s->cosine[c][i] * h[i + 1][k] - s->sine[c][i] * h[i][k];
        h[i][k] = upper;
    }
    const double length = hypot(h[k][k], h[k + 1][k]);
    s->cosine[c][k] = length > 0 ? h[k][k] / length : 1;
    s->sine[c][k] = length > 0 ? h[k + 1][k] / length : 0;
    h[k][k] = length;
    h[k + 1][k] = 0;
    s->rhs[c][k + 1] = -s->sine[c][k] * s->rhs[c][k];
    s->rhs[c][k] *= s->cosine[c][k];
}

// One Arnoldi step by modified Gram-Schmidt: basis[k + 1] and column k.
static void extend(solver *s, int k)
{
    rgb *next = s->basis[k + 1];
    double h[3], length[3], before[3];
    transport(s, next, (const rgb *)s->basis[k]);
    norm(before, s, (const rgb *)next);
    for (int i = 0; i <= k; i++) {
        dot(h, s, (const rgb *)next, (const rgb *)s->basis[i]);
        const double minus[3] = {-h[0], -h[1], -h[2]};
        add(s, next, minus, (const rgb *)s->basis[i]);
        for (int c = 0; c < 3; c++)
            s->hessenberg[c][i][k] = h[c];
    }
    norm(length, s, (const rgb *)next);
    for (int c = 0; c < 3; c++) {
        if (length[c] <= 1e-14 * before[c]) // the space is exhausted: what is left is rounding
            length[c] = 0;
        s->hessenberg[c][k + 1][k] = length[c];
    }
    normalise(s, next, length);
    for (int c = 0; c < 3; c++)
        rotate(s, c, k);
}

// x += sum_k y_k basis_k with the triangular system solved per channel.
static void update(const solver *s, rgb *x, int steps)
{
    double y[RESTART][3] = {{0}};
    for (int c = 0; c < 3; c++)
        for (int k = steps - 1; k >= 0; k--) {
            double rest = s->rhs[c][k];
            for (int i = k + 1; i < steps; i++)
                rest -= s->hessenberg[c][k][i] * y[i][c];
            const double pivot = s->hessenberg[c][k][k];
            y[k][c] = pivot != 0 ? rest / pivot : 0;
        }
    for (int k = 0; k < steps; k++)
        add(s, x, y[k], (const rgb *)s->basis[k]);
}

static double worst_of(const double values[3], const double scale[3])
{
    double worst = 0;
    for (int c = 0; c < 3; c++)
        if (scale[c] > 0)
            worst = fmax(worst, fabs(values[c]) / scale[c]);
    return worst;
}

static void iterate(solver *s, rgb *x, const rgb *right, alb_radiosity_report *report, double tolerance)
{
    double scale[3], length[3];
    norm(scale, s, right);
    for (*report = (alb_radiosity_report){0};;) {
        rgb *residual = s->basis[0];
        transport(s, residual, (const rgb *)x);
        report->iterations++;
        for (size_t i = 0; i < s->n; i++)
            for (int c = 0; c < 3; c++)
                residual[i][c] = right[i][c] - residual[i][c];
        norm(length, s, (const rgb *)residual);
        report->residual = worst_of(length, scale);
        if (report->residual <= tolerance || report->iterations >= PRODUCTS_MAX)
            return;
        normalise(s, residual, length);
        memset(s->rhs, 0, sizeof s->rhs);
        for (int c = 0; c < 3; c++)
            s->rhs[c][0] = length[c];
        int steps = 0;
        for (double worst = report->residual; steps < RESTART && worst > 0.9 * tolerance; report->iterations++) {
            extend(s, steps++);
            const double left[3] = {s->rhs[0][steps], s->rhs[1][steps], s->rhs[2][steps]};
            worst = worst_of(left, scale);
        }
        update(s, x, steps);
    }
}

bool alb_radiosity_solve(double (*radiosity)[3], alb_radiosity_report *report, const double (*irradiance)[3],
                         const double (*exitance)[3], const alb_scatter *scatter, const alb_form_factors *factors,
                         const double *areas_mm2, double residual, alb_error *error)
{
    bool ok = false;
    const size_t n = factors->patch_count;
    rgb *right = NULL;
    solver *s = alb_allocate(1, sizeof *s, error);
    if (!s)
        return false;
    s->n = n, s->scatter = scatter, s->factors = factors, s->areas = areas_mm2;
    for (size_t i = 0; i < n; i++)
        s->total_area += areas_mm2[i];
    for (int k = 0; k <= RESTART; k++)
        if (!(s->basis[k] = alb_allocate(n, sizeof(rgb), error)))
            goto done;
    if (!(s->gathered = alb_allocate(n, sizeof(rgb), error)) || !(right = alb_allocate(n, sizeof(rgb), error)))
        goto done;
    alb_scatter_apply(right, scatter, irradiance);
    for (size_t i = 0; i < n; i++)
        for (int c = 0; c < 3; c++)
            right[i][c] += exitance[i][c];
    memcpy(radiosity, right, n * sizeof *right);
    iterate(s, radiosity, (const rgb *)right, report, residual);
    ok = report->residual <= residual ||
         alb_fail(error, ALB_INTERNAL, "radiosity: residual %.3g after %d products, asked for %.3g", report->residual,
                  report->iterations, residual);
done:
    for (int k = 0; k <= RESTART; k++)
        free(s->basis[k]);
    free(s->gathered);
    free(s);
    free(right);
    return ok;
}

bool alb_radiosity_check(double *largest, const alb_scatter *scatter, bool closed_scene, const uint16_t *materials,
                         const alb_surface *surfaces, alb_error *error)
{
    static const char *const channels[3] = {"R", "G", "B"};
    const size_t n = scatter->patch_count;
    const rgb *sums = (const rgb *)scatter->row_sums;
    bool ok = true;
    size_t patch = 0;
    int channel = 0;
    for (size_t i = 0; i < n; i++)
        for (int c = 0; c < 3; c++)
            if (!(sums[i][c] <= sums[patch][channel]))
                patch = i, channel = c;
    if (n) {
        const double sum = sums[patch][channel], rounding = 1e-6; // weights are floats
        if (largest)
            *largest = sum;
        if (!(closed_scene ? sum < 1 - rounding : sum <= 1 + rounding))
            ok = alb_fail(
                error, ALB_BAD_DATA,
                "material '%s' creates light: patch %zu, channel %s sends out %.4f of what falls on it evenly (%s); "
                "the profile is too bright, or the body too thin for it",
                surfaces[materials[patch]].name, patch, channels[channel], sum,
                closed_scene ? "a closed scene needs less than 1" : "at most 1");
    }
    return ok;
}

// Restarted GMRES (Saad & Schultz 1986) on x = b + K x, the three channels in step: one product serves all, each has
// its own small least-squares problem. Per step
//     (K - I) v_k = sum_{i <= k+1} h_ik v_i,      x + sum y_k v_k with y the least |r + (K - I) sum y_k v_k|
// The v are orthonormal in the inner product weighted by area; classical Gram-Schmidt, again where it cancels (Kahan's
// criterion), so that all inner products of a step are one pass over memory.
#include "base/memory.h"
#include "render/radiosity_solver.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { RESTART = 20 };

typedef struct krylov {
    alb_rgb *v[RESTART + 1];
    double hessenberg[3][RESTART + 1][RESTART], cosine[3][RESTART], sine[3][RESTART], rhs[3][RESTART + 1];
} krylov;

// Givens rotations keep the Hessenberg matrix triangular; |rhs[k + 1]| is then the residual.
static void rotate(krylov *s, int c, int k)
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

// Divides each channel by its length; one that has died out becomes zero.
static void normalise(const alb_space *space, alb_rgb *a, const double length[3])
{
    double factor[3];
    for (int c = 0; c < 3; c++)
        factor[c] = length[c] > 0 ? 1 / length[c] : 0;
    alb_space_scale(space, a, factor);
}

// Takes from `a` its parts along v[0..k]; they add to column k. length: what is left of it.
static void orthogonalise(double length[3], krylov *s, const alb_space *space, alb_rgb *a, int k)
{
    double dots[RESTART + 1][3], before[3];
    for (int round = 0; round < 2; round++) {
        alb_rgb *all[RESTART + 2];
        memcpy(all, s->v, (size_t)(k + 1) * sizeof *all);
        all[k + 1] = a;
        double found[RESTART + 2][3];
        alb_space_dots(found, space, (const alb_rgb *)a, all, k + 2);
        for (int i = 0; i <= k; i++)
            for (int c = 0; c < 3; c++) {
                s->hessenberg[c][i][k] += found[i][c];
                dots[i][c] = -found[i][c];
            }
        for (int c = 0; c < 3; c++)
            before[c] = round ? before[c] : sqrt(found[k + 1][c]);
        alb_space_add(length, space, a, (const double(*)[3])dots, s->v, k + 1);
        bool cancelled = false;
        for (int c = 0; c < 3; c++)
            cancelled |= length[c] < 0.3 * before[c];
        if (!cancelled)
            break;
    }
    for (int c = 0; c < 3; c++)
        if (length[c] <= 1e-14 * before[c]) // the space is exhausted: what is left is rounding
            length[c] = 0;
}

// One step: column k and v[k + 1].
static void extend(alb_run *run, krylov *s, int k)
{
    static const double minus_one[1][3] = {{-1, -1, -1}};
    const alb_bounce *bounce = run->bounce;
    alb_rgb *next = s->v[k + 1];
    double length[3], left[3];
    bounce->apply(next, bounce->data, (const alb_rgb *)s->v[k]);
    alb_space_add(NULL, &run->space, next, minus_one, &s->v[k], 1);
    for (int c = 0; c < 3; c++)
        for (int i = 0; i <= k; i++)
            s->hessenberg[c][i][k] = 0;
    orthogonalise(length, s, &run->space, next, k);
    normalise(&run->space, next, length);
    for (int c = 0; c < 3; c++) {
        s->hessenberg[c][k + 1][k] = length[c];
        rotate(s, c, k);
        left[c] = s->rhs[c][k + 1];
    }
    alb_run_note(run, alb_run_worst(run, left));
}

// x += sum_k y_k v_k with the triangular system solved per channel.
static void update(alb_run *run, const krylov *s, int steps)
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
    alb_space_add(NULL, &run->space, run->x, (const double(*)[3])y, s->v, steps);
}

// r + (K - I) sum y_k v_k in the basis, which is what the rotations left over, turned back: the residual without a
// product.
static void take_residual(alb_run *run, const krylov *s, int steps)
{
    double along[RESTART + 1][3] = {{0}}, length[3];
    for (int c = 0; c < 3; c++) {
        along[steps][c] = -s->rhs[c][steps];
        for (int i = steps - 1; i >= 0; i--) {
            along[i][c] = -s->sine[c][i] * along[i + 1][c];
            along[i + 1][c] *= s->cosine[c][i];
        }
    }
    memset(run->residual, 0, run->space.count * sizeof *run->residual);
    alb_space_add(length, &run->space, run->residual, (const double(*)[3])along, s->v, steps + 1);
    alb_space_mean(run->report->residual_flux, &run->space, (const alb_rgb *)run->residual);
    alb_run_find_floor(run);
    run->report->residual = run->report->history[run->report->iterations - 1] = alb_run_worst(run, length);
}

static void restart(alb_run *run, krylov *s)
{
    double length[3];
    alb_space_norm(length, &run->space, (const alb_rgb *)run->residual);
    memcpy(s->v[0], run->residual, run->space.count * sizeof(alb_rgb));
    normalise(&run->space, s->v[0], length);
    memset(s->rhs, 0, sizeof s->rhs);
    for (int c = 0; c < 3; c++)
        s->rhs[c][0] = -length[c];
}

bool alb_run_gmres(alb_run *run, alb_error *error)
{
    const size_t n = run->space.count;
    alb_radiosity_report *report = run->report;
    bool ok = false, over = false;
    krylov *s = alb_allocate(1, sizeof *s, error);
    if (!s)
        return false;
    if (!(s->v[0] = alb_allocate(n, sizeof(alb_rgb), error)))
        goto done;
    while (!over) {
        int steps = 0;
        const double before = report->residual;
        restart(run, s);
        do {
            if (!s->v[steps + 1] && !(s->v[steps + 1] = alb_allocate(n, sizeof(alb_rgb), error)))
                goto done;
            extend(run, s, steps++);
        }
        // a hair below what is wanted: rounding must not cost a restart
        while (steps < RESTART && report->iterations < ALB_PRODUCTS_MAX - 1 &&
               report->history[report->iterations - 1] > 0.98 * run->wanted);
        update(run, s, steps);
        take_residual(run, s, steps);
        over = (report->residual <= run->wanted && run->wanted > 10 * run->floor) || alb_run_residual(run) ||
               (report->residual <= run->floor && report->residual > 0.5 * before);
    }
    ok = true;
done:
    for (int k = 0; k <= RESTART; k++)
        free(s->v[k]);
    free(s);
    return ok;
}

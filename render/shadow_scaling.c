// Each receiver's 30 values (70 from order 8) are interpolated between two knots; then all receivers are multiplied
// side by side:  out_lm += M_|m|,l,l' in_l'm,  44 multiplications at order 4.
#include "render/shadow_scaling.h"
#include "base/memory.h"
#include "base/vector_clones.h"
#include <stdlib.h>
#include <string.h>

enum { LANES = 16, VALUES_MAX = 204 }; // order 8 to 8

static double k_of_knot(const alb_sh_law *law, int knot)
{
    const double u = (double)knot / (ALB_SHADOW_KNOTS - 1);
    return law->map == ALB_SH_MAP_MIDRANGE ? 0.999 * u : u / (1 - u);
}

static bool create_table(alb_shadow_table *table, const alb_sh_law *law, alb_error *error)
{
    table->order_out = law->order_out;
    table->order_in = law->order_in;
    table->sky = law->map == ALB_SH_MAP_MIDRANGE;
    table->values = alb_sh_scaling_count(law->order_out, law->order_in);
    const size_t values = (size_t)table->values;
    bool ok = (table->knots = alb_allocate(ALB_SHADOW_KNOTS * values, sizeof *table->knots, error)) != NULL;
    // what vanishes far away is zero at the last knot, at infinity
    const bool fades = law->kind != ALB_SH_LAW_VISIBILITY;
    const int knots = ok ? ALB_SHADOW_KNOTS - fades : 0;
#pragma omp parallel for schedule(dynamic, 8) reduction(&& : ok)
    for (int n = 0; n < knots; n++) {
        alb_sh_scaling scaling;
        alb_error failure = {0};
        ok = alb_sh_law_at(&scaling, law, fmin(k_of_knot(law, n), 1e12), &failure);
        for (size_t v = 0; v < (ok ? values : 0); v++)
            table->knots[(size_t)n * values + v] = (float)scaling.value[v];
    }
    return ok ||
           alb_fail(error, ALB_INTERNAL, "a scaling law of order %d to %d has no table", law->order_in, law->order_out);
}

bool alb_shadow_scaling_create(alb_shadow_scaling *scaling, int order, bool paper, alb_error *error)
{
    const int out = ALB_SHADOW_ORDER;
    *scaling = (alb_shadow_scaling){.order = order};
    const alb_sh_law_kind far = paper ? ALB_SH_LAW_VISIBILITY : ALB_SH_LAW_OCCLUSION;
    const alb_sh_law outer = {far, ALB_SH_MAP_CONE, 45, out, order},
                     inner = {ALB_SH_LAW_VISIBILITY, ALB_SH_MAP_CONE, 45, out, order},
                     light = {ALB_SH_LAW_LIGHT, ALB_SH_MAP_CONE, 45, out, out},
                     sky = {ALB_SH_LAW_VISIBILITY, ALB_SH_MAP_MIDRANGE, 0, out, out},
                     wide = {ALB_SH_LAW_VISIBILITY, ALB_SH_MAP_MIDRANGE, 0, out, ALB_SH_ORDER_MAX};
    if (create_table(&scaling->outer, &outer, error) && create_table(&scaling->inner, &inner, error) &&
        create_table(&scaling->light, &light, error) && create_table(&scaling->sky[0], &sky, error) &&
        create_table(&scaling->sky[1], &wide, error))
        return true;
    alb_shadow_scaling_free(scaling);
    return false;
}

void alb_shadow_scaling_free(alb_shadow_scaling *scaling)
{
    free(scaling->outer.knots);
    free(scaling->inner.knots);
    free(scaling->light.knots);
    free(scaling->sky[0].knots);
    free(scaling->sky[1].knots);
    *scaling = (alb_shadow_scaling){0};
}

// The values of up to LANES receivers, side by side.
static void interpolate(float (*m)[LANES], const alb_shadow_table *table, const float *k, size_t lanes)
{
    const int values = table->values;
    for (size_t r = 0; r < lanes; r++) {
        const float u = table->sky ? k[r] / 0.999f : k[r] / (1 + k[r]), at = u * (ALB_SHADOW_KNOTS - 1);
        const int knot = at < ALB_SHADOW_KNOTS - 2 ? (int)at : ALB_SHADOW_KNOTS - 2;
        const float into = at - (float)knot, *low = table->knots + (size_t)knot * (size_t)values, *high = low + values;
        for (int v = 0; v < values; v++)
            m[v][r] = low[v] + into * (high[v] - low[v]);
    }
}

ALB_VECTOR_CLONES
static void multiply(float (*out)[LANES], const float (*m)[LANES], const float (*in)[LANES], int order_out,
                     int order_in, bool transposed)
{
    int v = 0;
    for (int order = 0; order < (order_out < order_in ? order_out : order_in); order++)
        for (int row = order; row < order_out; row++)
            for (int column = order; column < order_in; column++, v++) {
                const int to = transposed ? column : row, from = transposed ? row : column;
                for (int sign = -1; sign <= (order ? 1 : -1); sign += 2) {
                    const int i = to * (to + 1) + sign * order, j = from * (from + 1) + sign * order;
                    for (int r = 0; r < LANES; r++)
                        out[i][r] += m[v][r] * in[j][r];
                }
            }
}

void alb_shadow_scale(float *out, const alb_shadow_table *table, bool transposed, const float *in, const float *k,
                      size_t stride, size_t count)
{
    const int rows_in = transposed ? table->order_out : table->order_in,
              rows_out = transposed ? table->order_in : table->order_out;
    for (size_t first = 0; first < count; first += LANES) {
        const size_t some = count - first < LANES ? count - first : LANES;
        float m[VALUES_MAX][LANES], from[ALB_SH_COUNT_MAX][LANES], to[ALB_SH_COUNT_MAX][LANES];
        memset(to, 0, (size_t)(rows_out * rows_out) * sizeof *to);
        interpolate(m, table, k + first, some);
        for (int i = 0; i < rows_in * rows_in; i++)
            memcpy(from[i], in + (size_t)i * stride + first, some * sizeof(float));
        multiply(to, (const float(*)[LANES])m, (const float(*)[LANES])from, table->order_out, table->order_in,
                 transposed);
        for (int i = 0; i < rows_out * rows_out; i++)
            memcpy(out + (size_t)i * stride + first, to[i], some * sizeof(float));
    }
}

// Blocks of eight receivers: each takes its cell of the table, the values at its start and their rise, adds them up,
// eight values at a time; eight such vectors are turned over so that a vector holds one value of all eight; then the
// sparse product, eight wide.
#include "render/sh_scale_batch.h"
#include "base/memory.h"
#include "base/vector_clones.h"
#include "render/sh_lanes.h"
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

enum { LANES = 8, BLOCKS = 8, PADDED_MAX = 208 }; // order 8: 204
typedef float eight __attribute__((vector_size(LANES * sizeof(float))));
typedef int32_t eight_bits __attribute__((vector_size(LANES * sizeof(int32_t))));

static bool falls(const alb_sh_law *law)
{
    return law->kind == ALB_SH_LAW_LIGHT || law->kind == ALB_SH_LAW_OCCLUSION || law->kind == ALB_SH_LAW_REGRESSED;
}

// The value at knot i: the start of cell i, and the end of the cell before it.
static void store(alb_sh_batch *batch, int i, int v, float value)
{
    float *cell = batch->rows + (size_t)(2 * i * batch->padded + v);
    if (i > 0)
        cell[-batch->padded] = value - cell[-2 * batch->padded];
    if (i < batch->cells)
        *cell = value;
}

bool alb_sh_batch_create(alb_sh_batch *batch, const alb_sh_law *law, int cells, alb_error *error)
{
    const int count = alb_sh_scaling_count(law->order_out, law->order_in);
    *batch = (alb_sh_batch){.law = *law, .cells = cells, .padded = (count + LANES - 1) / LANES * LANES};
    if (cells < 8 || cells > 4096 || cells % 2 || law->order_out > ALB_SH_ORDER_MAX || law->order_in > ALB_SH_ORDER_MAX)
        return alb_fail(error, ALB_USAGE, "batch of %d cells, order %d to %d; expected 8 to 4096, even, order 1 to %d",
                        cells, law->order_in, law->order_out, ALB_SH_ORDER_MAX);
    batch->rows = alb_allocate((size_t)(2 * cells) * (size_t)batch->padded, sizeof *batch->rows, error);
    bool ok = batch->rows != NULL;
    for (int i = 0; i <= cells && ok; i++) {
        const double u = 2. * i / cells - 1;
        const double k = law->map == ALB_SH_MAP_MIDRANGE ? fmin(fmax(u, -1 + 1e-12), 1 - 1e-12)
                                                         : fmin(fmax((1 + u) / (1 - u), 1e-5), 1e5);
        alb_sh_scaling m;
        ok = alb_sh_law_at(&m, law, k, error);
        for (int v = 0; v < count && ok; v++)
            store(batch, i, v, (float)(m.value[v] * (falls(law) && k > 1 ? k * k : 1)));
    }
    if (!ok)
        alb_sh_batch_free(batch);
    return ok;
}

void alb_sh_batch_free(alb_sh_batch *batch)
{
    free(batch->rows);
    *batch = (alb_sh_batch){0};
}

// Eight vectors of eight values become eight vectors of eight receivers.
ALB_LANES_INLINE void turn_over(eight *out, const eight *in)
{
    eight pair[8], four[8];
    for (int i = 0; i < 4; i++) {
        pair[2 * i] = __builtin_shufflevector(in[2 * i], in[2 * i + 1], 0, 8, 1, 9, 4, 12, 5, 13);
        pair[2 * i + 1] = __builtin_shufflevector(in[2 * i], in[2 * i + 1], 2, 10, 3, 11, 6, 14, 7, 15);
    }
    for (int i = 0; i < 2; i++)
        for (int j = 0; j < 2; j++) {
            four[4 * i + 2 * j] =
                __builtin_shufflevector(pair[4 * i + j], pair[4 * i + 2 + j], 0, 1, 8, 9, 4, 5, 12, 13);
            four[4 * i + 2 * j + 1] =
                __builtin_shufflevector(pair[4 * i + j], pair[4 * i + 2 + j], 2, 3, 10, 11, 6, 7, 14, 15);
        }
    for (int i = 0; i < 4; i++) {
        out[i] = __builtin_shufflevector(four[i], four[4 + i], 0, 1, 2, 3, 8, 9, 10, 11);
        out[4 + i] = __builtin_shufflevector(four[i], four[4 + i], 4, 5, 6, 7, 12, 13, 14, 15);
    }
}

// Where a block's receivers stand in the table, and the factor that its rows leave out.
typedef struct places {
    eight_bits cell;
    eight share, factor; // NaN stays in `share`
} places;

// The smaller of two vectors, b where one is NaN.
#define SMALLER(a, b) ((eight)((((a) < (b)) & (eight_bits)(a)) | (~((a) < (b)) & (eight_bits)(b))))

ALB_LANES_INLINE void find_places(places *p, const alb_sh_batch *batch, const eight *ratio)
{
    const eight k = *ratio, zero = {0}, none = -zero, last = zero + (float)(batch->cells - 1);
    const float half = 0.5f * (float)batch->cells;
    eight at = half + half * k;
    if (batch->law.map != ALB_SH_MAP_MIDRANGE) {
        const eight back = -k;
        at = 2 * half - 2 * half / (1 - SMALLER(zero, back)); // 2 - 2/(1 + k) = 1 + u
    }
    const eight below = SMALLER(at, last), back = -below, held = -SMALLER(back, none);
    p->cell = __builtin_convertvector(held, eight_bits);
    const eight over = at - __builtin_convertvector(p->cell, eight), under = -over;
    const eight least = -SMALLER(zero, under), one = zero + 1;
    p->share = SMALLER(one, least);
    p->factor = one;
    if (falls(&batch->law)) {
        const eight away = -k, beyond = -one, most = SMALLER(beyond, away); // -max(1, k)
        p->factor = 1 / (most * most);
    }
}

ALB_LANES_INLINE void interpolate(eight *m, const alb_sh_batch *batch, const places *p, int padded)
{
    const float *rows[LANES];
    for (int r = 0; r < LANES; r++)
        rows[r] = batch->rows + (size_t)p->cell[r] * 2 * (size_t)padded;
#pragma GCC unroll 4
    for (int v = 0; v < padded; v += LANES) {
        eight row[LANES];
#pragma GCC unroll 8
        for (int r = 0; r < LANES; r++) {
            eight low, rise;
            memcpy(&low, rows[r] + v, sizeof low);
            memcpy(&rise, rows[r] + padded + v, sizeof rise);
            row[r] = low + p->share[r] * rise;
        }
        turn_over(m + v, row);
    }
}

// One block: coefficient i of its receivers at in + i * stride.
ALB_LANES_INLINE void multiply(float *out, size_t out_stride, const eight *value, const float *in, size_t in_stride,
                               const eight *factor, int rows, int columns, bool transposed)
{
#pragma GCC unroll 8
    for (int m = 0; m < rows; m++) {
#pragma GCC unroll 8
        for (int l = m; l < rows; l++) {
            eight plus = {0}, minus = {0};
#pragma GCC unroll 8
            for (int j = m; j < columns; j++) {
                const eight *own =
                    value + (transposed ? (j - m) * (rows - m) + l - m : (l - m) * (columns - m) + j - m);
                eight from;
                memcpy(&from, in + (size_t)(j * (j + 1) + m) * in_stride, sizeof from);
                plus += *own * from;
                memcpy(&from, in + (size_t)(j * (j + 1) - m) * in_stride, sizeof from);
                if (m)
                    minus += *own * from;
            }
            plus *= *factor, minus *= *factor;
            memcpy(out + (size_t)(l * (l + 1) + m) * out_stride, &plus, sizeof plus);
            if (m)
                memcpy(out + (size_t)(l * (l + 1) - m) * out_stride, &minus, sizeof minus);
        }
        value += m < columns ? (rows - m) * (columns - m) : 0;
    }
}

ALB_LANES_INLINE void apply_block(float *out, const eight *m, const eight *factor, const float *in, size_t stride,
                                  size_t items, int rows, int columns, bool transposed)
{
    eight from[ALB_SH_COUNT_MAX], to[ALB_SH_COUNT_MAX];
    if (items >= LANES) {
        multiply(out, stride, m, in, stride, factor, rows, columns, transposed);
        return;
    }
    memset(from, 0, sizeof from);
    for (int i = 0; i < columns * columns; i++)
        memcpy(&from[i], in + (size_t)i * stride, items * sizeof *in);
    multiply((float *)to, LANES, m, (const float *)from, LANES, factor, rows, columns, transposed);
    for (int i = 0; i < rows * rows; i++)
        memcpy(out + (size_t)i * stride, &to[i], items * sizeof *out);
}

ALB_LANES_INLINE void apply(float *out, const alb_sh_batch *batch, const float *k, const float *in, size_t stride,
                            size_t count, int rows, int columns, bool transposed, int padded)
{
    for (size_t first = 0; first < count; first += BLOCKS * LANES) {
        const size_t left = count - first < BLOCKS * LANES ? count - first : BLOCKS * LANES;
        eight m[PADDED_MAX], ratios[BLOCKS] = {{0}};
        places p[BLOCKS];
        memcpy(ratios, k + first, left * sizeof *k);
        for (int b = 0; b < BLOCKS; b++)
            find_places(&p[b], batch, &ratios[b]);
        for (size_t r = 0; r < left; r += LANES) {
            interpolate(m, batch, &p[r / LANES], padded);
            apply_block(out + first + r, m, &p[r / LANES].factor, in + first + r, stride, left - r, rows, columns,
                        transposed);
        }
    }
}

// Orders 4 and 8 to 4 apart, so that their loops have fixed bounds.
ALB_VECTOR_CLONES static void apply_four(float *out, const alb_sh_batch *batch, const float *k, const float *in,
                                         size_t stride, size_t count)
{
    apply(out, batch, k, in, stride, count, 4, 4, false, 32);
}

ALB_VECTOR_CLONES static void apply_eight_to_four(float *out, const alb_sh_batch *batch, const float *k,
                                                  const float *in, size_t stride, size_t count)
{
    apply(out, batch, k, in, stride, count, 4, 8, false, 72);
}

ALB_VECTOR_CLONES static void apply_any(float *out, const alb_sh_batch *batch, const float *k, const float *in,
                                        size_t stride, size_t count)
{
    apply(out, batch, k, in, stride, count, batch->law.order_out, batch->law.order_in, false, batch->padded);
}

ALB_VECTOR_CLONES static void apply_transposed(float *out, const alb_sh_batch *batch, const float *k, const float *in,
                                               size_t stride, size_t count)
{
    apply(out, batch, k, in, stride, count, batch->law.order_in, batch->law.order_out, true, batch->padded);
}

void alb_sh_batch_apply(float *out, const alb_sh_batch *batch, bool transposed, const float *k, const float *in,
                        size_t stride, size_t count)
{
    const alb_sh_law *law = &batch->law;
    if (transposed)
        apply_transposed(out, batch, k, in, stride, count);
    else if (law->order_out == 4 && law->order_in == 4)
        apply_four(out, batch, k, in, stride, count);
    else if (law->order_out == 4 && law->order_in == 8)
        apply_eight_to_four(out, batch, k, in, stride, count);
    else
        apply_any(out, batch, k, in, stride, count);
}

// c_i(b) = (W e^(-b r))_i / sd_i and its derivatives by x = ln b.
//
// A reading is share_i e^(-b rho_i(x)), rho_i its effective distance (basis.c). With t = b (rho + rho') and
// s = b (rho + 2 rho' + rho''):   dc/dx = -t c,   d2c/dx2 = (t^2 - s) c.
//
// e^x = 2^k e^y, |y| <= ln(2) / 2, by the Taylor series of degree 12 (remainder 2e-16): four at a time, and the same
// bytes on any machine. Sums are taken in four lanes and a fixed order.
#include "fit/columns.h"
#include "base/vector_clones.h"
#include <math.h>
#include <string.h>

enum { LANES = ALB_LANES };
typedef double lanes __attribute__((vector_size(32), aligned(8), may_alias));
typedef long long whole __attribute__((vector_size(32)));

// 1.5 * 2^52: what is added to it keeps its nearest integer in the low bits.
#define ROUNDER 6755399441055744.0
#define SPLAT(v) ((lanes){(v), (v), (v), (v)})
#define SUM(v) (((v)[0] + (v)[2]) + ((v)[1] + (v)[3]))

static inline __attribute__((always_inline)) void exponentiate(lanes *v)
{
    lanes x = *v;
    const whole low = x < SPLAT(-300.0);
    x = (lanes)(((whole)SPLAT(-300.0) & low) | ((whole)x & ~low));
    const lanes shifted = x * SPLAT(M_LOG2E) + SPLAT(ROUNDER), k = shifted - SPLAT(ROUNDER);
    // ln 2 in two parts, the first short enough for k times it to be exact
    const lanes y = (x - k * SPLAT(0x1.62e42fee00000p-1)) - k * SPLAT(0x1.a39ef35793c76p-33);
    const lanes y2 = y * y, y4 = y2 * y2;
    const lanes p0 = (SPLAT(1.0 / 6) * y + SPLAT(0.5)) * y2 + (y + SPLAT(1.0));
    const lanes p4 = (SPLAT(1.0 / 5040) * y + SPLAT(1.0 / 720)) * y2 + (SPLAT(1.0 / 120) * y + SPLAT(1.0 / 24));
    const lanes p8 = (SPLAT(1.0 / 39916800) * y + SPLAT(1.0 / 3628800)) * y2 +
                     (SPLAT(1.0 / 362880) * y + SPLAT(1.0 / 40320)) + SPLAT(1.0 / 479001600) * y4;
    const lanes sum = p0 + y4 * (p4 + y4 * p8);
    *v = (lanes)((whole)sum + ((whole)shifted << 52));
}

ALB_VECTOR_CLONES
void alb_columns_exp(double *x, int rows)
{
    for (int i = 0; i + LANES <= rows; i += LANES)
        exponentiate((lanes *)(x + i));
    lanes rest = SPLAT(0.0);
    const int done = rows / LANES * LANES;
    for (int i = done; i < rows; i++)
        rest[i - done] = x[i];
    exponentiate(&rest);
    for (int i = done; i < rows; i++)
        x[i] = rest[i - done];
}

// distance: rho, rho + rho', rho + 2 rho' + rho''.
ALB_VECTOR_CLONES
static void fill(alb_term *term, const alb_whitened *whitened, double b, const double *const distance[3])
{
    const int rows = whitened->basis->rows;
    const lanes decay = SPLAT(-b);
    lanes cc = SPLAT(0.0), cf = SPLAT(0.0), ff = SPLAT(0.0), cv = SPLAT(0.0);
    for (int i = 0; i < rows; i += LANES) {
        lanes c = decay * *(const lanes *)(distance[0] + i);
        const lanes t = decay * *(const lanes *)(distance[1] + i), s = decay * *(const lanes *)(distance[2] + i);
        exponentiate(&c);
        c *= *(const lanes *)(whitened->weight + i);
        const lanes f = t * c;
        *(lanes *)(term->column + i) = c;
        *(lanes *)(term->first + i) = f;
        *(lanes *)(term->second + i) = t * f + s * c;
        cc += c * c;
        cf += c * f;
        ff += f * f;
        cv += c * *(const lanes *)(whitened->value + i);
    }
    term->cc = SUM(cc);
    term->cf = SUM(cf);
    term->ff = SUM(ff);
    term->cv = SUM(cv);
}

void alb_term_evaluate(alb_term *term, const alb_whitened *whitened, double ln_decay, double *work)
{
    const alb_basis *basis = whitened->basis;
    const int rows = basis->rows, n = basis->count;
    if (basis->slope)
        alb_basis_distances(work, basis, ln_decay);
    const double *const plain[3] = {basis->distance, basis->distance, basis->distance};
    const double *const read[3] = {work, work + rows, work + 2 * rows};
    fill(term, whitened, exp(ln_decay), basis->slope ? read : plain);
    if (whitened->energy) {
        const double c = alb_columns_dot(whitened->energy, term->column, rows);
        const double f = alb_columns_dot(whitened->energy, term->first, rows);
        term->second[n] = alb_columns_dot(whitened->energy, term->second, rows);
        term->column[n] = c;
        term->first[n] = f;
        term->cc += c * c;
        term->cf += c * f;
        term->ff += f * f;
        term->cv += c * whitened->value[n];
    }
}

ALB_VECTOR_CLONES
void alb_term_products(double out[4], const alb_term *x, const alb_term *y, int rows)
{
    lanes cc = SPLAT(0.0), cf = SPLAT(0.0), fc = SPLAT(0.0), ff = SPLAT(0.0);
    for (int i = 0; i < rows; i += LANES) {
        const lanes xc = *(const lanes *)(x->column + i), xf = *(const lanes *)(x->first + i);
        const lanes yc = *(const lanes *)(y->column + i), yf = *(const lanes *)(y->first + i);
        cc += xc * yc;
        cf += xc * yf;
        fc += xf * yc;
        ff += xf * yf;
    }
    out[0] = SUM(cc);
    out[1] = SUM(cf);
    out[2] = SUM(fc);
    out[3] = SUM(ff);
}

ALB_VECTOR_CLONES
double alb_term_residual(double *residual, double (*products)[3], const alb_whitened *whitened, const alb_term *terms,
                         const double *amplitude, int count)
{
    const int rows = whitened->basis->rows;
    memcpy(residual, whitened->value, (size_t)rows * sizeof *residual);
    lanes squares = SPLAT(0.0);
    for (int t = 0; t < count; t++) {
        const lanes a = SPLAT(amplitude[t]);
        for (int i = 0; i < rows; i += LANES)
            *(lanes *)(residual + i) -= a * *(const lanes *)(terms[t].column + i);
    }
    for (int i = 0; i < rows; i += LANES)
        squares += *(lanes *)(residual + i) * *(lanes *)(residual + i);
    for (int t = 0; t < count; t++) {
        lanes c = SPLAT(0.0), f = SPLAT(0.0), s = SPLAT(0.0);
        for (int i = 0; i < rows; i += LANES) {
            const lanes r = *(const lanes *)(residual + i);
            c += r * *(const lanes *)(terms[t].column + i);
            f += r * *(const lanes *)(terms[t].first + i);
            s += r * *(const lanes *)(terms[t].second + i);
        }
        products[t][0] = SUM(c);
        products[t][1] = SUM(f);
        products[t][2] = SUM(s);
    }
    return SUM(squares);
}

ALB_VECTOR_CLONES
double alb_columns_dot(const double *x, const double *y, int rows)
{
    lanes even = SPLAT(0.0), odd = SPLAT(0.0);
    int i = 0;
    for (; i + LANES < rows; i += 2 * LANES) {
        even += *(const lanes *)(x + i) * *(const lanes *)(y + i);
        odd += *(const lanes *)(x + i + LANES) * *(const lanes *)(y + i + LANES);
    }
    if (i < rows)
        even += *(const lanes *)(x + i) * *(const lanes *)(y + i);
    even += odd;
    return SUM(even);
}

// Four columns at a time against one.
ALB_VECTOR_CLONES
void alb_columns_gram(double *gram, const double *const *columns, int count, int rows)
{
    for (int i = 0; i < count; i++)
        for (int j = i; j < count; j += 4) {
            const double *x = columns[i], *y[4];
            for (int k = 0; k < 4; k++)
                y[k] = columns[j + k < count ? j + k : count - 1];
            lanes s0 = SPLAT(0.0), s1 = SPLAT(0.0), s2 = SPLAT(0.0), s3 = SPLAT(0.0);
            for (int r = 0; r < rows; r += LANES) {
                const lanes v = *(const lanes *)(x + r);
                s0 += v * *(const lanes *)(y[0] + r);
                s1 += v * *(const lanes *)(y[1] + r);
                s2 += v * *(const lanes *)(y[2] + r);
                s3 += v * *(const lanes *)(y[3] + r);
            }
            const double sums[4] = {SUM(s0), SUM(s1), SUM(s2), SUM(s3)};
            for (int k = 0; k < 4 && j + k < count; k++)
                gram[i * count + j + k] = sums[k];
        }
}

// S(r) = S1(r) + 1 / (2 pi) integral (S^(k) - S1^(k)) J0(k r) k dk,
//
// S^ by harmonics (fit/harmonics.c), S1 the light that scatters once: exact in r here, and by the same harmonics in k,
// so that what they do not resolve of it (the 1/r at the beam) cancels. With sigma = sigma_a + sigma_s', S^ is the mean
// of the orders 9 and 11 below k = 1.5 sigma, of 7 and 9 above, changed smoothly (erfc: nothing of it is seen at r); ln
// S^ is a cubic spline in asinh(k / k0) up to 5 sigma, k0 the decay of the far field, and beyond a cubic in ln k.
//
// Far from the beam high frequencies only carry the rounding of the harmonics: they are cut by exp(-(k r / 80)^8),
// which changes S where it is a power of r or an exponential by less than 1e-5.
//
// Light that scatters once: from depth z to the lit face after s turns at faces, straight on along the angle theta when
// the slab is unfolded to the height Z = r / tan(theta) in s d .. (s + 1) d, and of the folded beam's flux E(z)
//     S1(r) = sigma_s / r sum_s integral E(z) p(cos) (1 - F) F^s e^(-sigma_t r / sin theta) cos theta dtheta,
// up to the critical angle. The far face's is the same with the slab turned over.
#include "fit/slab.h"
#include "fit/fresnel.h"
#include <math.h>

enum { NODES = 48, KNOTS = ALB_SLAB_KNOTS, GAUSS = 8, PIECES = 4, SEGMENTS_MAX = 60, ORDERS = 3 };
static const double blend_k = 1.5, blend_width = 0.6, last_k = 5, tail_from = 0.4, cut = 80, floor_share = 1e-8;

// Gauss and Legendre's 8 points on -1..1.
static const double gauss_x[GAUSS] = {-0.9602898564975363, -0.7966664774136267, -0.5255324099163290,
                                      -0.1834346424956498, 0.1834346424956498,  0.5255324099163290,
                                      0.7966664774136267,  0.9602898564975363};
static const double gauss_w[GAUSS] = {0.1012285362903763, 0.2223810344533745, 0.3137066458778873, 0.3626837833783620,
                                      0.3626837833783620, 0.3137066458778873, 0.2223810344533745, 0.1012285362903763};

// Second derivatives (times the spacing squared) of the cubic spline through y[0..n) with the slope y'[0] = slope and
// no bend at the end.
static void spline_prepare(double *bend, const double *y, double slope, int n)
{
    double ratio[KNOTS];
    ratio[0] = 0.5;
    bend[0] = 3 * (y[1] - y[0] - slope);
    for (int i = 1; i < n - 1; i++) {
        const double pivot = 4 - ratio[i - 1];
        ratio[i] = 1 / pivot;
        bend[i] = (6 * (y[i + 1] - 2 * y[i] + y[i - 1]) - bend[i - 1]) / pivot;
    }
    bend[n - 1] = 0;
    for (int i = n - 2; i >= 0; i--)
        bend[i] -= ratio[i] * bend[i + 1];
}

static double spline_value(const double *y, const double *bend, int n, double x)
{
    const int i = x < 0 ? 0 : x < n - 2 ? (int)x : n - 2;
    const double b = x - i, a = 1 - b;
    return a * y[i] + b * y[i + 1] + ((a * a * a - a) * bend[i] + (b * b * b - b) * bend[i + 1]) / 6;
}

// ln of the transform of the light that scatters more than once, at k = k0 sinh(i step).
typedef struct spectrum {
    double k0, last, step;
    int count[ALB_SIDES]; // nodes above the floor
    double ln_value[ALB_SIDES][NODES], bend[ALB_SIDES][NODES], tail[ALB_SIDES][4];
} spectrum;

typedef struct order_modes {
    alb_harmonic_modes all, once;
} order_modes;

static void prepare_order(order_modes *modes, const alb_slab *slab, int order)
{
    const alb_scaled_slab scaled = alb_slab_scale(slab, order);
    alb_harmonic_modes_prepare(&modes->all, &scaled, false);
    alb_harmonic_modes_prepare(&modes->once, &scaled, true);
}

// Adds `weight` of one order's transform to all[side] and of that without the light that scatters once to more[side].
static void add_order(double all[ALB_SIDES], double more[ALB_SIDES], const order_modes *modes,
                      const alb_harmonic_faces *faces, double k, double weight)
{
    double whole[ALB_SIDES], once[ALB_SIDES];
    if (weight < 1e-9)
        return;
    alb_harmonic_modes_leaving(whole, &modes->all, faces, k);
    alb_harmonic_modes_leaving(once, &modes->once, faces, k);
    for (int side = 0; side < ALB_SIDES; side++) {
        all[side] += weight * whole[side];
        more[side] += weight * (whole[side] - once[side]);
    }
}

// Solves the 4 x 4 normal equations of a cubic through ln S^ by ln(k / last) in place.
static void fit_tail(double tail[4], const spectrum *s, int side)
{
    double a[4][5] = {{0}};
    for (int i = 0; i < NODES; i++) {
        const double share = s->k0 * sinh(i * s->step) / s->last, x = log(share);
        if (share <= tail_from)
            continue;
        const double powers[4] = {1, x, x * x, x * x * x};
        for (int p = 0; p < 4; p++) {
            for (int q = 0; q < 4; q++)
                a[p][q] += powers[p] * powers[q];
            a[p][4] += powers[p] * s->ln_value[side][i];
        }
    }
    for (int p = 0; p < 4; p++) // positive definite: no pivoting
        for (int i = 0; i < 4; i++)
            for (int j = 4; i != p && j >= p; j--)
                a[i][j] -= a[i][p] / a[p][p] * a[p][j];
    for (int p = 0; p < 4; p++)
        tail[p] = a[p][4] / a[p][p];
}

static void spectrum_prepare(spectrum *s, double total[ALB_SIDES], const alb_slab *slab)
{
    const double reduced = slab->scattering_per_mm * (1 - slab->anisotropy);
    const double sigma = slab->absorption_per_mm + reduced;
    *s = (spectrum){.last = last_k * sigma};
    s->k0 = hypot(sqrt(3 * slab->absorption_per_mm * sigma), M_PI / (slab->thickness_mm + 4 / sigma));
    s->step = asinh(s->last / s->k0) / (NODES - 1);
    alb_harmonic_faces faces;
    order_modes modes[ORDERS];
    alb_harmonic_faces_prepare(&faces, slab->refractive_index);
    for (int i = 0; i < ORDERS; i++)
        prepare_order(&modes[i], slab, 7 + 2 * i);
    double all[NODES][ALB_SIDES] = {{0}}, more[NODES][ALB_SIDES] = {{0}};
#pragma omp parallel for schedule(dynamic)
    for (int i = 0; i < NODES; i++) {
        const double k = s->k0 * sinh(i * s->step);
        const double low = 0.5 * erfc((k / sigma - blend_k) / blend_width), weights[ORDERS] = {1 - low, 1, low};
        for (int order = 0; order < ORDERS; order++)
            add_order(all[i], more[i], &modes[order], &faces, k, 0.5 * weights[order]);
    }
    for (int side = 0; side < ALB_SIDES; side++) {
        total[side] = all[0][side];
        int n = 0;
        for (; n < NODES && more[n][side] > floor_share * more[0][side]; n++)
            s->ln_value[side][n] = log(more[n][side]);
        s->count[side] = n;
        if (n >= 3)
            spline_prepare(s->bend[side], s->ln_value[side], 0, n);
        if (n == NODES)
            fit_tail(s->tail[side], s, side);
    }
}

static double spectrum_value(const spectrum *s, int side, double k)
{
    const double x = asinh(k / s->k0) / s->step, share = k / s->last;
    const int n = s->count[side];
    if (n < 3 || (n < NODES && x > n - 1))
        return 0;
    const double inside = share < 1 ? exp(spline_value(s->ln_value[side], s->bend[side], n, x)) : 0;
    if (n < NODES || share < 0.4)
        return inside;
    const double y = log(share), *tail = s->tail[side], w = share < 1 ? 0.5 * erfc((share - 0.7) / 0.07) : 0;
    return w * inside + (1 - w) * exp(tail[0] + y * (tail[1] + y * (tail[2] + y * tail[3])));
}

// Panels of at most three radians of J0 and six tenths of the spectrum's scale.
static void more_than_once(double value[ALB_SIDES], const spectrum *s, double r)
{
    const double window = fmin(2.5 * s->last, cut / r), end = 1.5 * window;
    double sum[ALB_SIDES] = {0};
    for (double k = 0; k < end;) {
        const double half = 0.5 * fmin(fmin(3 / r, 0.6 * hypot(k, s->k0)), end - k);
        for (int i = 0; i < GAUSS; i++) {
            const double at = k + half * (1 + gauss_x[i]);
            const double weight = gauss_w[i] * half * at * j0(at * r) * exp(-pow(at / window, 8));
            for (int side = 0; side < ALB_SIDES; side++)
                sum[side] += weight * spectrum_value(s, side, at);
        }
        k += 2 * half;
    }
    for (int side = 0; side < ALB_SIDES; side++)
        value[side] = sum[side] / (2 * M_PI);
}

// p(cosine) and p(-cosine) of the scaled slab, 1/sr.
static void phase(double *forward, double *backward, const alb_scaled_slab *slab, double cosine)
{
    double before = 0, here = 1, part[2] = {0};
    for (int l = 0; l <= slab->order; l++) {
        part[l % 2] += (2 * l + 1) * slab->moments[l] * here;
        const double next = ((2 * l + 1) * cosine * here - l * before) / (l + 1);
        before = here, here = next;
    }
    *forward = (part[0] + part[1]) / (4 * M_PI);
    *backward = (part[0] - part[1]) / (4 * M_PI);
}

// Light that scatters once, goes s times from face to face and leaves r away. theta = from - width x^2 takes the square
// root that 1 - F has at the critical angle.
static void add_segment(double value[ALB_SIDES], const alb_scaled_slab *slab, double n, double r, int s)
{
    const alb_folded_beam *beam = &slab->beam;
    const double d = beam->thickness, sigma = beam->extinction;
    const double from = fmin(asin(fmin(1, 1 / n)), atan2(r, s * d)), width = from - atan2(r, (s + 1) * d);
    for (int i = 0; width > 0 && i < GAUSS * PIECES; i++) {
        const double x = (i / GAUSS + 0.5 * (1 + gauss_x[i % GAUSS])) / PIECES;
        const double theta = from - width * x * x, cosine = cos(theta), f = alb_fresnel_inside(n, cosine);
        const double weight = gauss_w[i % GAUSS] / PIECES * width * x * slab->scattering_per_mm / r * cosine * (1 - f) *
                              pow(f, s) * exp(-sigma * r / sin(theta));
        const double height = r / tan(theta), z = s % 2 ? (s + 1) * d - height : height - s * d;
        double towards, away; // the far face, from where the beam goes
        phase(&towards, &away, slab, s % 2 ? cosine : -cosine);
        const double near = exp(-sigma * z), far = exp(-sigma * (d - z));
        value[0] += weight * (beam->down * near * towards + beam->up * far * away);
        value[1] += weight * (beam->down * far * away + beam->up * near * towards);
    }
}

static void once(double value[ALB_SIDES], const alb_scaled_slab *slab, double n, double r)
{
    const double tau = slab->beam.extinction * slab->beam.thickness;
    value[0] = value[1] = 0;
    for (int s = 0; s < SEGMENTS_MAX && s * tau < 20; s++)
        add_segment(value, slab, n, r, s);
}

bool alb_slab_light_create(alb_slab_light *light, const alb_slab *slab, double end_mm, alb_error *error)
{
    const double reduced = slab->scattering_per_mm * (1 - slab->anisotropy);
    const double sigma = slab->absorption_per_mm + reduced, n = slab->refractive_index;
    if (!(slab->absorption_per_mm > 0 && slab->scattering_per_mm > 0 && slab->anisotropy >= 0 &&
          slab->anisotropy <= 0.95 && n >= 1 && n <= 3 && slab->thickness_mm > 0 && end_mm > 0 &&
          isfinite(sigma * slab->thickness_mm) && isfinite(sigma * end_mm)))
        return alb_fail(error, ALB_BAD_DATA,
                        "not a slab whose light can be computed: sigma_a %g, sigma_s %g per mm, g %g, index %g, %g mm",
                        slab->absorption_per_mm, slab->scattering_per_mm, slab->anisotropy, n, slab->thickness_mm);
    spectrum s;
    const alb_scaled_slab scaled = alb_slab_scale(slab, 9);
    *light = (alb_slab_light){.first_mm = fmin(2e-3 / sigma, 1e-3 * end_mm), .end_mm = end_mm};
    spectrum_prepare(&s, light->total, slab);
    light->knots_per_ln = (KNOTS - 1) / log(end_mm / light->first_mm);
#pragma omp parallel for schedule(dynamic)
    for (int i = 0; i < KNOTS; i++) {
        double single[ALB_SIDES], more[ALB_SIDES];
        const double r = light->first_mm * exp(i / light->knots_per_ln);
        once(single, &scaled, n, r);
        more_than_once(more, &s, r);
        for (int side = 0; side < ALB_SIDES; side++)
            light->ln_value[side][i] = log(fmax(single[side] + more[side], 1e-12 * light->total[side] * sigma * sigma));
    }
    for (int side = 0; side < ALB_SIDES; side++) {
        light->unscattered[side] = scaled.beam.leaving[side];
        spline_prepare(light->ln_bend[side], light->ln_value[side], light->ln_value[side][1] - light->ln_value[side][0],
                       KNOTS);
    }
    return true;
}

double alb_slab_light_value(const alb_slab_light *light, alb_side side, double r_mm)
{
    const double r = fmin(fmax(r_mm, light->first_mm), light->end_mm);
    const double x = log(r / light->first_mm) * light->knots_per_ln;
    return exp(spline_value(light->ln_value[side], light->ln_bend[side], KNOTS, x));
}

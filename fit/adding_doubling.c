// Adding-doubling (van de Hulst 1980; Prahl, van Gemert & Welch 1993, Appl. Opt. 32, 559), in a form that keeps every
// matrix symmetric. Radiances I of N cosines mu with weights w a hemisphere, scaled to v = sqrt(mu w) I, obey
//   d(v+ + v-)/dz = -O (v+ - v-),   d(v+ - v-)/dz = -E (v+ + v-),
//   E, O = diag(sigma_t / mu) - sigma_s K,   K_ij = sqrt(w_i w_j / (mu_i mu_j)) sum_l (2 l + 1) chi_l P_l(mu_i)
//   P_l(mu_j),
// l even in E, odd in O. A layer loses A = 1 - T - R of light that falls alike on both sides, and answers light that
// falls oppositely with B = T - R:
//   thin layer:  A = 2 - 2 (1 + E h/2)^-1,  B = 2 (1 + O h/2)^-1 - 1  (Wiscombe's diamond; error h^2), taken at h and
//   at
//                two layers of h/2 and extrapolated to error h^4; energy is kept exactly at any h;
//   doubling:    A' = 2 A - A (1 - R)^-1 A,  B' = T (1 + R)^-1 T - R  (a mirror and a sink at the middle).
// Each is a Cholesky factorisation, which exists while energy does not grow; that A is followed, not 1 - A, keeps
// energy to rounding however often a layer is doubled.
//
// Streams: Gauss nodes below the critical cosine and Radau nodes with the normal above it, so that no interval holds
// the kink of Fresnel's reflectance. Henyey-Greenstein chi_l = g^l is truncated at l < M = N by delta-M (Wiscombe
// 1977): f = g^M counts as not scattered. Polynomials that energy needs are then integrated exactly. The reflectance of
// a node is not Fresnel's at that point, whose slope is infinite at the critical angle, but what integrates light that
// is a polynomial in mu exactly; the normal keeps Fresnel's.
//
// Rounding grows as the square of the optical thickness: energy holds to 1e-12 at sigma_s' d = 10, 1e-10 at 100, 1e-8
// at 1e4; layers end at about 1e6 mean free paths, where absorption that matters leaves no transmission. Stops being
// true: rough faces; beams that are not perpendicular; strongly forward phase functions in thin slabs, where M moments
// are few (measured: docs/optical_properties.svg).
#include "fit/adding_doubling.h"
#include "base/quadrature.h"
#include "base/vector_clones.h"
#include "fit/fresnel.h"
#include <math.h>
#include <string.h>

enum { MAX = ALB_STREAMS_MAX, DOUBLINGS_MAX = 60, HALF_SPACE_DOUBLINGS = 40 };

// Optical thickness of the first layer in units of the smallest cosine.
static const double first_layer = 2;

// Replaces the reflectances of nodes[0..count-1) above the critical cosine: with c_j = (1 - F_j) mu_j w_j,
// sum_j c_j f(mu_j) = int (1 - F) mu f dmu for every polynomial f of degree count - 2; the last c is given.
static void integrate_reflectance(alb_streams *streams, int first, double critical)
{
    enum { FINE = 24 }; // the integrand is a polynomial of degree 2 (count / 2) + 2 times a smooth square root
    const int last = streams->count - 1;
    double t[FINE], part[FINE], normal = streams->cosine[last] * streams->weight[last];
    normal *= 1 - streams->reflectance[last];
    alb_quadrature_gauss(t, part, FINE, 0, 1);
    for (int j = first; j < last; j++) {
        double through = 0;
        for (int k = 0; k <= FINE; k++) { // mu = critical + (1 - critical) t^2: smooth; the last is the normal
            const double mu = k < FINE ? critical + (1 - critical) * t[k] * t[k] : 1;
            double value = k < FINE ? part[k] * 2 * t[k] * (1 - critical) * mu *
                                          (1 - alb_fresnel_inside(streams->refractive_index, mu))
                                    : -normal;
            for (int i = first; i < last; i++) // Lagrange's polynomial
                if (i != j)
                    value *= (mu - streams->cosine[i]) / (streams->cosine[j] - streams->cosine[i]);
            through += value;
        }
        streams->reflectance[j] = fmin(1, fmax(0, 1 - through / (streams->cosine[j] * streams->weight[j])));
    }
}

static void place_streams(alb_streams *streams)
{
    const double n = streams->refractive_index, critical = sqrt(1 - 1 / (n * n));
    const int count = streams->count, below = n > 1 ? count / 2 : 0;
    if (below)
        alb_quadrature_gauss(streams->cosine, streams->weight, below, 0, critical);
    alb_quadrature_radau(streams->cosine + below, streams->weight + below, count - below, critical, 1);
    for (int i = 0; i < count; i++)
        streams->reflectance[i] = alb_fresnel_inside(n, streams->cosine[i]);
    if (below)
        integrate_reflectance(streams, below, critical);
}

// f_l: binomial mean of g^max(m, l) over m = moments - halvings .. moments.
static double forward_peak(double g, int l, int moments, int halvings)
{
    double sum = 0, share = ldexp(1, -halvings);
    for (int k = 0; k <= halvings; k++) {
        sum += share * pow(g, moments - k > l ? moments - k : l);
        share *= (double)(halvings - k) / (k + 1);
    }
    return sum;
}

void alb_streams_create(alb_streams *streams, int count, double n, double g)
{
    *streams = (alb_streams){.count = count, .refractive_index = n, .anisotropy = g};
    place_streams(streams);
    const int moments = n > 1 ? count : 2 * count;
    const double peak = forward_peak(g, 0, moments, count / 2);
    double previous[MAX], current[MAX], chi = 1;
    for (int i = 0; i < count; i++)
        previous[i] = 0, current[i] = 1;
    streams->scattering_per_reduced = (1 - peak) / (1 - g);
    for (int l = 0; l < moments; l++, chi *= g) {
        alb_stream_matrix *k = l % 2 ? &streams->odd : &streams->even;
        const double strength = (2 * l + 1) * (chi - forward_peak(g, l, moments, count / 2)) / (1 - peak);
        for (int i = 0; i < count; i++)
            for (int j = 0; j < count; j++)
                (*k)[i][j] += strength * current[i] * current[j];
        for (int i = 0; i < count; i++) {
            const double next = ((2 * l + 1) * streams->cosine[i] * current[i] - l * previous[i]) / (l + 1);
            previous[i] = current[i], current[i] = next;
        }
    }
    for (int i = 0; i < count; i++)
        for (int j = 0; j < count; j++) {
            const double scale =
                sqrt(streams->weight[i] * streams->weight[j] / (streams->cosine[i] * streams->cosine[j]));
            streams->even[i][j] *= scale, streams->odd[i][j] *= scale;
        }
}

// out = b^T a^-1 b for a symmetric, positive definite a of n rows and b of `columns` columns; a and b are lost.
// Cholesky's a = u^T u in the upper triangle, y = u^-T b beside it, y^T y.
ALB_VECTOR_CLONES static void sandwich(alb_stream_matrix out, alb_stream_matrix a, alb_stream_matrix b, int n,
                                       int columns)
{
    for (int k = 0; k < n; k++) {
        const double scale = 1 / sqrt(fmax(a[k][k], 1e-14)); // less only by rounding
        for (int j = k; j < n; j++)
            a[k][j] *= scale;
        for (int j = 0; j < columns; j++)
            b[k][j] *= scale;
        for (int i = k + 1; i < n; i++) {
            const double f = a[k][i];
            for (int j = i; j < n; j++)
                a[i][j] -= f * a[k][j];
            for (int j = 0; j < columns; j++)
                b[i][j] -= f * b[k][j];
        }
    }
    for (int i = 0; i < columns; i++) {
        double row[MAX] = {0};
        for (int k = 0; k < n; k++) {
            const double f = b[k][i];
            for (int j = 0; j < columns; j++)
                row[j] += f * b[k][j];
        }
        memcpy(out[i], row, sizeof(double) * (size_t)columns);
    }
}

// Wiscombe's diamond. Lost light is taken as h E - h^2/2 E (1 + h/2 E)^-1 E, the same without cancellation.
static void diamond(alb_layer *layer, const alb_streams *streams, double absorption, double scattering, double h)
{
    alb_stream_matrix e, a, b;
    const int n = layer->count = streams->count;
    for (int odd = 0; odd < 2; odd++) {
        const double(*k)[MAX] = odd ? streams->odd : streams->even;
        double(*out)[MAX] = odd ? layer->odd : layer->lost;
        for (int i = 0; i < n; i++)
            for (int j = 0; j < n; j++) {
                e[i][j] = h * ((i == j ? (absorption + scattering) / streams->cosine[i] : 0) - scattering * k[i][j]);
                a[i][j] = (i == j) + e[i][j] / 2;
                b[i][j] = odd ? i == j : e[i][j];
            }
        sandwich(out, a, b, n, n);
        for (int i = 0; i < n; i++)
            for (int j = 0; j < n; j++)
                out[i][j] = odd ? 2 * out[i][j] - (i == j) : e[i][j] - out[i][j] / 2;
    }
}

static void thin_layer(alb_layer *layer, const alb_streams *streams, double absorption, double scattering, double h)
{
    alb_layer coarse;
    diamond(&coarse, streams, absorption, scattering, h);
    diamond(layer, streams, absorption, scattering, h / 2);
    alb_layer_double(layer);
    for (int i = 0; i < layer->count; i++)
        for (int j = 0; j < layer->count; j++) {
            layer->lost[i][j] += (layer->lost[i][j] - coarse.lost[i][j]) / 3;
            layer->odd[i][j] += (layer->odd[i][j] - coarse.odd[i][j]) / 3;
        }
}

void alb_layer_double(alb_layer *layer)
{
    alb_stream_matrix mirror, sink, lost, through, spared, down;
    const int n = layer->count;
    for (int i = 0; i < n; i++)
        for (int j = 0; j < n; j++) {
            const double both = (i == j) - layer->lost[i][j], r = (both - layer->odd[i][j]) / 2;
            through[i][j] = (both + layer->odd[i][j]) / 2;
            lost[i][j] = layer->lost[i][j];
            mirror[i][j] = through[i][j] + layer->lost[i][j]; // 1 - R
            sink[i][j] = (i == j) + r;
            layer->odd[i][j] = -r;
        }
    sandwich(spared, mirror, lost, n, n);
    sandwich(down, sink, through, n, n);
    for (int i = 0; i < n; i++)
        for (int j = 0; j < n; j++) {
            layer->lost[i][j] += layer->lost[i][j] - spared[i][j];
            layer->odd[i][j] += down[i][j];
        }
}

// Coefficient of scattering that the truncated phase function leaves.
static double truncated(const alb_streams *streams, double reduced)
{
    return streams->scattering_per_reduced * reduced;
}

static double largest_transmission(const alb_layer *layer)
{
    double largest = 0;
    for (int i = 0; i < layer->count; i++)
        for (int j = 0; j < layer->count; j++)
            largest = fmax(largest, fabs((i == j) - layer->lost[i][j] + layer->odd[i][j]) / 2);
    return largest;
}

// Doubles until nothing comes through: then more of the same changes nothing but rounding, which would grow.
static void double_up(alb_layer *layer, int times)
{
    double through = 1;
    for (int i = 0; i < times && through > 1e-13; i++) {
        alb_layer_double(layer);
        const double now = largest_transmission(layer);
        through = now < 1e-6 && now > 0.7 * through ? 0 : now;
    }
}

void alb_layer_create(alb_layer *layer, const alb_streams *streams, double absorption, double reduced_scattering,
                      double thickness)
{
    const double scattering = truncated(streams, reduced_scattering);
    const double optical = (absorption + scattering) * thickness / (first_layer * streams->cosine[0]);
    const int doublings = optical > 1 ? (int)fmin(DOUBLINGS_MAX, ceil(log2(optical))) : 0;
    thin_layer(layer, streams, absorption, scattering, ldexp(thickness, -doublings));
    double_up(layer, doublings);
}

// What faces make of a layer. With gamma the reflectances, g^2 = gamma, s = T + R and sign +1 where both faces are lit
// alike, T - R and -1 where they are lit oppositely (half the sum of both is the face beyond, half the difference the
// near one), a beam e makes   v = s (1 -+ gamma s)^-1 e = s e +- s g (1 -+ g s g)^-1 g s e   at either face.
// a = 1 -+ g s g.
static void between_faces(alb_stream_matrix s, alb_stream_matrix a, double g[ALB_STREAMS_MAX],
                          const alb_streams *streams, const alb_layer *layer, bool odd)
{
    const int n = streams->count;
    for (int i = 0; i < n; i++)
        g[i] = sqrt(streams->reflectance[i]);
    for (int i = 0; i < n; i++)
        for (int j = 0; j < n; j++) {
            s[i][j] = odd ? layer->odd[i][j] : (i == j) - layer->lost[i][j];
            a[i][j] = (i == j) - (odd ? -1 : 1) * g[i] * s[i][j] * g[j];
        }
}

// Flux that leaves both faces together (odd: far less lit) when the beam brings 1 through the lit face: f^T v, f what a
// face lets out.
static double leaving(const alb_streams *streams, const alb_layer *layer, bool odd)
{
    alb_stream_matrix s, a, b, out;
    const int n = streams->count;
    double direct = 0, root[MAX], g[MAX];
    between_faces(s, a, g, streams, layer, odd);
    for (int i = 0; i < n; i++)
        root[i] = sqrt(streams->cosine[i] * streams->weight[i]);
    for (int i = 0; i < n; i++) {
        const double beam = s[i][n - 1] / root[n - 1];
        double let_out = 0;
        for (int j = 0; j < n; j++)
            let_out += s[i][j] * (1 - streams->reflectance[j]) * root[j];
        direct += (1 - streams->reflectance[i]) * root[i] * beam;
        b[i][0] = g[i] * let_out;
        b[i][1] = g[i] * beam;
    }
    sandwich(out, a, b, n, 2);
    return direct + (odd ? -1 : 1) * out[0][1];
}

void alb_streams_within(double radiance[2][ALB_STREAMS_MAX], const alb_streams *streams, const alb_layer *layer)
{
    alb_stream_matrix s, a, out;
    const int n = streams->count, last = n - 1;
    double v[2][MAX], g[MAX];
    for (int odd = 0; odd < 2; odd++) {
        between_faces(s, a, g, streams, layer, odd);
        for (int i = 0; i < n; i++)
            v[odd][i] = s[i][last];
        for (int i = 0; i < n; i++)
            for (int j = 0; j < n; j++)
                s[i][j] *= g[i];
        sandwich(out, a, s, n, n);
        for (int i = 0; i < n; i++)
            v[odd][i] += (odd ? -1 : 1) * out[i][last];
    }
    const double beam = sqrt(streams->cosine[last] * streams->weight[last]);
    for (int i = 0; i < n; i++) {
        const double scale = 0.5 / (beam * sqrt(streams->cosine[i] * streams->weight[i]));
        radiance[0][i] = scale * (v[0][i] - v[1][i]);
        radiance[1][i] = scale * (v[0][i] + v[1][i]);
    }
}

alb_totals alb_adding_doubling(const alb_streams *streams, double absorption, double reduced_scattering,
                               double thickness)
{
    const double entry = 1 - streams->reflectance[streams->count - 1];
    const double extinction = absorption + truncated(streams, reduced_scattering);
    alb_layer layer;
    if (!(extinction > 0))
        return (alb_totals){0, entry};
    if (!(thickness > 0 || absorption > 0))
        return (alb_totals){entry, 0};
    if (thickness > 0)
        alb_layer_create(&layer, streams, absorption, reduced_scattering, thickness);
    else {
        alb_layer_create(&layer, streams, absorption, reduced_scattering, 1 / extinction);
        double_up(&layer, HALF_SPACE_DOUBLINGS);
    }
    const double sum = leaving(streams, &layer, false), difference = leaving(streams, &layer, true);
    return (alb_totals){entry * (sum - difference) / 2, thickness > 0 ? entry * (sum + difference) / 2 : 0};
}

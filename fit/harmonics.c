// How light leaves a slab at spatial frequency k, by spherical harmonics of order N in rotated frames (Markel 2004;
// Liemert & Kienle 2013; slabs with Fresnel faces: Liemert, Reitzle & Kienle 2017), solved backwards: not the radiance
// of the beam but the importance W(z, Omega), the mean of e^(i k (x_leaving - x)) over light at depth z going Omega
// that leaves through the lit (or the far) face. In the direction of travel
//     (-mu d/dz + i k sin(theta) cos(phi) + sigma_t) W = sigma_s integral p W,
// and at a face, of what arrives there, 1 - F leaves and F turns back: W(out) = 1 - F + F W(in) (far face: F W(in)).
// Then S^(k) = sum over the folded beam of sigma_s p W, without any particular solution of the beam, whose resonances
// (k^2 + 1 / xi^2 = sigma_t^2) never appear.
//
// Modes. With W = f e^(-Q z), Q^2 = k^2 + 1 / xi^2, f is e^(i M phi) about the complex axis (-i k xi, 0, Q xi), and its
// harmonics v_l follow from the small symmetric tridiagonal problem
//     sqrt(((l+1)^2 - M^2) / ((2l+1)(2l+3))) (v_(l+1) + its neighbour below) = xi (sigma_t - sigma_s g_l) v_l.
// Turning f to the slab's axes multiplies by Wigner's d^l_mM at the imaginary angle cosh = Q xi, which up to powers of
// i is a positive D^l_mM, from its recursion in l. Powers of i go into the harmonics: everything is real.
//
// Faces. W0 +- Wd is even or odd about the middle: one system each, as many equations (Marshak's: the condition times
// the harmonics with odd l + m, over the half range) as modes.
//
// Where it stops being true: columns become parallel as k xi grows, so that double precision ends near k = 4 sigma_t'
// for N = 9, 6 for N = 7. The radiance's kink at grazing and at the critical angle is resolved as 1 / N^2, with signs
// that alternate from one odd N to the next: means of neighbouring orders are better than either (fit/slab.c).
#include "fit/harmonics.h"
#include "fit/fresnel.h"
#include <math.h>
#include <string.h>

enum { N_MAX = ALB_HARMONICS_ORDER, HALF = ALB_HARMONIC_HALF, MODES = ALB_HARMONIC_MODES, HALF_RANGE = 96 };

// Where harmonic (l, m) stands: all l of one m together.
static inline int place(int order, int l, int m) { return m * (order + 1) - m * (m - 1) / 2 + l - m; }

// Normalised associated Legendre functions (integral of the square over -1..1 is 1) of one m at mu, l = m..N_MAX.
static void legendre(double values[N_MAX + 1], int m, double mu)
{
    double diagonal = sqrt(0.5);
    for (int i = 1; i <= m; i++)
        diagonal *= sqrt((2.0 * i + 1) / (2.0 * i) * (1 - mu * mu));
    values[m] = diagonal;
    for (int l = m + 1; l <= N_MAX; l++) {
        const double square = (double)(l * l - m * m), below = (l - 1.0) * (l - 1.0);
        values[l] = sqrt((4.0 * l * l - 1) / square) *
                    (mu * values[l - 1] - (l > m + 1 ? sqrt((below - m * m) / (4 * below - 1)) * values[l - 2] : 0));
    }
}

// The half range in two pieces that meet at the critical angle, where F has the slope of a square root: the midpoint
// rule in x with mu a smooth step of x, flat at both ends.
static void half_range_point(double *mu, double *weight, int i, double critical)
{
    const int half = HALF_RANGE / 2;
    const double x = (i % half + 0.5) / half, bent = x * x * x * (10 - 15 * x + 6 * x * x);
    const double slope = 30 * x * x * (1 - x) * (1 - x) / half;
    *mu = i < half ? critical * bent : critical + (1 - critical) * bent;
    *weight = slope * (i < half ? critical : 1 - critical);
}

void alb_harmonic_faces_prepare(alb_harmonic_faces *faces, double refractive_index)
{
    *faces = (alb_harmonic_faces){0};
    const double critical = sqrt(fmax(0, 1 - 1 / (refractive_index * refractive_index)));
    for (int i = 0; i < HALF_RANGE; i++) {
        double mu, weight, p[N_MAX + 1];
        half_range_point(&mu, &weight, i, critical);
        const double f = alb_fresnel_inside(refractive_index, mu);
        for (int m = 0; m < N_MAX; m++) {
            legendre(p, m, mu);
            for (int o = 0; m + 1 + 2 * o <= N_MAX; o++) {
                for (int e = 0; m + 2 * e <= N_MAX; e++)
                    faces->passed[m][o][e] += weight * (1 - f) * p[m + 1 + 2 * o] * p[m + 2 * e];
                for (int other = 0; m + 1 + 2 * other <= N_MAX; other++)
                    faces->turned[m][o][other] += weight * (1 + f) * p[m + 1 + 2 * o] * p[m + 1 + 2 * other];
                if (m == 0)
                    faces->leaving[o] += weight * (1 - f) * p[1 + 2 * o];
            }
        }
    }
}

alb_scaled_slab alb_slab_scale(const alb_slab *slab, int order)
{
    const double g = slab->anisotropy, n = slab->refractive_index, beyond = pow(g, order + 1);
    alb_scaled_slab scaled = {.order = order,
                              .absorption_per_mm = slab->absorption_per_mm,
                              .scattering_per_mm = slab->scattering_per_mm * (1 - beyond)};
    for (int l = 0; l <= order; l++)
        scaled.moments[l] = (pow(g, l) - beyond) / (1 - beyond);
    alb_folded_beam *beam = &scaled.beam;
    beam->thickness = slab->thickness_mm;
    beam->extinction = scaled.absorption_per_mm + scaled.scattering_per_mm;
    const double r = (n - 1) * (n - 1) / ((n + 1) * (n + 1)), pass = exp(-beam->extinction * beam->thickness);
    beam->down = (1 - r) / (1 - r * r * pass * pass);
    beam->up = beam->down * r * pass;
    beam->leaving[0] = (1 - r) * beam->up * pass;
    beam->leaving[1] = (1 - r) * beam->down * pass;
    return scaled;
}

// Eigenvalues and vectors (columns) of a small symmetric matrix, destroyed, by Jacobi's rotations.
static void symmetric_eigen(double values[HALF], double vectors[HALF][HALF], double a[HALF][HALF], int n)
{
    for (int i = 0; i < n; i++)
        for (int j = 0; j < n; j++)
            vectors[i][j] = i == j;
    for (int sweep = 0; sweep < 30; sweep++) {
        double off = 0;
        for (int p = 0; p < n; p++)
            for (int q = p + 1; q < n; q++) {
                if (a[p][q] == 0)
                    continue;
                off = fmax(off, fabs(a[p][q]) / sqrt(fabs(a[p][p] * a[q][q])));
                const double theta = (a[q][q] - a[p][p]) / (2 * a[p][q]);
                const double t = copysign(1, theta) / (fabs(theta) + sqrt(theta * theta + 1));
                const double c = 1 / sqrt(t * t + 1), s = t * c;
                for (int k = 0; k < n; k++) {
                    const double kp = a[k][p], kq = a[k][q];
                    a[k][p] = c * kp - s * kq, a[k][q] = s * kp + c * kq;
                }
                for (int k = 0; k < n; k++) {
                    const double pk = a[p][k], qk = a[q][k];
                    a[p][k] = c * pk - s * qk, a[q][k] = s * pk + c * qk;
                }
                for (int k = 0; k < n; k++) {
                    const double kp = vectors[k][p], kq = vectors[k][q];
                    vectors[k][p] = c * kp - s * kq, vectors[k][q] = s * kp + c * kq;
                }
            }
        if (!(off > 1e-15))
            break;
    }
    for (int i = 0; i < n; i++)
        values[i] = a[i][i];
}

// Modes of rank M. The tridiagonal matrix couples even l - M to odd ones only, B from odd to even: xi^2 and the odd
// parts come from B^T B, the even parts are B odd / xi.
static void prepare_rank(alb_harmonic_modes *modes, const double loss[N_MAX + 1], int rank)
{
    const int order = modes->slab.order, odd = (order - rank + 1) / 2, even = (order - rank) / 2 + 1;
    double b[HALF][HALF] = {{0}}, square[HALF][HALF], values[HALF], vectors[HALF][HALF];
    for (int o = 0; o < odd; o++)
        for (int e = o; e < even && e <= o + 1; e++) {
            const int lower = rank + (e == o ? 2 * o : 2 * o + 1); // couples lower and lower + 1
            const double next = lower + 1.0;
            b[e][o] = sqrt((next * next - rank * rank) / ((2 * lower + 1.0) * (2 * lower + 3.0)) /
                           (loss[lower] * loss[lower + 1]));
        }
    for (int i = 0; i < odd; i++)
        for (int j = 0; j < odd; j++) {
            square[i][j] = 0;
            for (int e = 0; e < even; e++)
                square[i][j] += b[e][i] * b[e][j];
        }
    symmetric_eigen(values, vectors, square, odd);
    for (int j = 0; j < odd; j++) {
        double *amplitude = modes->amplitude[modes->first[rank] + j];
        const double xi = sqrt(values[j]);
        modes->length_mm[modes->first[rank] + j] = xi;
        for (int o = 0; o < odd; o++)
            amplitude[rank + 2 * o + 1] = vectors[o][j] / sqrt(loss[rank + 2 * o + 1]);
        for (int e = 0; e < even; e++) {
            double sum = 0;
            for (int o = 0; o < odd; o++)
                sum += b[e][o] * vectors[o][j];
            amplitude[rank + 2 * e] = sum / xi / sqrt(loss[rank + 2 * e]);
        }
    }
}

void alb_harmonic_modes_prepare(alb_harmonic_modes *modes, const alb_scaled_slab *slab, bool once)
{
    *modes = (alb_harmonic_modes){.slab = *slab};
    double loss[N_MAX + 1];
    for (int l = 0; l <= slab->order; l++)
        loss[l] = slab->beam.extinction - (once ? 0 : slab->scattering_per_mm * slab->moments[l]);
    loss[0] = once ? loss[0] : slab->absorption_per_mm; // without the difference's rounding
    for (int rank = 0; rank <= slab->order; rank++) {
        modes->first[rank + 1] = modes->first[rank] + (slab->order - rank + 1) / 2;
        prepare_rank(modes, loss, rank);
    }
}

// D^l_mM for l = max(m, |M|)..order, at the half angle whose hyperbolic cosine and sine are c and s, cosine = c^2 +
// s^2.
static void wigner(double values[N_MAX + 1], int order, int m, int rank, double cosine, const double *c,
                   const double *s)
{
    const int size = rank < 0 ? -rank : rank, low = m > size ? m : size, least = m > size ? size : m;
    double binomial = 1; // (2 low)! / ((low + least)! (low - least)!)
    for (int i = 1; i <= low - least; i++)
        binomial *= (double)(low + least + i) / i;
    values[low] = sqrt(binomial) * c[m + rank < 0 ? -m - rank : m + rank] * s[m > rank ? m - rank : rank - m];
    for (int l = low; l < order; l++) {
        if (l == 0) {
            values[1] = cosine * values[0];
            continue;
        }
        const double next = l + 1.0, here = (double)(l * l);
        const double below = l > low ? next * sqrt((here - m * m) * (here - rank * rank)) * values[l - 1] : 0;
        values[l + 1] = ((2 * l + 1.0) * (l * next * cosine - m * rank) * values[l] - below) /
                        (l * sqrt((next * next - m * m) * (next * next - rank * rank)));
    }
}

// The harmonics of a mode in the slab's axes, largest 1.
static void turn_mode(double out[ALB_HARMONICS], const alb_harmonic_modes *modes, int rank, int mode, double k)
{
    const int order = modes->slab.order;
    const double across = k * modes->length_mm[mode], cosine = sqrt(1 + across * across);
    const double cosh_half = sqrt((1 + cosine) / 2), sinh_half = across / (2 * cosh_half);
    double c[2 * N_MAX + 1] = {1}, s[2 * N_MAX + 1] = {1}, plus[N_MAX + 1], minus[N_MAX + 1], largest = 0;
    for (int i = 1; i <= 2 * order; i++)
        c[i] = c[i - 1] * cosh_half, s[i] = s[i - 1] * sinh_half;
    memset(out, 0, ALB_HARMONICS * sizeof *out);
    for (int m = 0; m <= order; m++) {
        wigner(plus, order, m, rank, cosine, c, s);
        wigner(minus, order, m, -rank, cosine, c, s);
        for (int l = m > rank ? m : rank; l <= order; l++) {
            double *value = &out[place(order, l, m)];
            *value = modes->amplitude[mode][l] * (m ? sqrt(0.5) : 0.5) * (plus[l] + minus[l]);
            largest = fmax(largest, fabs(*value));
        }
    }
    for (int i = 0; i < place(order, order, order) + 1; i++)
        out[i] /= largest;
}

// Gauss with partial pivoting on rows [0..n) of n + 1 columns, the last one the right-hand side and then the solution.
static bool solve(double a[MODES][MODES + 1], int n)
{
    for (int p = 0; p < n; p++) {
        int best = p;
        for (int i = p + 1; i < n; i++)
            best = fabs(a[i][p]) > fabs(a[best][p]) ? i : best;
        if (!(fabs(a[best][p]) > 0))
            return false;
        for (int j = p; best != p && j <= n; j++) {
            const double kept = a[p][j];
            a[p][j] = a[best][j], a[best][j] = kept;
        }
        for (int i = p + 1; i < n; i++) {
            const double factor = a[i][p] / a[p][p];
            for (int j = p + 1; j <= n; j++)
                a[i][j] -= factor * a[p][j];
        }
    }
    for (int i = n - 1; i >= 0; i--) {
        for (int j = i + 1; j < n; j++)
            a[i][n] -= a[i][j] * a[j][n];
        a[i][n] /= a[i][i];
    }
    return true;
}

// Row (m, o): what the even and the odd harmonics of a mode weigh in the condition at the lit face.
static void face_row(double *even, double *odd, const alb_harmonic_faces *faces, const double *mode, int order, int m,
                     int o)
{
    *even = *odd = 0;
    for (int e = 0; m + 2 * e <= order; e++)
        *even += faces->passed[m][o][e] * mode[place(order, m + 2 * e, m)];
    for (int i = 0; m + 1 + 2 * i <= order; i++)
        *odd += faces->turned[m][o][i] * mode[place(order, m + 1 + 2 * i, m)];
}

// Fills the condition of the symmetric (sign 1) or antisymmetric (-1) importance, each row over its largest element.
static void fill_system(double a[MODES][MODES + 1], double even[MODES][MODES], double odd[MODES][MODES],
                        const double *pass, const double *right, int n, int sign)
{
    for (int i = 0; i < n; i++) {
        double largest = 0;
        for (int j = 0; j < n; j++) {
            a[i][j] = even[i][j] * (1 + sign * pass[j]) + odd[i][j] * (1 - sign * pass[j]);
            largest = fmax(largest, fabs(a[i][j]));
        }
        for (int j = 0; j < n; j++)
            a[i][j] /= largest;
        a[i][n] = right[i] / largest;
    }
}

// What scatters out of the folded beam times a mode that decays from the lit face (along) and from the far one.
static void beam_overlap(double *near, double *far, const alb_scaled_slab *slab, const double *mode, double q)
{
    const alb_folded_beam *beam = &slab->beam;
    const double d = beam->thickness, s = beam->extinction, apart = fabs(q - s) * d;
    const double same = -expm1(-(s + q) * d) / (s + q);
    const double against = exp(-fmin(q, s) * d) * d * (apart > 1e-12 ? -expm1(-apart) / apart : 1);
    double part[2] = {0};
    for (int l = 0; l <= slab->order; l++)
        part[l % 2] += slab->scattering_per_mm * slab->moments[l] * sqrt((2 * l + 1) / (4 * M_PI)) *
                       mode[place(slab->order, l, 0)];
    *near = beam->down * (part[0] - part[1]) * same + beam->up * (part[0] + part[1]) * against;
    *far = beam->down * (part[0] + part[1]) * against + beam->up * (part[0] - part[1]) * same;
}

void alb_harmonic_modes_leaving(double leaving[2], const alb_harmonic_modes *modes, const alb_harmonic_faces *faces,
                                double k_per_mm)
{
    const int order = modes->slab.order, n = modes->first[order + 1];
    double even[MODES][MODES], odd[MODES][MODES], a[MODES][MODES + 1], right[MODES] = {0};
    double pass[MODES], near[MODES], far[MODES], harmonics[ALB_HARMONICS], sum[2] = {0};
    for (int rank = 0; rank <= order; rank++)
        for (int j = modes->first[rank]; j < modes->first[rank + 1]; j++) {
            const double q = hypot(k_per_mm, 1 / modes->length_mm[j]);
            turn_mode(harmonics, modes, rank, j, k_per_mm);
            beam_overlap(&near[j], &far[j], &modes->slab, harmonics, q);
            pass[j] = exp(-q * modes->slab.beam.thickness);
            for (int m = 0, row = 0; m < order; m++)
                for (int o = 0; m + 1 + 2 * o <= order; o++, row++)
                    face_row(&even[row][j], &odd[row][j], faces, harmonics, order, m, o);
        }
    for (int o = 0; 1 + 2 * o <= order; o++)
        right[o] = sqrt(2 * M_PI) * faces->leaving[o];
    for (int sign = 1; sign >= -1; sign -= 2) {
        fill_system(a, even, odd, pass, right, n, sign);
        if (!solve(a, n)) {
            leaving[0] = leaving[1] = NAN;
            return;
        }
        for (int j = 0; j < n; j++)
            sum[sign < 0] += a[j][n] * (near[j] + sign * far[j]);
    }
    leaving[0] = (sum[0] + sum[1]) / 2;
    leaving[1] = (sum[0] - sum[1]) / 2;
}

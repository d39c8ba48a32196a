// Unobstructed view factors. With P (area A) cut to the front of Q's plane and Q to the front of P's:
//     point    F = -1/(2 pi) n . sum over edges of angle(r_k, r_k+1) (r_k x r_k+1) / |r_k x r_k+1|      Lambert 1760
//     contour  F = 1/(2 pi A) contour P contour Q  ln(r/r0) dr_P . dr_Q                    Sparrow 1963, by Stokes
//              the integral along an edge of Q in closed form, u along it and h beside it:
//                  integral ln(r/r0) du = u/2 ln((u^2 + h^2)/r0^2) - u + h atan(u/h)
//              (u drops out of the sum over a closed contour), the one along P by adaptive Gauss-Kronrod quadrature
//     area     F = 1/A integral P integral Q  cos cos' / (pi r^2) dA dA'    by Gauss-Legendre products, far pairs
// The contour form cancels as (size/distance)^2, hence the third form. Any r0 serves; near the distance it cancels
// least. The integrand of the outer integral behaves as x ln x where edges meet, which halving intervals resolves.
// Stops being true: with something between; P and Q that cross beyond the other's edges (cutting takes their planes);
// relative to 1e-9 where the factor is below ~1e-12 of what a rotated pair would exchange.
#include "render/form_factor_exact.h"

enum { CUT_MAX = 2 * ALB_POLYGON_MAX, DEEPEST = 60, GAUSS = 8 };

static const double far_away = 4;       // distance over the sum of radii
static const double exactness = 1e-10;  // of the outer quadrature, relative
static const double rounding = 0x1p-48; // of a sum of terms, relative to their size

typedef struct polygon {
    alb_vector corners[CUT_MAX];
    size_t count;
} polygon;

// Half the sum of the corners' cross products: the area along the normal.
static alb_vector vector_area(const alb_vector *corners, size_t count)
{
    alb_vector sum = {0};
    for (size_t k = 1; k + 1 < count; k++)
        sum = alb_add(sum, alb_cross(alb_sub(corners[k], corners[0]), alb_sub(corners[k + 1], corners[0])));
    return alb_times(0.5, sum);
}

// What of the polygon lies in front of the plane. (Sutherland & Hodgman 1974; the bridges it leaves in polygons that
// are not convex are run along in both directions and so count nothing.)
static void cut(polygon *out, const alb_vector *corners, size_t count, alb_vector on_plane, alb_vector normal)
{
    out->count = 0;
    for (size_t k = 0; k < count; k++) {
        const alb_vector a = corners[k], b = corners[(k + 1) % count];
        const double above_a = alb_dot(alb_sub(a, on_plane), normal), above_b = alb_dot(alb_sub(b, on_plane), normal);
        if (above_a >= 0)
            out->corners[out->count++] = a;
        if ((above_a > 0 && above_b < 0) || (above_a < 0 && above_b > 0))
            out->corners[out->count++] = alb_add(a, alb_times(above_a / (above_a - above_b), alb_sub(b, a)));
    }
}

// --- from a point ----------------------------------------------------------------------------------------------------
// Of a polygon that lies above the horizon.
static double lambert(alb_vector point, alb_vector normal, const polygon *p)
{
    double sum = 0;
    for (size_t k = 0; k < p->count; k++) {
        const alb_vector a = alb_sub(p->corners[k], point), b = alb_sub(p->corners[(k + 1) % p->count], point);
        const alb_vector across = alb_cross(a, b);
        const double sine = alb_length(across);
        if (sine > 0)
            sum -= atan2(sine, alb_dot(a, b)) / sine * alb_dot(across, normal);
    }
    return sum / (2 * M_PI);
}

double alb_form_factor_point(alb_vector point, alb_vector normal, const alb_vector *corners, size_t count)
{
    polygon above;
    if (count < 3 || count > ALB_POLYGON_MAX || !(alb_dot(alb_sub(point, corners[0]), vector_area(corners, count)) > 0))
        return 0;
    cut(&above, corners, count, point, normal);
    return fmax(0, lambert(point, normal, &above));
}

// --- contours --------------------------------------------------------------------------------------------------------
typedef struct contour {
    alb_vector start, along; // of P's edge; along is a unit vector
    const polygon *to;
    double reference2; // r0^2
} contour;

// Sum over Q's edges of along . d_j integral ln(r/r0), from the point at s of P's edge. *size gains the size of the
// terms.
static double inner(double *size, const contour *c, double s)
{
    const alb_vector x = alb_add(c->start, alb_times(s, c->along));
    double sum = 0;
    for (size_t k = 0; k < c->to->count; k++) {
        const alb_vector a = c->to->corners[k], edge = alb_sub(c->to->corners[(k + 1) % c->to->count], a);
        const double length = alb_length(edge), parallel = alb_dot(c->along, edge);
        if (length == 0 || parallel == 0)
            continue;
        const alb_vector d = alb_times(1 / length, edge), from = alb_sub(a, x);
        const double u[2] = {alb_dot(from, d), alb_dot(from, d) + length};
        const double h = alb_length(alb_cross(from, d));
        double part = h > 0 ? h * atan2(h * length, h * h + u[0] * u[1]) : 0;
        for (int end = 0; end < 2; end++) {
            const double r2 = u[end] * u[end] + h * h;
            const double term = r2 > 0 ? 0.5 * u[end] * log(r2 / c->reference2) : 0;
            part += end ? term : -term;
            *size += fabs(parallel / length * term);
        }
        *size += fabs(parallel / length * part);
        sum += parallel / length * part;
    }
    return sum;
}

// Gauss-Kronrod 7-15 on [a, b]; the difference of the two as error, zero where it is rounding.
static double kronrod(double *error, const contour *c, double a, double b)
{
    static const double nodes[8] = {0.991455371120812639206854697526329, 0.949107912342758524526189684047851,
                                    0.864864423359769072789712788640926, 0.741531185599394439863864773280788,
                                    0.586087235467691130294144691693890, 0.405845151377397166906606412076961,
                                    0.207784955007898467600689403773245, 0};
    static const double fine[8] = {0.022935322010529224963732008058970, 0.063092092629978553290700663189204,
                                   0.104790010322250183839876322541518, 0.140653259715525918745189590510238,
                                   0.169004726639267902826583426598550, 0.190350578064785409913256402421014,
                                   0.204432940075298892414161999234649, 0.209482141084727828012999174891714};
    static const double coarse[4] = {0.129484966168869693270611432679082, 0.279705391489276667901467771423780,
                                     0.381830050505118944950369775488975, 0.417959183673469387755102040816327};
    const double middle = 0.5 * (a + b), half = 0.5 * (b - a);
    double sums[2] = {0}, sizes = 0;
    for (int k = 0; k < 8; k++) {
        double size = 0, value = inner(&size, c, middle + half * nodes[k]);
        value += k < 7 ? inner(&size, c, middle - half * nodes[k]) : 0;
        sums[0] += fine[k] * value;
        sums[1] += k & 1 ? coarse[k / 2] * value : 0;
        sizes += fine[k] * size;
    }
    const double difference = fabs(sums[0] - sums[1]);
    *error = difference > rounding * sizes ? half * difference : 0;
    return half * sums[0];
}

// Integral over the edge: intervals are halved until their errors stay below their share of the tolerance.
static double along_edge(const contour *c, double length, double tolerance)
{
    double starts[DEEPEST + 1] = {0}, ends[DEEPEST + 1] = {length}, sum = 0;
    for (int top = 0; top >= 0;) {
        const double a = starts[top], b = ends[top], middle = 0.5 * (a + b);
        double error;
        const double here = kronrod(&error, c, a, b);
        if (error <= tolerance * (b - a) / length || top == DEEPEST) {
            sum += here;
            top--;
        } else {
            starts[top] = middle; // the right half waits below the left one
            starts[top + 1] = a;
            ends[++top] = middle;
        }
    }
    return sum;
}

static double by_contours(const polygon *p, const polygon *q, double reference2, double tolerance)
{
    double sum = 0;
    for (size_t k = 0; k < p->count; k++) {
        const alb_vector edge = alb_sub(p->corners[(k + 1) % p->count], p->corners[k]);
        const double length = alb_length(edge);
        const contour c = {p->corners[k], alb_times(1 / length, edge), q, reference2};
        if (length > 0)
            sum += along_edge(&c, length, tolerance / (double)p->count);
    }
    return sum / (2 * M_PI);
}

// --- areas -----------------------------------------------------------------------------------------------------------
// Node k of the Gauss-Legendre rule on [0, 1].
static double gauss(double *weight, int k)
{
    static const double nodes[GAUSS / 2] = {0.183434642495649804939476142360184, 0.525532409916328985817739049189246,
                                            0.796666477413626739591553936475830, 0.960289856497536231683560868569473};
    static const double weights[GAUSS / 2] = {0.362683783378361982965150449277196, 0.313706645877887287337962201986601,
                                              0.222381034453374470544355994426241, 0.101228536290376259152531354309962};
    *weight = 0.5 * weights[k / 2];
    return 0.5 + (k & 1 ? -0.5 : 0.5) * nodes[k / 2];
}

// Point k of GAUSS^2 on triangle t of the polygon's fan; the weight is an area (with sign where the fan folds back).
static alb_vector fan_point(double *weight, const polygon *p, alb_vector normal, size_t t, int k)
{
    double wu, wv;
    const double u = gauss(&wu, k / GAUSS), v = gauss(&wv, k % GAUSS);
    const alb_vector a = alb_sub(p->corners[t + 1], p->corners[0]), b = alb_sub(p->corners[t + 2], p->corners[0]);
    *weight = wu * wv * u * alb_dot(alb_cross(a, b), normal);
    return alb_add(p->corners[0], alb_times(u, alb_add(a, alb_times(v, alb_sub(b, a)))));
}

// Integral of Lambert's factor, or for far pairs of the kernel, over P.
static double by_areas(const polygon *p, alb_vector normal_p, const polygon *q, alb_vector normal_q, bool distant)
{
    double sum = 0, weight, weight_q;
    for (size_t t = 0; t + 2 < p->count; t++)
        for (int k = 0; k < GAUSS * GAUSS; k++) {
            const alb_vector x = fan_point(&weight, p, normal_p, t, k);
            if (!distant) {
                sum += weight * lambert(x, normal_p, q);
                continue;
            }
            for (size_t s = 0; s + 2 < q->count; s++)
                for (int l = 0; l < GAUSS * GAUSS; l++) {
                    const alb_vector to = alb_sub(fan_point(&weight_q, q, normal_q, s, l), x);
                    const double r2 = alb_dot(to, to);
                    sum -= weight * weight_q * alb_dot(to, normal_p) * alb_dot(to, normal_q) / (M_PI * r2 * r2);
                }
        }
    return sum;
}

// --- polygon to polygon ----------------------------------------------------------------------------------------------
static alb_vector mean_of(const polygon *p)
{
    alb_vector sum = {0};
    for (size_t k = 0; k < p->count; k++)
        sum = alb_add(sum, p->corners[k]);
    return alb_times(1 / (double)p->count, sum);
}

static double radius_of(const polygon *p, alb_vector centre)
{
    double radius = 0;
    for (size_t k = 0; k < p->count; k++)
        radius = fmax(radius, alb_length(alb_sub(p->corners[k], centre)));
    return radius;
}

bool alb_form_factor_exact(double *factor, const alb_vector *from, size_t from_count, const alb_vector *to,
                           size_t to_count, alb_error *error)
{
    if (from_count < 3 || from_count > ALB_POLYGON_MAX || to_count < 3 || to_count > ALB_POLYGON_MAX)
        return alb_fail(error, ALB_BAD_DATA, "view factor of polygons of %zu and %zu corners; from 3 to %d", from_count,
                        to_count, ALB_POLYGON_MAX);
    const alb_vector area_from = vector_area(from, from_count), area_to = vector_area(to, to_count);
    const alb_vector n = alb_unit(area_from), m = alb_unit(area_to);
    const double area = alb_length(area_from);
    if (!(area > 0) || !(alb_length(area_to) > 0))
        return alb_fail(error, ALB_BAD_DATA, "view factor of a polygon without area");
    polygon p, q;
    cut(&p, from, from_count, to[0], m);
    cut(&q, to, to_count, from[0], n);
    *factor = 0;
    if (p.count < 3 || q.count < 3)
        return true;
    const alb_vector at = mean_of(&p), there = mean_of(&q);
    const double distance = alb_length(alb_sub(there, at)), reach = radius_of(&p, at) + radius_of(&q, there);
    const bool distant = distance > far_away * reach;
    double flux = by_areas(&p, n, &q, m, distant); // near: 1e-2, enough for a tolerance
    if (!distant && flux > 0)
        flux = by_contours(&p, &q, fmax(distance * distance, 1e-4 * reach * reach), exactness * 2 * M_PI * flux);
    *factor = fmin(1, fmax(0, flux / area));
    return true;
}

// The maps tau. Wang et al. 2006, eq. 7 and the cone of sec. 3.1, in forms that hold at 0, pi/2, pi and in single
// precision: cone by atan2 instead of the printed arctangent of a quotient, mid-range by the law of sines instead of
// the root of a quadratic.
//
// The cone is a linear map A = [1 b; 0 k] of the directions (cos theta, sin theta), b = (1 - k) cot alpha. Its curve
// takes the angle s half way: A = B A1, A1 = [1 b/(1+k); 0 sqrt(k) n/(1+k)], n = sqrt((1+k)^2 + b^2), the triangular
// root of (A^T A)^(1/2). Seen from s both angles vary equally fast, sqrt(k) instead of k times.
//
// Where they stop being true: they know nothing of the object but the cone (or sphere); inside the bounding sphere
// (k < 1) that guess rules the error.
#include "render/sh_map.h"
#include <math.h>
#include <stdint.h>

static const double k_minimum = 1e-12, k_maximum = 1e12;

bool alb_sh_map_cone(alb_sh_map *map, double k, double alpha_deg, alb_error *error)
{
    if (!(k >= 0))
        return alb_fail(error, ALB_USAGE, "cone map: k = %g; a ratio of distances is 0 or more", k);
    if (!(alpha_deg >= 10 && alpha_deg <= 80))
        return alb_fail(error, ALB_USAGE, "cone map: alpha = %g degrees; expected 10 to 80", alpha_deg);
    *map = (alb_sh_map){.kind = ALB_SH_MAP_CONE,
                        .k = fmin(fmax(k, k_minimum), k_maximum),
                        .cot_alpha = 1 / tan(alpha_deg * M_PI / 180)};
    return true;
}

bool alb_sh_map_midrange(alb_sh_map *map, double k, alb_error *error)
{
    if (!(k > -1 && k < 1))
        return alb_fail(error, ALB_USAGE, "mid-range map: k = %g; the receiver must be inside the sphere, -1 < k < 1",
                        k);
    *map = (alb_sh_map){.kind = ALB_SH_MAP_MIDRANGE, .k = k};
    return true;
}

bool alb_sh_map_sphere(alb_sh_map *map, double k, alb_error *error)
{
    if (!(k >= 0))
        return alb_fail(error, ALB_USAGE, "sphere map: k = %g; a ratio of distances is 0 or more", k);
    *map = (alb_sh_map){.kind = ALB_SH_MAP_SPHERE, .windowed = true, .k = fmin(fmax(k, k_minimum), k_maximum)};
    return true;
}

void alb_sh_map_custom(alb_sh_map *map, alb_sh_tau *tau, const void *context)
{
    *map = (alb_sh_map){.kind = ALB_SH_MAP_CUSTOM, .tau = tau, .context = context};
}

static double secant(const alb_sh_tau_table *table, size_t i)
{
    return (table->tau[i + 1] - table->tau[i]) / (table->theta[i + 1] - table->theta[i]);
}

// Slope at a knot: a weighted harmonic mean of the secants beside it, at an end the secant.
static double knot_slope(const alb_sh_tau_table *table, size_t i)
{
    if (i == 0 || i + 1 == table->count)
        return secant(table, i ? i - 1 : 0);
    const double left = secant(table, i - 1), right = secant(table, i);
    const double before = table->theta[i] - table->theta[i - 1], after = table->theta[i + 1] - table->theta[i];
    const double share = (before + 2 * after) / (3 * (before + after));
    return left * right > 0 ? left * right / (share * right + (1 - share) * left) : 0;
}

static double table_tau(const void *context, double theta, double *slope)
{
    const alb_sh_tau_table *table = context;
    size_t low = 0, high = table->count - 1;
    while (high - low > 1) {
        const size_t middle = (low + high) / 2;
        *(table->theta[middle] <= theta ? &low : &high) = middle;
    }
    const double width = table->theta[high] - table->theta[low], x = (theta - table->theta[low]) / width;
    const double rise = table->tau[high] - table->tau[low];
    const double from = width * knot_slope(table, low), to = width * knot_slope(table, high);
    *slope = (from + x * (6 * rise - 4 * from - 2 * to + x * (3 * from + 3 * to - 6 * rise))) / width;
    return table->tau[low] + x * (from + x * (3 * rise - 2 * from - to + x * (from + to - 2 * rise)));
}

bool alb_sh_map_table(alb_sh_map *map, const alb_sh_tau_table *table, alb_error *error)
{
    const size_t n = table->count;
    if (n < 2 || table->theta[0] != 0 || table->tau[0] != 0 || !(fabs(table->theta[n - 1] - M_PI) < 1e-6) ||
        !(fabs(table->tau[n - 1] - M_PI) < 1e-6))
        return alb_fail(error, ALB_BAD_DATA, "table of tau: both angles must go from 0 to pi in two rows or more");
    for (size_t i = 1; i < n; i++)
        if (!(table->theta[i] > table->theta[i - 1] && table->tau[i] >= table->tau[i - 1]))
            return alb_fail(error, ALB_BAD_DATA, "table of tau: row %zu (%g, %g) does not rise", i + 1, table->theta[i],
                            table->tau[i]);
    alb_sh_map_custom(map, table_tau, table);
    return true;
}

static double clamp_angle(double angle) { return fmin(fmax(angle, 0), M_PI); }

double alb_sh_map_tau(const alb_sh_map *map, double theta, double *slope)
{
    double own, *const out = slope ? slope : &own;
    theta = clamp_angle(theta);
    const double k = map->k, c = cos(theta), s = sin(theta);
    switch (map->kind) {
    case ALB_SH_MAP_CONE: {
        const double x = c + (1 - k) * map->cot_alpha * s, y = k * s;
        *out = k / (x * x + y * y);
        return clamp_angle(atan2(y, x));
    }
    case ALB_SH_MAP_MIDRANGE: {
        const double q = sqrt((1 - k) * (1 + k) + k * k * c * c);
        *out = (q - k * c) / q;
        return clamp_angle(theta - atan2(k * s, q));
    }
    case ALB_SH_MAP_SPHERE: {
        const double y = fmin(k * s, 1), x = sqrt((1 - y) * (1 + y));
        *out = x > 0 ? k * c / x : 0;
        return atan2(y, x);
    }
    default:
        return clamp_angle(map->tau(map->context, theta, out));
    }
}

// sqrt(k) n / (1 + k) and b / (1 + k) of the head.
static double half_way(double *shear, const alb_sh_map *map)
{
    const double k = map->k, b = (1 - k) * map->cot_alpha;
    *shear = b / (1 + k);
    return sqrt(k) * hypot(1, *shear);
}

double alb_sh_map_end(const alb_sh_map *map)
{
    if (map->kind == ALB_SH_MAP_SPHERE)
        return M_PI / 2;
    if (!map->windowed)
        return M_PI;
    if (map->kind == ALB_SH_MAP_CONE) { // cos tau = 0 where cos s = -k b / (1 + k) / stretch sin s
        double shear;
        const double stretch = half_way(&shear, map);
        return atan2(stretch, -map->k * shear);
    }
    double low = 0, high = M_PI;
    for (int i = 0; i < 60; i++) {
        const double middle = (low + high) / 2;
        *(alb_sh_map_tau(map, middle, NULL) < M_PI / 2 ? &low : &high) = middle;
    }
    return low;
}

// cos, sin and slope of the angle atan2(scale sin s, cos s + shear sin s).
static void cone_angle(double *cosine, double *sine, double *slope, double cos_s, double sin_s, double scale,
                       double shear)
{
    const double x = cos_s + shear * sin_s, y = scale * sin_s, length = hypot(x, y);
    *cosine = x / length, *sine = y / length, *slope = scale / (length * length);
}

void alb_sh_map_at(alb_sh_map_point *p, const alb_sh_map *map, double at)
{
    const double k = map->k, c = cos(at), s = sin(at);
    if (map->kind == ALB_SH_MAP_CONE) {
        double shear;
        const double stretch = half_way(&shear, map);
        cone_angle(&p->cos_theta, &p->sin_theta, &p->theta_slope, c, s, 1 / stretch, -shear / stretch);
        cone_angle(&p->cos_tau, &p->sin_tau, &p->tau_slope, c, s, k / stretch, k * shear / stretch);
    } else if (map->kind == ALB_SH_MAP_SPHERE && k > 1) { // the sample's angle: theta has a finite slope in it
        *p = (alb_sh_map_point){.sin_theta = s / k, .cos_tau = c, .sin_tau = s, .tau_slope = 1};
        p->cos_theta = sqrt((1 - p->sin_theta) * (1 + p->sin_theta));
        p->theta_slope = c / (k * p->cos_theta);
    } else if (map->kind == ALB_SH_MAP_MIDRANGE) {
        const double q = sqrt((1 - k) * (1 + k) + k * k * c * c);
        *p = (alb_sh_map_point){c, s, 1, c * q + k * s * s, s * (q - k * c), (q - k * c) / q};
    } else {
        *p = (alb_sh_map_point){.cos_theta = c, .sin_theta = s, .theta_slope = 1};
        const double tau = alb_sh_map_tau(map, at, &p->tau_slope);
        p->cos_tau = cos(tau), p->sin_tau = sin(tau);
    }
}

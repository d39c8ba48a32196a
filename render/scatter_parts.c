// Parts of patches.
//
// A patch that is not long is quartered into triangles like itself; a long one is halved across its longest side, and
// so are the halves. A part's principal variances v1 >= v2, h^2 = 6 (v1 + v2), b = |s'| / s; at distance d it leaves of
// its light
//     (b h)^4 / 1920 + min(b d, 1) (h / d)^4 / 500 + b^2 (v1 - v2) / 40
// The first term is what second moments leave of an exponential, the second what they leave of a cusp at no distance,
// the third that the variance along the line of sight is not their mean.
// Three distances that have its first three moments, and the fourth where it is far, leave of it
//     (b h)^6 / 700,000 + min(b d, 1) (h / d)^4 / 4000
#include "render/scatter_parts.h"
#include <math.h>

// Halves the triangle across its longest side, and the halves.
static void halve(alb_source *parts, alb_vector a, alb_vector b, alb_vector c, int count)
{
    const double ab = alb_length(alb_sub(b, a)), bc = alb_length(alb_sub(c, b)), ca = alb_length(alb_sub(a, c));
    if (count == 1) {
        const alb_vector centre = alb_times(1.0 / 3, alb_add(a, alb_add(b, c)));
        *parts = (alb_source){.at = {(float)centre.x, (float)centre.y, (float)centre.z}};
        alb_moments_of_triangle(parts->moments, a, b, c);
    } else if (ab >= bc && ab >= ca) {
        const alb_vector middle = alb_times(0.5, alb_add(a, b));
        halve(parts, a, middle, c, count / 2);
        halve(parts + count / 2, middle, b, c, count / 2);
    } else if (bc >= ca) {
        halve(parts, b, c, a, count);
    } else {
        halve(parts, c, a, b, count);
    }
}

// Quarters it into triangles like itself, and the quarters.
static void quarter(alb_source *parts, alb_vector a, alb_vector b, alb_vector c, int count)
{
    if (count == 1) {
        halve(parts, a, b, c, count);
        return;
    }
    const alb_vector ab = alb_times(0.5, alb_add(a, b)), bc = alb_times(0.5, alb_add(b, c)),
                     ca = alb_times(0.5, alb_add(c, a));
    const int each = count / 4;
    quarter(parts, a, ab, ca, each);
    quarter(parts + each, ab, b, bc, each);
    quarter(parts + 2 * each, ca, bc, c, each);
    quarter(parts + 3 * each, ab, bc, ca, each);
}

// The principal variances of a part when a patch is in so many: halved across its length until it is no longer one.
static void variances_of_part(float variances[2], const alb_cluster *cluster, int parts)
{
    const float half = cluster->spread_mm2, product = cluster->area_mm2 * cluster->area_mm2 / 108; // of the whole
    const float longest = half + sqrtf(fmaxf(half * half - product, 0)), n = (float)parts;
    variances[0] = fmaxf(longest / (n * n), fminf(1.7F * sqrtf(product) / n, longest / n));
    variances[1] = product / (n * n * variances[0]);
}

float alb_parts_left(const alb_cluster *cluster, int parts, float b, float distance)
{
    float variances[2];
    variances_of_part(variances, cluster, parts);
    const float h2 = 6 * (variances[0] + variances[1]), bh2 = b * b * h2, near = h2 / (distance * distance);
    return bh2 * bh2 / 1920 + fminf(b * distance, 1) * near * near / 500 + b * b * (variances[0] - variances[1]) / 40;
}

float alb_parts_left_by_thirds(const alb_cluster *cluster, float b, float distance)
{
    const float h2 = 12 * cluster->spread_mm2, bh2 = b * b * h2, near = h2 / (distance * distance);
    return bh2 * bh2 * bh2 / 7e5F + fminf(b * distance, 1) * near * near / 4000;
}

static bool is_long(const alb_cluster *cluster, int parts)
{
    float variances[2];
    variances_of_part(variances, cluster, parts);
    const float spread = 0.5F * (variances[0] + variances[1]) / cluster->spread_mm2, n = (float)parts;
    return parts > 1 && spread * n * sqrtf(n) < 1;
}

int alb_parts_most(const alb_cluster *cluster)
{
    return is_long(cluster, ALB_PARTS_MAX / 4) ? ALB_PARTS_MAX : ALB_PARTS_MAX / 4;
}

float alb_parts_cut(alb_source parts[ALB_PARTS_MAX], const alb_cluster *cluster, const alb_vector t[3], int count)
{
    const bool across = is_long(cluster, count);
    if (across)
        halve(parts, t[0], t[1], t[2], count);
    else
        quarter(parts, t[0], t[1], t[2], count);
    return 1 / (float)(across ? count * count : count);
}

// Squared distance of p from the segment a b.
static double to_segment(alb_vector p, alb_vector a, alb_vector b)
{
    const alb_vector along = alb_sub(b, a), to = alb_sub(p, a);
    const double t = fmin(fmax(alb_dot(to, along) / fmax(alb_dot(along, along), 1e-300), 0), 1);
    const alb_vector off = alb_sub(to, alb_times(t, along));
    return alb_dot(off, off);
}

double alb_distance_to_triangle(alb_vector p, const alb_vector t[3])
{
    const alb_vector normal = alb_unit(alb_cross(alb_sub(t[1], t[0]), alb_sub(t[2], t[0])));
    double nearest = INFINITY;
    bool inside = true;
    for (int k = 0; k < 3; k++) {
        const alb_vector a = t[k], b = t[(k + 1) % 3];
        nearest = fmin(nearest, to_segment(p, a, b));
        inside &= alb_dot(alb_cross(alb_sub(b, a), alb_sub(p, a)), normal) >= 0;
    }
    return inside ? fabs(alb_dot(normal, alb_sub(p, t[0]))) : sqrt(nearest);
}

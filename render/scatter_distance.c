// How far the sources of a block's light are from its rows.
//
// The distance of a cluster is the mean over it to second order, sqrt(d^2 + variance across the line of sight); what
// the variance along it adds, the kernel knows (scatter_kernel.c). A patch that is near stands at three distances that
// have the mean, variance and skewness of those of its parts, or at eight that have their order (scatter_parts.c).
#include "base/vector_clones.h"
#include "render/scatter_viewer.h"
#include <string.h>

void alb_project(float v[3], float x, float y, float z)
{
    const float across = v[0] * x + v[1] * y + v[2] * z;
    v[0] -= across * x, v[1] -= across * y, v[2] -= across * z;
}

void alb_viewer_project(float to[3], const alb_viewer *v, uint32_t row)
{
    alb_project(to, v->axes[0][row], v->axes[1][row], v->axes[2][row]);
}

ALB_VECTOR_CLONES
void alb_viewer_measure(float distances[ALB_BLOCK], float along_mm2[ALB_BLOCK], const alb_viewer *v,
                        const alb_source *from, bool across)
{
    const float *m = from->moments;
    for (int row = 0; row < ALB_BLOCK; row++) {
        const float a = across ? v->axes[0][row] : 0, b = across ? v->axes[1][row] : 0,
                    c = across ? v->axes[2][row] : 0;
        const float trace = m[0] * (1 - a * a) + m[1] * (1 - b * b) + m[2] * (1 - c * c) -
                            2 * (m[3] * a * b + m[4] * a * c + m[5] * b * c);
        float x = from->at[0] - v->at[0][row], y = from->at[1] - v->at[1][row], z = from->at[2] - v->at[2][row];
        const float rise = x * a + y * b + z * c;
        x -= rise * a, y -= rise * b, z -= rise * c;
        const float squared = x * x + y * y + z * z;
        const float along =
            m[0] * x * x + m[1] * y * y + m[2] * z * z + 2 * (m[3] * x * y + m[4] * x * z + m[5] * y * z);
        const float variance = squared > 0 ? along / squared : 0.5F * trace;
        const float sum = squared + trace - variance;
        distances[row] = sqrtf(sum > 0 ? sum : 0);
        along_mm2[row] = variance;
    }
}

// Three distances with the mean, variance and skewness of a distribution whose fourth moment is that of a triangle's
// points along a line, 12/5: of weights 5, 14 and 5 in 24. In deviations, z = t - u, -5/7 t, t + u.
static void take_thirds(float distances[3], float mean, float deviation, float skewness)
{
    float t = skewness / 3;
    for (int step = 0; step < 3; step++) // Newton
        t -= (3 * t - 1.938776F * t * t * t - skewness) / (3 - 3 * 1.938776F * t * t);
    const float u = sqrtf(2.4F - 12.0F / 7 * t * t);
    distances[0] = mean + deviation * (t - u);
    distances[1] = mean - deviation * 5 / 7 * t;
    distances[2] = mean + deviation * (t + u);
}

// Means of eighths of the sorted distances, drawn apart until they have the variance.
static void take_eighths(float distances[ALB_SHARES_MAX], float *sorted, int count, float mean, float deviation)
{
    float second = 0;
    for (int gap = 13; gap; gap /= 3) // Shell 1959
        for (int k = gap; k < count; k++)
            for (int at = k; at >= gap && sorted[at] < sorted[at - gap]; at -= gap) {
                const float held = sorted[at];
                sorted[at] = sorted[at - gap], sorted[at - gap] = held;
            }
    for (int k = 0; k < ALB_SHARES_MAX; k++) {
        distances[k] = -mean;
        for (int at = k * count / ALB_SHARES_MAX; at < (k + 1) * count / ALB_SHARES_MAX; at++)
            distances[k] += sorted[at] * (float)ALB_SHARES_MAX / (float)count;
        second += distances[k] * distances[k] / ALB_SHARES_MAX;
    }
    for (int k = 0; k < ALB_SHARES_MAX; k++)
        distances[k] = mean + distances[k] * (second > 0 ? deviation / sqrtf(second) : 1);
}

// A row's distances from those of the parts, whose own variance is added.
static void share_out(float distances[ALB_SHARES_MAX], int kind, float *of_parts, int count, float variance_of_part)
{
    float mean = 0, second = 0, third = 0;
    for (int part = 0; part < count; part++)
        mean += of_parts[part] / (float)count;
    for (int part = 0; part < count; part++) {
        const float off = of_parts[part] - mean;
        second += off * off / (float)count;
        third += off * off * off / (float)count;
    }
    const float deviation = sqrtf(second + variance_of_part);
    if (kind == ALB_LINK_THIRDS)
        take_thirds(distances, mean, deviation, fmaxf(fminf(third / (deviation * deviation * deviation), 1), -1));
    else
        take_eighths(distances, of_parts, count, mean, deviation);
}

// A patch is known to the products by the mean of its variances alone. What it has more along the line of sight moves
// it, as far as that changes s by a quarter.
static void lean(float distances[ALB_BLOCK], const float along_mm2[ALB_BLOCK], const alb_cluster *cluster,
                 const alb_scatter_kernel_needs *needs)
{
    for (int row = 0; row < ALB_BLOCK; row++) {
        const int bin = alb_scatter_kernel_bin(needs, distances[row]);
        const float *slopes = needs->slopes[bin], move = needs->leans[bin] * (along_mm2[row] - cluster->spread_mm2);
        const float most = 0.25F / fmaxf(fmaxf(slopes[0], slopes[1]), fmaxf(slopes[2], 1 / distances[row]));
        distances[row] += fmaxf(fminf(move, most), -most);
    }
}

void alb_viewer_distances(float distances[ALB_SHARES_MAX][ALB_BLOCK], const alb_viewer *v, const alb_wish *wished,
                          int kind)
{
    const alb_cluster *cluster = &v->forest->clusters[wished->cluster];
    alb_source parts[ALB_PARTS_MAX];
    float of_parts[ALB_PARTS_MAX][ALB_BLOCK], along_mm2[ALB_BLOCK];
    if (kind <= ALB_LINK_NEAR_PATCH) {
        memcpy(parts[0].at, cluster->centre_mm, sizeof parts[0].at);
        memcpy(parts[0].moments, cluster->moments, sizeof parts[0].moments);
        alb_viewer_measure(distances[0], along_mm2, v, &parts[0], wished->side == ALB_TRANSMISSION);
        if (kind >= ALB_LINK_PATCH)
            lean(distances[0], along_mm2, cluster, v->needs[wished->side]);
        return;
    }
    alb_vector t[3];
    alb_patch_triangle(t, v->patches, v->forest->patches[cluster->leaf]);
    for (int k = 0; k < 3; k++)
        t[k] = alb_sub(t[k], v->tree->middle_mm);
    const int count = alb_parts_most(cluster);
    const float share = alb_parts_cut(parts, cluster, t, count);
    for (int part = 0; part < count; part++)
        alb_viewer_measure(of_parts[part], along_mm2, v, &parts[part], wished->side == ALB_TRANSMISSION);
    for (int row = 0; row < ALB_BLOCK; row++) {
        float of_row[ALB_PARTS_MAX], shares[ALB_SHARES_MAX];
        for (int part = 0; part < count; part++)
            of_row[part] = of_parts[part][row];
        share_out(shares, kind, of_row, count, share * cluster->spread_mm2);
        for (int k = 0; k < alb_link_codes(kind); k++)
            distances[k][row] = shares[k];
    }
}

void alb_viewer_triangle(alb_vector t[3], const alb_viewer *v, const alb_cluster *cluster, int side, uint32_t row)
{
    const alb_vector p = v->patches->centroids[v->forest->patches[v->first_leaf + row]];
    const alb_vector axis = {(double)v->axes[0][row], (double)v->axes[1][row], (double)v->axes[2][row]};
    alb_patch_triangle(t, v->patches, v->forest->patches[cluster->leaf]);
    for (int k = 0; k < 3 && side == ALB_TRANSMISSION; k++)
        t[k] = alb_add(t[k], alb_times(alb_dot(axis, alb_sub(p, t[k])), axis));
}

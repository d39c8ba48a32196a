// Occlusion by spheres: on a ring of directions (theta) each sphere covers an arc of phi, |phi - phi_c| < acos((cos rho
// - cos theta cos theta_c) / (sin theta sin theta_c)); the arcs' union is integrated in closed form. Along theta
// between the rings where spheres begin and end, by the midpoint rule in t, theta = a + (b - a) sin^2(pi t/2), which
// takes the square roots of the outlines at both ends.
#include "scenes/sphere_cluster.h"
#include "base/random.h"
#include "render/sh.h"
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

enum { RINGS = 48, EDGES = 2 * SPHERE_CLUSTER_MAX };

sphere_cluster sphere_cluster_random(uint64_t seed, uint64_t index)
{
    alb_random random = alb_random_at(seed, 0, index);
    sphere_cluster cluster = {.count = 1 + (int)(5 * alb_random_uniform(&random))};
    double farthest = 0;
    for (int i = 0; i < cluster.count; i++) {
        double *c = cluster.centre[i], length = 2;
        cluster.radius[i] = 0.15 + 0.3 * alb_random_uniform(&random);
        while (length > 1) {
            for (int a = 0; a < 3; a++)
                c[a] = 2 * alb_random_uniform(&random) - 1;
            length = sqrt(c[0] * c[0] + c[1] * c[1] + c[2] * c[2]);
        }
        for (int a = 0; a < 3; a++)
            c[a] *= 1 - cluster.radius[i];
        farthest = fmax(farthest, length * (1 - cluster.radius[i]) + cluster.radius[i]);
    }
    for (int i = 0; i < cluster.count; i++) {
        cluster.radius[i] /= farthest;
        for (int a = 0; a < 3; a++)
            cluster.centre[i][a] /= farthest;
    }
    return cluster;
}

// Caps as the receiver sees the spheres.
typedef struct cap {
    double theta, phi, rho;
} cap;

typedef struct arc {
    double from, to;
} arc;

static int by_start(const void *a, const void *b)
{
    const double x = ((const arc *)a)->from, y = ((const arc *)b)->from;
    return (x > y) - (x < y);
}

static int by_value(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

// The union's arcs in [0, 2 pi], in order; their number.
static int cover(arc out[EDGES], const cap *caps, int count, double theta)
{
    arc all[EDGES];
    int found = 0, kept = 0;
    for (int i = 0; i < count; i++) {
        const double off = cos(caps[i].rho) - cos(theta) * cos(caps[i].theta), room = sin(theta) * sin(caps[i].theta);
        if (off >= room)
            continue;
        const double half = off <= -room ? M_PI : acos(off / room);
        const double from = caps[i].phi - half + (caps[i].phi < half ? 2 * M_PI : 0), to = from + 2 * half;
        all[found++] = (arc){from, fmin(to, 2 * M_PI)};
        if (to > 2 * M_PI)
            all[found++] = (arc){0, to - 2 * M_PI};
    }
    qsort(all, (size_t)found, sizeof *all, by_start);
    for (int i = 0; i < found; i++) {
        if (kept && all[i].from <= out[kept - 1].to)
            out[kept - 1].to = fmax(out[kept - 1].to, all[i].to);
        else
            out[kept++] = all[i];
    }
    return kept;
}

static void add_ring(double *coefficients, int order, const cap *caps, int count, double theta, double weight)
{
    double legendre[ALB_SH_ORDER_MAX * (ALB_SH_ORDER_MAX + 1) / 2];
    arc arcs[EDGES];
    const int found = cover(arcs, caps, count, theta);
    alb_sh_legendre(legendre, order, cos(theta), sin(theta));
    for (int m = 0; m < order && found; m++) {
        double cosine = 0, sine = 0; // of the union
        for (int i = 0; i < found; i++) {
            cosine += m ? (sin(m * arcs[i].to) - sin(m * arcs[i].from)) / m : arcs[i].to - arcs[i].from;
            sine += m ? (cos(m * arcs[i].from) - cos(m * arcs[i].to)) / m : 0;
        }
        for (int l = m; l < order; l++) {
            const double value = weight * sin(theta) * legendre[l * (l + 1) / 2 + m] * (m ? M_SQRT2 : 1);
            coefficients[alb_sh_index(l, m)] += value * cosine;
            if (m)
                coefficients[alb_sh_index(l, -m)] += value * sine;
        }
    }
}

void sphere_cluster_occlusion(double *coefficients, int order, const sphere_cluster *cluster, double distance)
{
    cap caps[SPHERE_CLUSTER_MAX];
    double edges[EDGES + 1] = {0};
    int count = 0;
    memset(coefficients, 0, (size_t)(order * order) * sizeof *coefficients);
    for (int i = 0; i < cluster->count; i++) {
        const double *c = cluster->centre[i], across = hypot(c[0], c[1]), along = c[2] + distance;
        cap *own = &caps[i];
        own->theta = atan2(across, along);
        own->phi = atan2(c[1], c[0]) + (c[1] < 0 ? 2 * M_PI : 0);
        own->rho = asin(cluster->radius[i] / hypot(across, along));
        edges[count++] = fabs(own->theta - own->rho);
        edges[count++] = own->theta + own->rho;
    }
    edges[count++] = 0;
    qsort(edges, (size_t)count, sizeof *edges, by_value);
    for (int i = 0; i + 1 < count; i++)
        for (int ring = 0; ring < RINGS; ring++) {
            const double t = (ring + 0.5) / RINGS, width = edges[i + 1] - edges[i], half = sin(M_PI / 2 * t);
            add_ring(coefficients, order, caps, cluster->count, edges[i] + width * half * half,
                     width * M_PI / 2 * sin(M_PI * t) / RINGS);
        }
}

// Vectors in three dimensions and rigid transforms. Lengths in mm. Names are b_from_a: p_b = b_from_a(p_a).
#pragma once
#include <math.h>

typedef struct alb_vector {
    double x, y, z;
} alb_vector;

typedef struct alb_transform {
    double rotation[3][3]; // row-major, orthonormal
    alb_vector translation;
} alb_transform;

static inline alb_vector alb_add(alb_vector a, alb_vector b) { return (alb_vector){a.x + b.x, a.y + b.y, a.z + b.z}; }
static inline alb_vector alb_sub(alb_vector a, alb_vector b) { return (alb_vector){a.x - b.x, a.y - b.y, a.z - b.z}; }
static inline alb_vector alb_times(double s, alb_vector a) { return (alb_vector){s * a.x, s * a.y, s * a.z}; }
static inline double alb_dot(alb_vector a, alb_vector b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
static inline alb_vector alb_cross(alb_vector a, alb_vector b)
{
    return (alb_vector){a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
static inline double alb_length(alb_vector a) { return sqrt(alb_dot(a, a)); }
// Zero stays zero.
static inline alb_vector alb_unit(alb_vector a)
{
    const double length = alb_length(a);
    return length > 0 ? alb_times(1 / length, a) : a;
}
// Rotates only; directions and normals.
static inline alb_vector alb_rotate(const alb_transform *t, alb_vector a)
{
    const double(*r)[3] = t->rotation;
    return (alb_vector){r[0][0] * a.x + r[0][1] * a.y + r[0][2] * a.z, r[1][0] * a.x + r[1][1] * a.y + r[1][2] * a.z,
                        r[2][0] * a.x + r[2][1] * a.y + r[2][2] * a.z};
}
static inline alb_vector alb_apply(const alb_transform *t, alb_vector a)
{
    return alb_add(alb_rotate(t, a), t->translation);
}
static inline alb_transform alb_inverse(const alb_transform *t)
{
    alb_transform inverse;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            inverse.rotation[i][j] = t->rotation[j][i];
    inverse.translation = alb_times(-1, alb_rotate(&inverse, t->translation));
    return inverse;
}
// Two unit tangents that make (t, b, n) right-handed. Duff et al. 2017, "Building an orthonormal basis, revisited".
static inline void alb_tangents(alb_vector *t, alb_vector *b, alb_vector n)
{
    const double s = copysign(1, n.z), a = -1 / (s + n.z), c = n.x * n.y * a;
    *t = (alb_vector){1 + s * n.x * n.x * a, s * c, -s * n.x};
    *b = (alb_vector){c, s + n.y * n.y * a, -n.y};
}

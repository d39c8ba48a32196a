// Rotations of batches, Rz(a) Ry(b) Rz(c) with Ry(b) = Rx(-90) Rz(b) Rx(90): a turn about z multiplies pairs +m, -m by
// cos m and sin m of the angle, quarter turns about x are constant and three quarters zero. Cosines and sines come from
// the axis' or quaternion's own components, each pair brought to length one by its hypotenuse: near the poles too,
// where sqrt(1 - z^2) has lost its digits, they are right to rounding (the phase of an axis that is +z or -z is zero).
#include "base/vector_clones.h"
#include "render/sh_lanes.h"
#include "render/sh_rotate.h"
#include <pthread.h>

// Rows of the quarter turn: the coefficients they read, and times what; `back` is the transpose.
typedef struct quarter {
    int begin[ALB_SH_COUNT_MAX + 1], column[4 * ALB_SH_COUNT_MAX];
    float value[4 * ALB_SH_COUNT_MAX];
} quarter;
static quarter forth, back;
static pthread_once_t once = PTHREAD_ONCE_INIT;

// From columns of unit vectors turned; what is below rounding is zero.
static void make_quarter(quarter *q, double sign)
{
    const double turn[3][3] = {{1, 0, 0}, {0, 0, -sign}, {0, sign, 0}};
    static double columns[ALB_SH_COUNT_MAX][ALB_SH_COUNT_MAX];
    for (int j = 0; j < ALB_SH_COUNT_MAX; j++) {
        double unit[ALB_SH_COUNT_MAX] = {0};
        unit[j] = 1;
        alb_sh_rotate(columns[j], unit, ALB_SH_ORDER_MAX, turn);
    }
    int count = 0;
    for (int i = 0; i < ALB_SH_COUNT_MAX; i++) {
        for (int j = 0; j < ALB_SH_COUNT_MAX; j++)
            if (fabs(columns[j][i]) > 1e-12) {
                q->column[count] = j;
                q->value[count++] = (float)columns[j][i];
            }
        q->begin[i + 1] = count;
    }
}

static void make_quarters(void)
{
    make_quarter(&forth, 1);
    make_quarter(&back, -1);
}

// cos and sin of one angle an item.
typedef struct angle {
    alb_lanes cosine, sine;
} angle;

// A quarter turn about x, to and fro by its sign: bands to l = 3 written out, those beyond from the table.
static inline __attribute__((always_inline)) void turn_x(alb_lanes *out, const alb_lanes *in, int order, float sign)
{
    const float half = 0.5F, h3 = 0.866025404F, q1 = 0.25F, q6 = 0.612372436F, q10 = 0.790569415F, q15 = 0.968245837F;
    out[0] = in[0];
    if (order > 1)
        out[1] = -sign * in[2], out[2] = sign * in[1], out[3] = in[3];
    if (order > 2) {
        out[4] = -sign * in[7], out[5] = -in[5], out[7] = sign * in[4];
        out[6] = -half * in[6] - h3 * in[8], out[8] = half * in[8] - h3 * in[6];
    }
    if (order > 3) {
        const alb_lanes a = sign * in[12], b = sign * in[14], c = sign * in[9], d = sign * in[11];
        out[9] = q10 * a - q6 * b, out[11] = q6 * a + q10 * b;
        out[12] = -q10 * c - q6 * d, out[14] = q6 * c - q10 * d;
        out[10] = -in[10], out[13] = -q1 * in[13] - q15 * in[15], out[15] = q1 * in[15] - q15 * in[13];
    }
    const quarter *q = sign > 0 ? &forth : &back;
    for (int i = 16; i < order * order; i++) {
        alb_lanes sum = q->value[q->begin[i]] * in[q->column[q->begin[i]]];
        for (int k = q->begin[i] + 1; k < q->begin[i + 1]; k++)
            sum += q->value[k] * in[q->column[k]];
        out[i] = sum;
    }
}

static inline __attribute__((always_inline)) void turn_z(alb_lanes *c, int order, const angle *a)
{
    alb_lanes re = a->cosine, im = a->sine;
    for (int m = 1; m < order; m++) {
        for (int l = m; l < order; l++) {
            const alb_lanes plus = c[alb_sh_index(l, m)], minus = c[alb_sh_index(l, -m)];
            c[alb_sh_index(l, m)] = re * plus - im * minus;
            c[alb_sh_index(l, -m)] = im * plus + re * minus;
        }
        const alb_lanes old = re;
        re = re * a->cosine - im * a->sine;
        im = im * a->cosine + old * a->sine;
    }
}

// x and y over their hypotenuse, which goes to `length`; 1 and 0 where both are zero.
static inline __attribute__((always_inline)) void make_angle(angle *a, alb_lanes *length, const alb_lanes *x,
                                                             const alb_lanes *y)
{
    const alb_lanes square = *x * *x + *y * *y, one = (alb_lanes){0} + 1;
    const alb_lanes where_zero = (alb_lanes)((square <= 0) & (alb_lanes_bits)one);
    float root[ALB_LANES];
    memcpy(root, &square, sizeof root);
#pragma GCC unroll 1
    for (int j = 0; j < ALB_LANES; j++)
        root[j] = sqrtf(root[j]);
    memcpy(length, root, sizeof root);
    const alb_lanes inverse = 1 / (*length + where_zero);
    a->cosine = *x * inverse + where_zero;
    a->sine = *y * inverse;
}

// phi and theta of axes.
static inline __attribute__((always_inline)) void axis_angles(angle *phi, angle *theta, const alb_lanes axis[3])
{
    alb_lanes sine, length;
    make_angle(phi, &sine, &axis[0], &axis[1]);
    make_angle(theta, &length, &axis[2], &sine);
}

typedef enum way { TO_AXIS, FROM_AXIS, QUATERNION } way;

static inline __attribute__((always_inline)) void turn_axis(alb_lanes *c, int order, const alb_lanes axis[3], way to)
{
    alb_lanes other[ALB_SH_COUNT_MAX];
    angle phi, theta;
    axis_angles(&phi, &theta, axis);
    if (to == TO_AXIS) {
        phi.sine = -phi.sine, theta.sine = -theta.sine;
        turn_z(c, order, &phi);
    }
    turn_x(other, c, order, 1);
    turn_z(other, order, &theta);
    turn_x(c, other, order, -1);
    if (to == FROM_AXIS)
        turn_z(c, order, &phi);
}

// w + iz is cos(b / 2) e^(i (a + c) / 2), y - ix is sin(b / 2) e^(i (a - c) / 2).
static inline __attribute__((always_inline)) void turn_quaternion(alb_lanes *c, int order, const alb_lanes q[4])
{
    alb_lanes other[ALB_SH_COUNT_MAX], cosine, sine, length;
    angle sum, difference, half, first, middle, last;
    const alb_lanes minus_x = -q[0];
    make_angle(&sum, &cosine, &q[3], &q[2]);
    make_angle(&difference, &sine, &q[1], &minus_x);
    make_angle(&half, &length, &cosine, &sine);
    middle.cosine = half.cosine * half.cosine - half.sine * half.sine;
    middle.sine = 2 * half.cosine * half.sine;
    first.cosine = sum.cosine * difference.cosine + sum.sine * difference.sine;
    first.sine = sum.sine * difference.cosine - sum.cosine * difference.sine;
    last.cosine = sum.cosine * difference.cosine - sum.sine * difference.sine;
    last.sine = sum.sine * difference.cosine + sum.cosine * difference.sine;
    turn_z(c, order, &first);
    turn_x(other, c, order, 1);
    turn_z(other, order, &middle);
    turn_x(c, other, order, -1);
    turn_z(c, order, &last);
}

static inline __attribute__((always_inline)) void turn_block(float *out, const float *in, int order, const float *by,
                                                             size_t stride, size_t items, way to)
{
    alb_lanes c[ALB_SH_COUNT_MAX], with[4];
    alb_lanes_load(c, in, stride, items, order * order);
    alb_lanes_load(with, by, stride, items, to == QUATERNION ? 4 : 3);
    if (to == QUATERNION)
        turn_quaternion(c, order, with);
    else
        turn_axis(c, order, with, to);
    alb_lanes_store(out, c, stride, items, order * order);
}

// The orders most in use are told apart for the compiler.
ALB_VECTOR_CLONES
static void turn_blocks(float *out, const float *in, int order, const float *by, size_t stride, size_t count, way to)
{
    for (size_t r = 0; r < count; r += ALB_LANES) {
        if (order == 4 && to == TO_AXIS)
            turn_block(out + r, in + r, 4, by + r, stride, count - r, TO_AXIS);
        else if (order == 4 && to == FROM_AXIS)
            turn_block(out + r, in + r, 4, by + r, stride, count - r, FROM_AXIS);
        else if (order == 4)
            turn_block(out + r, in + r, 4, by + r, stride, count - r, QUATERNION);
        else
            turn_block(out + r, in + r, order, by + r, stride, count - r, to);
    }
}

static void turn(float *out, const float *in, int order, const float *by, size_t stride, size_t count, way to)
{
    pthread_once(&once, make_quarters);
    turn_blocks(out, in, order, by, stride, count, to);
}

void alb_sh_to_axis_batch(float *out, const float *in, int order, const float *axes, size_t stride, size_t count)
{
    turn(out, in, order, axes, stride, count, TO_AXIS);
}

void alb_sh_from_axis_batch(float *out, const float *in, int order, const float *axes, size_t stride, size_t count)
{
    turn(out, in, order, axes, stride, count, FROM_AXIS);
}

void alb_sh_rotate_batch(float *out, const float *in, int order, const float *quaternions, size_t stride, size_t count)
{
    turn(out, in, order, quaternions, stride, count, QUATERNION);
}

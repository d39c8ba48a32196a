// Rotations of batches, Rz(a) Ry(b) Rz(c) with Ry(b) = Rx(-90) Rz(b) Rx(90): a turn about z multiplies pairs +m, -m by
// cos m and sin m of the angle, quarter turns about x are constant and three quarters zero. Cosines and sines come from
// the axis' or quaternion's own components, each pair brought to length one by its hypotenuse: near the poles too,
// where sqrt(1 - z^2) has lost its digits, they are right to rounding (the phase of an axis that is +z or -z is zero).
#include "render/sh_lanes.h"
#include "render/sh_rotate.h"
#include <pthread.h>

// A row of the quarter turn: the coefficients it reads, at most four up to l = 7, and times what; `back` is the
// transpose.
typedef struct row {
    int count, column[4];
    float value[4];
} row;
static row forth[ALB_SH_COUNT_MAX], back[ALB_SH_COUNT_MAX];
static pthread_once_t once = PTHREAD_ONCE_INIT;

// From columns of unit vectors turned; what is below rounding is zero.
static void make_quarter(row *rows, double sign)
{
    const double turn[3][3] = {{1, 0, 0}, {0, 0, -sign}, {0, sign, 0}};
    for (int j = 0; j < ALB_SH_COUNT_MAX; j++) {
        double column[ALB_SH_COUNT_MAX] = {0};
        column[j] = 1;
        alb_sh_rotate(column, column, ALB_SH_ORDER_MAX, turn);
        for (int i = 0; i < ALB_SH_COUNT_MAX; i++)
            if (fabs(column[i]) > 1e-12) {
                rows[i].column[rows[i].count] = j;
                rows[i].value[rows[i].count++] = (float)column[i];
            }
    }
}

static void make_quarters(void)
{
    make_quarter(forth, 1);
    make_quarter(back, -1);
}

// cos and sin of one angle an item.
typedef struct angle {
    alb_lanes cosine, sine;
} angle;

// out = p x + q y
ALB_LANES_INLINE void mix(alb_lanes out, float p, const alb_lanes x, float q, const alb_lanes y)
{
    ALB_EACH_LANE out[lane] = p * x[lane] + q * y[lane];
}

ALB_LANES_INLINE void mix_four(alb_lanes out, const float v[4], const alb_lanes a, const alb_lanes b, const alb_lanes c,
                               const alb_lanes d)
{
    ALB_EACH_LANE out[lane] = v[0] * a[lane] + v[1] * b[lane] + v[2] * c[lane] + v[3] * d[lane];
}

ALB_LANES_INLINE void multiply(alb_lanes out, float p, const alb_lanes x) { ALB_EACH_LANE out[lane] = p * x[lane]; }

// A quarter turn about x, to and fro by its sign: bands to l = 3 written out, those beyond from the table.
ALB_LANES_INLINE void turn_x(alb_lanes *out, alb_lanes *in, int order, float sign)
{
    const float h3 = 0.866025404F, q6 = 0.612372436F, q10 = 0.790569415F, q15 = 0.968245837F;
    multiply(out[0], 1, in[0]);
    if (order > 1) {
        multiply(out[1], -sign, in[2]);
        multiply(out[2], sign, in[1]);
        multiply(out[3], 1, in[3]);
    }
    if (order > 2) {
        multiply(out[4], -sign, in[7]);
        multiply(out[5], -1, in[5]);
        mix(out[6], -0.5F, in[6], -h3, in[8]);
        multiply(out[7], sign, in[4]);
        mix(out[8], -h3, in[6], 0.5F, in[8]);
    }
    if (order > 3) {
        mix(out[9], sign * q10, in[12], -sign * q6, in[14]);
        multiply(out[10], -1, in[10]);
        mix(out[11], sign * q6, in[12], sign * q10, in[14]);
        mix(out[12], -sign * q10, in[9], -sign * q6, in[11]);
        mix(out[13], -0.25F, in[13], -q15, in[15]);
        mix(out[14], sign * q6, in[9], -sign * q10, in[11]);
        mix(out[15], -q15, in[13], 0.25F, in[15]);
    }
    for (int i = 16; i < order * order; i++) {
        const row *r = sign > 0 ? &forth[i] : &back[i];
        if (r->count > 2)
            mix_four(out[i], r->value, in[r->column[0]], in[r->column[1]], in[r->column[2]], in[r->column[3]]);
        else
            mix(out[i], r->value[0], in[r->column[0]], r->value[1], in[r->column[1]]);
    }
}

// (re + i im) (x + i y)
ALB_LANES_INLINE void turn_pair(alb_lanes x, alb_lanes y, const alb_lanes re, const alb_lanes im)
{
    ALB_EACH_LANE
    {
        const float u = x[lane], v = y[lane], c = re[lane], s = im[lane];
        x[lane] = c * u - s * v;
        y[lane] = s * u + c * v;
    }
}

ALB_LANES_INLINE void turn_z(alb_lanes *c, int order, const angle *a)
{
    angle power = *a;
    for (int m = 1; m < order; m++) {
        for (int l = m; l < order; l++)
            turn_pair(c[alb_sh_index(l, m)], c[alb_sh_index(l, -m)], power.cosine, power.sine);
        turn_pair(power.cosine, power.sine, a->cosine, a->sine);
    }
}

// x and y over their hypotenuse, which goes to `length`; 1 and 0 where both are zero.
ALB_LANES_INLINE void make_angle(angle *a, alb_lanes length, const alb_lanes x, const alb_lanes y)
{
    ALB_EACH_LANE
    {
        const float n = sqrtf(x[lane] * x[lane] + y[lane] * y[lane]), zero = n > 0 ? 0 : 1, inverse = 1 / (n + zero);
        a->cosine[lane] = x[lane] * inverse + zero;
        a->sine[lane] = y[lane] * inverse;
        length[lane] = n;
    }
}

// phi and theta of axes.
ALB_LANES_INLINE void axis_angles(angle *phi, angle *theta, alb_lanes axis[3])
{
    alb_lanes sine, length;
    make_angle(phi, sine, axis[0], axis[1]);
    make_angle(theta, length, axis[2], sine);
}

typedef enum way { TO_AXIS, FROM_AXIS, QUATERNION } way;

ALB_LANES_INLINE void turn_axis(alb_lanes *c, int order, alb_lanes axis[3], way to)
{
    alb_lanes other[ALB_SH_COUNT_MAX];
    angle phi, theta;
    axis_angles(&phi, &theta, axis);
    if (to == TO_AXIS) {
        multiply(phi.sine, -1, phi.sine);
        multiply(theta.sine, -1, theta.sine);
        turn_z(c, order, &phi);
    }
    turn_x(other, c, order, 1);
    turn_z(other, order, &theta);
    turn_x(c, other, order, -1);
    if (to == FROM_AXIS)
        turn_z(c, order, &phi);
}

// w + iz is cos(b / 2) e^(i (a + c) / 2), y - ix is sin(b / 2) e^(i (a - c) / 2).
ALB_LANES_INLINE void turn_quaternion(alb_lanes *c, int order, alb_lanes q[4])
{
    alb_lanes other[ALB_SH_COUNT_MAX], cosine, sine, length, minus_x;
    angle sum, difference, middle, first, last;
    multiply(minus_x, -1, q[0]);
    make_angle(&sum, cosine, q[3], q[2]);
    make_angle(&difference, sine, q[1], minus_x);
    make_angle(&middle, length, cosine, sine);
    turn_pair(middle.cosine, middle.sine, middle.cosine, middle.sine);
    first = last = sum;
    turn_pair(first.cosine, first.sine, difference.cosine, difference.sine);
    multiply(difference.sine, -1, difference.sine);
    turn_pair(last.cosine, last.sine, difference.cosine, difference.sine);
    turn_z(c, order, &last);
    turn_x(other, c, order, 1);
    turn_z(other, order, &middle);
    turn_x(c, other, order, -1);
    turn_z(c, order, &first);
}

ALB_LANES_INLINE void turn_block(float *out, const float *in, int order, const float *by, size_t stride, size_t items,
                                 way to)
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

ALB_LANES_CLONES
static void turn_blocks(float *out, const float *in, int order, const float *by, size_t stride, size_t count, way to)
{
    for (size_t r = 0; r < count; r += ALB_LANES)
        turn_block(out + r, in + r, order, by + r, stride, count - r, to);
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

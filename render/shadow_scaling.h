// The scaling laws that shadow fields use, tabulated over k: made once and shared by all fields of one order.
#pragma once
#include "render/sh_scale.h"

enum { ALB_SHADOW_ORDER = 4, ALB_SHADOW_VALUES = ALB_SHADOW_ORDER * ALB_SHADOW_ORDER }; // of a receiver

// M between knots that are even in k / (1 + k), all the way from the middle to infinity, or for a sky in k.
typedef struct alb_shadow_table {
    int order_out, order_in, values;
    bool sky;     // knots in k, below 1
    float *knots; // [ALB_SHADOW_KNOTS][values]
} alb_shadow_table;
enum { ALB_SHADOW_KNOTS = 257 };

typedef struct alb_shadow_scaling {
    int order;               // of the occluders' samples
    alb_shadow_table outer;  // occlusion from nodes that have all of the object in front of them
    alb_shadow_table inner;  // occlusion from nodes that have it all around
    alb_shadow_table light;  // a light's radiance, order 4
    alb_shadow_table sky[2]; // mid-range radiance, from order 4 and from ALB_SH_ORDER_MAX
} alb_shadow_scaling;

// paper: occlusion as printed, of which from afar a constant remains; else windowed, and of order 4 regressed. Linear
// interpolation between 257 knots keeps every value of M within 5e-4.
bool alb_shadow_scaling_create(alb_shadow_scaling *scaling, int order, bool paper, alb_error *error);
void alb_shadow_scaling_free(alb_shadow_scaling *scaling);

// out = M(k) in, in the frame of the axis, each receiver with its own k >= 0 (of a sky: below 1). Structures of arrays
// of stride `stride`: in has order_in^2 rows, out order_out^2; transposed the other way round. `out` may be `in` where
// the orders are one.
void alb_shadow_scale(float *out, const alb_shadow_table *table, bool transposed, const float *in, const float *k,
                      size_t stride, size_t count);

// The exact integral of a profile over a patch about a point close to it, as a rule over the geometry alone.
#pragma once
#include "base/vector.h"
#include "render/scatter_kernel.h"

enum { ALB_RULE_NODES = 16 };

// integral s(|x - p|) dA = 2 pi sum weight / 32767 P(distance), distance = (code / 65536)^2 near_mm of the kernel.
typedef struct alb_rule {
    uint16_t codes[ALB_RULE_NODES];
    int16_t weights[ALB_RULE_NODES];
} alb_rule;

// The rule of the triangle about p, which no corner is further from than near_mm (formula: scatter_rule.c).
void alb_rule_find(alb_rule *rule, const alb_vector triangle[3], alb_vector p, double near_mm);
// integral: of the kernel's profiles over the triangle, RGB, no unit; not below zero.
void alb_rule_apply(double integral[3], const alb_rule *rule, const alb_scatter_kernel *kernel);

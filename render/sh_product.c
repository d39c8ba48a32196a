// Exact products through nodes: the factors are summed along directions, multiplied there, and projected by a rule that
// is exact for the degree of the whole product.
#include "render/sh_product.h"

typedef struct factors {
    const double *coefficients;
    int order;
    size_t count;
} factors;

static double value_along(const void *context, alb_vector direction)
{
    const factors *f = context;
    double product = 1;
    for (size_t k = 0; k < f->count; k++)
        product *= alb_sh_value(f->coefficients + k * (size_t)(f->order * f->order), f->order, direction);
    return product;
}

bool alb_sh_product(double *out, int out_order, const double *coefficients, int order, size_t count, alb_error *error)
{
    if (count > ALB_SH_DEGREE_MAX)
        return alb_fail(error, ALB_BAD_DATA, "a product of %zu functions: at most %d can be multiplied at once", count,
                        ALB_SH_DEGREE_MAX);
    const factors f = {coefficients, order, count};
    return alb_sh_project(out, out_order, (int)count * (order - 1), value_along, &f, error);
}

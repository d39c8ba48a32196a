// Exact products through nodes: factors are summed on a grid of Gauss nodes in cos theta times equal steps in phi,
// which integrates polynomials on the sphere up to its degree exactly, multiplied there, and projected.
#include "render/sh_product.h"
#include "base/memory.h"
#include "base/quadrature.h"
#include <stdlib.h>
#include <string.h>

// Sums at the nodes of one ring: product *= f, and what the ring adds to the projection.
static double value_at(const double *factors, int order, size_t count, alb_vector d)
{
    double product = 1;
    for (size_t f = 0; f < count; f++)
        product *= alb_sh_value(factors + f * (size_t)(order * order), order, d);
    return product;
}

bool alb_sh_product(double *out, int out_order, const double *factors, int order, size_t count, alb_error *error)
{
    if (count > ALB_SH_DEGREE_MAX || (int)count * (order - 1) + out_order - 1 > ALB_SH_DEGREE_MAX)
        return alb_fail(
            error, ALB_BAD_DATA,
            "a product of %zu functions of order %d to order %d is of degree above %d; multiply fewer at once", count,
            order, out_order, ALB_SH_DEGREE_MAX);
    const int degree = (int)count * (order - 1) + out_order - 1, rings = degree / 2 + 1, steps = degree + 1;
    double nodes[ALB_SH_DEGREE_MAX / 2 + 1], weights[ALB_SH_DEGREE_MAX / 2 + 1];
    double *basis = alb_allocate((size_t)(2 * out_order * out_order), sizeof *basis, error);
    if (!basis)
        return false;
    double *sum = basis + out_order * out_order;
    alb_quadrature_gauss(nodes, weights, rings, -1, 1);
    for (int i = 0; i < rings * steps; i++) {
        const double z = nodes[i / steps], s = sqrt(1 - z * z), phi = 2 * M_PI * (i % steps) / steps;
        const alb_vector d = {s * cos(phi), s * sin(phi), z};
        const double value = weights[i / steps] * 2 * M_PI / steps * value_at(factors, order, count, d);
        alb_sh_evaluate(basis, out_order, d);
        for (int k = 0; k < out_order * out_order; k++)
            sum[k] += value * basis[k];
    }
    memcpy(out, sum, (size_t)(out_order * out_order) * sizeof *out);
    free(basis);
    return true;
}

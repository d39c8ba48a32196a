// pi L / M = (1 - F(mu)) / n^2 I(mu) / (2 int (1 - F) I mu dmu), integral over what is not reflected totally, mu the
// cosine inside and I the radiance from within upon the face, from adding-doubling at its streams: a polynomial between
// them. The beam itself travels in the stream of the normal, with e = e^(-sigma_t d) and r the reflectance there
//   e / (1 - r^2 e^2) of it on the other face and r e^2 / (1 - r^2 e^2) on the lit one, and is taken off.
//
// Against Monte Carlo: tests/fit/test_exit_lobe.c. Stops being true with the adding-doubling (adding_doubling.c) and
// for light near the beam: within 3 transport mean free paths reflected light has other directions, by 2 %, than all of
// it together.
#include "fit/exit_lobe.h"
#include "fit/fresnel.h"
#include <math.h>

// Lagrange's polynomial through (x, y), `count` of them.
static double interpolate(const double *x, const double *y, int count, double at)
{
    double sum = 0;
    for (int i = 0; i < count; i++) {
        double term = y[i];
        for (int j = 0; j < count; j++)
            term *= j == i ? 1 : (at - x[j]) / (x[i] - x[j]);
        sum += term;
    }
    return sum;
}

void alb_exit_lobe_of(alb_exit_lobe *lobe, const alb_streams *streams, double absorption, double reduced_scattering,
                      double thickness)
{
    alb_layer layer;
    double within[2][ALB_STREAMS_MAX];
    const double n = streams->refractive_index, critical = sqrt(1 - 1 / (n * n));
    const int last = streams->count - 1;
    const double r = streams->reflectance[last],
                 e = exp(-(absorption + streams->scattering_per_reduced * reduced_scattering) * thickness),
                 beam = e / ((1 - r * r * e * e) * streams->cosine[last] * streams->weight[last]);
    int first = 0;
    while (streams->cosine[first] < critical)
        first++;
    alb_layer_create(&layer, streams, absorption, reduced_scattering, thickness);
    alb_streams_within(within, streams, &layer);
    *lobe = (alb_exit_lobe){.count = streams->count - first, .refractive_index = n};
    for (int side = 0; side < ALB_SIDES; side++) {
        double *radiance = lobe->radiance[side], through = 0;
        for (int i = 0; i < lobe->count; i++) {
            lobe->cosine[i] = streams->cosine[first + i];
            radiance[i] = within[side][first + i];
        }
        radiance[lobe->count - 1] -= beam * (side == ALB_REFLECTION ? r * e : 1);
        for (int i = 0; i < lobe->count; i++)
            through +=
                2 * (1 - streams->reflectance[first + i]) * streams->weight[first + i] * lobe->cosine[i] * radiance[i];
        for (int i = 0; i < lobe->count; i++)
            radiance[i] /= through;
    }
}

double alb_exit_lobe_ratio(const alb_exit_lobe *lobe, alb_side side, double cosine)
{
    const double n2 = lobe->refractive_index * lobe->refractive_index, mu = sqrt(1 - (1 - cosine * cosine) / n2);
    return (1 - alb_fresnel_inside(lobe->refractive_index, mu)) / n2 *
           interpolate(lobe->cosine, lobe->radiance[side], lobe->count, mu);
}

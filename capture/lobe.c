// From the cosines at which photons left to pi L / M: of a Lambertian face the share mu1^2 - mu0^2 of the light leaves
// between the cosines mu0 and mu1, so that the ratio of a bin is what left through it, over that share.
//
// Photons are few: every bin is replaced by the weighted straight line through those within a quarter of its own cosine
// and 0.2 (weights: the Lambertian share, to which the variance of a ratio is inverse), which takes the noise near the
// normal down to 2 / sqrt(photons that left). The table is scaled to keep the light: sum ratio * share = 1.
// Where it stops being true: all distances from the beam are given the same directions, which differ by 2 % at the
// normal within 3 mean free paths.
#include "capture/lobe.h"
#include <math.h>

static double middle(int i) { return (i + 0.5) / ALB_PHOTON_COSINES; }

static double share(int i) { return (2 * i + 1) / (double)(ALB_PHOTON_COSINES * ALB_PHOTON_COSINES); }

// Value at `at` of the weighted straight line through the bins about it.
static double line_at(const double *ratio, double at)
{
    const double reach = fmax(fmin(0.2, at / 4), 1.01 / ALB_PHOTON_COSINES);
    double w = 0, x = 0, xx = 0, y = 0, xy = 0;
    for (int i = 0; i < ALB_PHOTON_COSINES; i++) {
        const double d = middle(i) - at;
        if (fabs(d) > reach)
            continue;
        w += share(i), x += share(i) * d, xx += share(i) * d * d, y += share(i) * ratio[i],
            xy += share(i) * d * ratio[i];
    }
    return (xx * y - x * xy) / (w * xx - x * x);
}

void alb_lobe_from_photons(alb_lobe *lobe, const alb_photon_tally *tally, int face)
{
    double left = 0, ratio[ALB_PHOTON_COSINES], kept = 0;
    *lobe = (alb_lobe){0};
    for (int i = 0; i < ALB_PHOTON_COSINES; i++)
        left += tally->cosine[face][i];
    if (!(left > 0))
        return;
    for (int i = 0; i < ALB_PHOTON_COSINES; i++)
        ratio[i] = tally->cosine[face][i] / (left * share(i));
    for (int i = 0; i < ALB_PHOTON_COSINES; i++) {
        lobe->ratio[i] = fmax(line_at(ratio, middle(i)), 0);
        kept += lobe->ratio[i] * share(i);
    }
    for (int i = 0; i < ALB_PHOTON_COSINES; i++)
        lobe->ratio[i] /= kept;
    lobe->traced = true;
}

double alb_lobe_value(const alb_lobe *lobe, double cosine)
{
    if (!lobe->traced)
        return 1;
    const double at = fmin(fmax(cosine * ALB_PHOTON_COSINES - 0.5, 0), ALB_PHOTON_COSINES - 1);
    const int i = at < ALB_PHOTON_COSINES - 2 ? (int)at : ALB_PHOTON_COSINES - 2;
    return lobe->ratio[i] + (at - i) * (lobe->ratio[i + 1] - lobe->ratio[i]);
}

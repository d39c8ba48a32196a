// Fresnel's equations from inside and their moments. Inside cosine mu, outside cosine t = sqrt(1 - n^2 (1 - mu^2)):
//   F = (((n mu - t)/(n mu + t))^2 + ((mu - n t)/(mu + n t))^2) / 2,  1 below the critical cosine sqrt(1 - 1/n^2).
// The moments are integrated over the angle theta outside, sin theta = n sqrt(1 - mu^2), where F is smooth (over mu it
// has the slope of a square root at the critical angle): mu dmu = -sin theta cos theta dtheta / n^2; what reflects
// totally is added in closed form. Simpson's rule in v, pi/2 - theta = pi/2 v^2 (as n nears 1 all of F lies near the
// horizon): 1e-9 of R1 and R2 for n from 1.0001 to 4.
// A as in Haskell et al. 1994 (J. Opt. Soc. Am. A 11, 2727). Stops being true for rough faces and polarised light.
#include "fit/fresnel.h"
#include <math.h>

double alb_fresnel_inside(double n, double mu)
{
    const double sine_2 = n * n * (1 - mu * mu);
    if (sine_2 >= 1)
        return 1;
    const double t = sqrt(1 - sine_2), s = (n * mu - t) / (n * mu + t), p = (mu - n * t) / (mu + n * t);
    return 0.5 * (s * s + p * p);
}

static alb_fresnel_moments integrate(double n)
{
    enum { STEPS = 512 };
    const double critical = sqrt(1 - 1 / (n * n)), h = 1.0 / STEPS;
    double first = 0, second = 0;
    for (int i = 1; i < STEPS; i++) { // nothing at either end: sin theta cos theta is 0
        const double v = i * h, sine = cos(M_PI / 2 * v * v), cosine = sin(M_PI / 2 * v * v),
                     mu = sqrt(1 - sine * sine / (n * n));
        const double part = (i % 2 ? 4 : 2) * h / 3 * M_PI * v * alb_fresnel_inside(n, mu) * sine * cosine / (n * n);
        first += part;
        second += part * mu;
    }
    alb_fresnel_moments out = {critical * critical + 2 * first, critical * critical * critical + 3 * second, 0};
    out.boundary = (1 + out.second) / (1 - out.first);
    return out;
}

// Forms of free index ask for the same three indices (a central difference) at every distance: each thread keeps the
// last few.
alb_fresnel_moments alb_fresnel_moments_at(double n)
{
    enum { KEPT = 4 };
    static _Thread_local struct {
        double index;
        alb_fresnel_moments moments;
    } kept[KEPT];
    static _Thread_local int oldest;
    for (int i = 0; i < KEPT; i++)
        if (kept[i].index == n)
            return kept[i].moments;
    const alb_fresnel_moments moments = integrate(n);
    kept[oldest].index = n;
    kept[oldest].moments = moments;
    oldest = (oldest + 1) % KEPT;
    return moments;
}

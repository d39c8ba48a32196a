#include "base/random.h"
#include <math.h>

static uint64_t splitmix(uint64_t *x)
{
    uint64_t z = (*x += 0x9e3779b97f4a7c15u);
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return z ^ (z >> 31);
}

alb_random alb_random_at(uint64_t seed, uint64_t stream, uint64_t index)
{
    alb_random random;
    uint64_t x = seed;
    x = splitmix(&x) ^ stream;
    x = splitmix(&x) ^ index;
    for (int i = 0; i < 4; i++)
        random.state[i] = splitmix(&x);
    return random;
}

double alb_random_normal(alb_random *random)
{
    const double u = 1 - alb_random_uniform(random), v = alb_random_uniform(random);
    return sqrt(-2 * log(u)) * cos(2 * M_PI * v);
}

// Hormann 1993, "The transformed rejection method for generating Poisson random variables", algorithm PTRS.
static double poisson_large(alb_random *random, double mean)
{
    const double b = 0.931 + 2.53 * sqrt(mean), a = -0.059 + 0.02483 * b, inverse_alpha = 1.1239 + 1.1328 / (b - 3.4);
    const double v_r = 0.9277 - 3.6224 / (b - 2), log_mean = log(mean);
    for (;;) {
        const double u = alb_random_uniform(random) - 0.5, v = 1 - alb_random_uniform(random);
        const double us = 0.5 - fabs(u), k = floor((2 * a / us + b) * u + mean + 0.43);
        if (us >= 0.07 && v <= v_r)
            return k;
        if (k < 0 || (us < 0.013 && v > us))
            continue;
        if (log(v * inverse_alpha / (a / (us * us) + b)) <= k * log_mean - mean - lgamma(k + 1))
            return k;
    }
}

double alb_random_poisson(alb_random *random, double mean)
{
    if (!(mean > 0))
        return 0;
    if (mean >= 30)
        return poisson_large(random, mean);
    double k = 0, product = alb_random_uniform(random);
    for (const double limit = exp(-mean); product > limit; k++)
        product *= alb_random_uniform(random);
    return k;
}

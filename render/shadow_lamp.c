// With samples s of the light's surface, a_s their vector area, L_s their radiance, to a receiver x with normal n
//     E = sum_s g V L_s max(0, -a_s.d) max(0, n.d) / sqrt(r^4 + (a_s / pi)^2),      d = (y_s - x) / r
// The root keeps what is near finite: a disc's pi L where it is touched. As its own cosine each sample is exact where a
// light sets. V is what the occluders leave, the product over them of 1 - w O along the line to the middle of the
// samples' group (shadow_along.h), w as in shadow_block.c, and of a receiver's own object by rays from its probes
// (shadow_glimpse.h): nothing of the light or of a product is cut to order 4, only what an occluder's samples say of a
// line is blurred. g is what the light's own parts leave of the group towards x.
//
// Without samples, after Zhou et al. 2005 and Wang et al. 2006, E = integral P L: P is the cosine through all occluders
// in order 4 (shadow_block.h), L is k^-2 M^E(k) of the light's sample; as M^E(k) is M^V(1/k) transposed, P is scaled
// instead, once for three colours.
//
// Stops being true: V and g are one for each group of samples; what a light hides of itself is as seen from afar.
#include "render/shadow_lamp.h"
#include "base/vector_clones.h"
#include "render/sh_rotate.h"
#include "render/shadow_along.h"
#include <string.h>

enum {
    BLOCK = ALB_SHADOW_BLOCK,
    VALUES = ALB_SHADOW_VALUES,
    ORDER = ALB_SHADOW_ORDER,
    GROUPS = ALB_SHADOW_EMITTER_GROUPS
};
#define NEAR_BEGINS 0.035F // a sample's area, over pi, over its distance squared: where few samples err by 1 %

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

static void add_product(float (*irradiance)[3], const alb_shadow_block *b, const alb_shadow_world *world,
                        const alb_shadow_field *light)
{
    float transfer[VALUES * BLOCK], sum[BLOCK][3] = {{0}};
    alb_shadow_receivers v;
    alb_shadow_receivers_at(&v, light, b->points, b->count);
    alb_shadow_block_transfer(transfer, b, world, &light->sphere, v.distances_mm);
    alb_sh_to_axis_batch(transfer, transfer, ORDER, v.axes, BLOCK, b->count);
    for (int shell = 0; shell < light->shell_count; shell++)
        if (alb_shadow_receivers_weigh(&v, light, shell))
            add_shell(sum, transfer, &v, light, shell, &world->laws->light, b->count);
    for (size_t r = 0; r < b->count; r++)
        for (int c = 0; c < 3; c++)
            irradiance[r][c] += sum[r][c] > 0 ? sum[r][c] : 0;
}

// What a light sends to a block, nothing between; lengths in radii of the light about its centre.
typedef struct glow {
    float points[3 * BLOCK], normals[3 * BLOCK];
    float groups[GROUPS][3][BLOCK]; // irradiance
    const alb_shadow_sphere *light;
    size_t light_index;
    float directions[3 * BLOCK]; // to the middle of a group
} glow;

ALB_VECTOR_CLONES static void add_sample(float (*restrict sum)[BLOCK], float *restrict nearest, const float *points,
                                         const float *normals, const alb_shadow_emitter_sample *s, size_t count)
{
    const float *px = points, *py = points + BLOCK, *pz = points + 2 * BLOCK;
    const float *nx = normals, *ny = normals + BLOCK, *nz = normals + 2 * BLOCK;
    for (size_t r = 0; r < count; r++) {
        const float x = s->at[0] - px[r], y = s->at[1] - py[r], z = s->at[2] - pz[r];
        const float square = x * x + y * y + z * z + 1e-12F;
        const float sent = -(s->area[0] * x + s->area[1] * y + s->area[2] * z),
                    above = nx[r] * x + ny[r] * y + nz[r] * z, size = s->size / square;
        const float weight =
            (sent > 0 ? sent : 0) * (above > 0 ? above : 0) / (square * square * sqrtf(1 + size * size));
        nearest[r] = nearest[r] > size ? nearest[r] : size;
        for (int c = 0; c < 3; c++)
            sum[c][r] += s->radiance[c] * weight;
    }
}

// Where the few samples are so near that they are seen apart the many take over.
static void add_group(glow *g, const alb_shadow_emitter *e, size_t group, size_t count)
{
    float many[3][BLOCK] = {{0}}, nearest[BLOCK] = {0}, ignored[BLOCK] = {0}, most = 0;
    float(*sum)[BLOCK] = g->groups[group];
    for (size_t f = e->first_few[group]; f < e->first_few[group + 1]; f++)
        add_sample(sum, nearest, g->points, g->normals, &e->few[f], count);
    for (size_t r = 0; r < count; r++)
        most = fmaxf(most, nearest[r]);
    if (most <= NEAR_BEGINS)
        return;
    for (size_t m = e->first_many[e->first_few[group]]; m < e->first_many[e->first_few[group + 1]]; m++)
        add_sample(many, ignored, g->points, g->normals, &e->many[m], count);
    for (size_t r = 0; r < count; r++) {
        const float share = fminf(fmaxf(nearest[r] / NEAR_BEGINS - 1, 0), 1);
        for (int c = 0; c < 3; c++)
            sum[c][r] += share * (many[c][r] - sum[c][r]);
    }
}

static void find_glow(glow *g, const alb_shadow_block *b, const alb_shadow_emitter *emitter,
                      const alb_shadow_sphere *sphere)
{
    memset(g->groups, 0, sizeof g->groups);
    for (size_t r = 0; r < b->count; r++) {
        const alb_vector p = alb_times(1 / sphere->radius_mm, alb_sub(b->points[r], sphere->centre_mm)),
                         n = b->normals[r];
        g->points[r] = (float)p.x, g->points[BLOCK + r] = (float)p.y, g->points[2 * BLOCK + r] = (float)p.z;
        g->normals[r] = (float)n.x, g->normals[BLOCK + r] = (float)n.y, g->normals[2 * BLOCK + r] = (float)n.z;
    }
    g->light = sphere;
    for (size_t group = 0; group < emitter->group_count; group++)
        add_group(g, emitter, group, b->count);
}

// Whether an occluder stands before a group of samples, seen from a receiver. Around a light smaller than itself it is
// a shade: of the light as a whole, also of what is before the shade's middle.
static float before(const glow *g, const alb_shadow_block *b, const alb_shadow_world *world, size_t occluder, size_t r,
                    const alb_shadow_sphere *group)
{
    const alb_shadow_sphere *sphere = &world->occluders[occluder].sphere;
    const double mm = b->distances_mm[occluder][r],
                 part = alb_shadow_share_before(sphere, group, mm, alb_length(alb_sub(group->centre_mm, b->points[r]))),
                 larger = fmin(2 * sphere->radius_mm / g->light->radius_mm - 1, 1);
    if (!(larger > 0 && part < 1))
        return (float)part;
    const double whole_mm = alb_length(alb_sub(g->light->centre_mm, b->points[r]));
    return (float)fmax(part, larger * alb_shadow_share_before(sphere, g->light, mm, whole_mm));
}

ALB_VECTOR_CLONES static void aim(float *restrict directions, const float *restrict points, const float *middle,
                                  size_t count)
{
    for (size_t r = 0; r < count; r++) {
        const float x = middle[0] - points[r], y = middle[1] - points[BLOCK + r], z = middle[2] - points[2 * BLOCK + r];
        const float scale = 1 / sqrtf(x * x + y * y + z * z + 1e-12F);
        directions[r] = scale * x;
        directions[BLOCK + r] = scale * y;
        directions[2 * BLOCK + r] = scale * z;
    }
}

// visible[r] *= what occluders leave of a group: a receiver's own by rays of its probes, others along the line.
static void find_visible(float *visible, const glow *g, const alb_shadow_block *b, const alb_shadow_world *world,
                         size_t group, const float *wanted)
{
    const alb_shadow_sphere *sphere = &world->emitters[g->light_index].groups[group];
    float occlusion[BLOCK], lines[BLOCK];
    for (size_t r = 0; r < b->count; r++) {
        const size_t o = b->own[r];
        if (o != SIZE_MAX && wanted[r] > 0)
            visible[r] *= alb_shadow_glimpse_at(&world->glimpses[o], &world->surfaces[o], g->light_index, group,
                                                b->first + r - world->first_vertices[o]);
    }
    for (size_t o = 0; o < world->occluder_count; o++) {
        for (size_t r = 0; r < b->count; r++)
            lines[r] = b->own[r] != o ? wanted[r] : 0;
        alb_shadow_along(occlusion, &world->occluders[o], b->raised[o], g->directions, lines, world->surfaces != NULL,
                         b->count);
        for (size_t r = 0; r < b->count; r++)
            if (occlusion[r] > 0)
                visible[r] *= 1 - before(g, b, world, o, r, sphere) * occlusion[r];
    }
}

static void add_samples(float (*irradiance)[3], const alb_shadow_block *b, const alb_shadow_world *world, size_t j)
{
    glow g;
    float visible[BLOCK], wanted[BLOCK];
    const alb_shadow_emitter *emitter = &world->emitters[j];
    g.light_index = j;
    find_glow(&g, b, emitter, &world->lights[j].sphere);
    for (size_t group = 0; group < emitter->group_count; group++) {
        const float(*sent)[BLOCK] = (const float(*)[BLOCK])g.groups[group];
        float most = 0;
        for (size_t r = 0; r < b->count; r++)
            most = fmaxf(most, wanted[r] = sent[0][r] + sent[1][r] + sent[2][r]);
        if (!(most > 0))
            continue;
        aim(g.directions, g.points, emitter->middles[group], b->count);
        for (size_t r = 0; r < b->count; r++) {
            const float *d = g.directions + r;
            const alb_vector away = {-(double)d[0], -(double)d[BLOCK], -(double)d[2 * BLOCK]};
            visible[r] = wanted[r] > 0 ? alb_shadow_emitter_seen(emitter, group, away) : 0;
        }
        find_visible(visible, &g, b, world, group, wanted);
        for (size_t r = 0; r < b->count; r++)
            for (int c = 0; c < 3; c++)
                irradiance[r][c] += visible[r] * sent[c][r];
    }
}

void alb_shadow_lamp_add(float (*irradiance)[3], const alb_shadow_block *b, const alb_shadow_world *world, size_t j)
{
    if (world->emitters)
        add_samples(irradiance, b, world, j);
    else
        add_product(irradiance, b, world, &world->lights[j]);
}

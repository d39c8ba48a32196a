// A vertex takes from its probes p, weights w_p (shadow_surface.c), for each group of a light's samples
//     V = sum w_p cos_p V_p / sum w_p cos_p      V_p: 1 where the ray to the middle of the group is free
// so that probes for which the group has set say nothing. Stops being true between probes where a shadow's edge lies.
#include "render/shadow_glimpse.h"
#include "base/memory.h"
#include <stdlib.h>
#include <string.h>

enum { GROUPS = ALB_SHADOW_EMITTER_GROUPS };

bool alb_shadow_glimpse_create(alb_shadow_glimpse *glimpse, const alb_shadow_surface *surface, size_t light_count,
                               alb_error *error)
{
    *glimpse = (alb_shadow_glimpse){.probe_count = surface->probes.count, .light_count = light_count};
    glimpse->shares = alb_allocate(light_count * surface->probes.count * GROUPS, sizeof *glimpse->shares, error);
    return glimpse->shares != NULL;
}

void alb_shadow_glimpse_free(alb_shadow_glimpse *glimpse)
{
    free(glimpse->shares);
    *glimpse = (alb_shadow_glimpse){0};
}

static bool hides_itself(const alb_shadow_surface *surface)
{
    for (size_t i = 0; i < ALB_SHADOW_VALUES * surface->probes.count; i++)
        if (surface->seen[i] != 0)
            return true;
    return false;
}

static void look(float (*shares)[2], const alb_shadow_surface *surface, size_t probe, alb_vector normal,
                 const alb_shadow_emitter *emitter, bool hides)
{
    const alb_vector at = surface->mesh.vertices[surface->probes.vertices[probe]],
                     from = alb_add(at, alb_times(256 * surface->tracer.slack_mm, normal));
    for (size_t g = 0; g < emitter->group_count; g++) {
        const alb_vector to = emitter->groups[g].centre_mm;
        const double cosine = surface->buried[probe] ? 0 : alb_dot(alb_unit(alb_sub(to, from)), normal);
        shares[g][0] = (float)fmax(cosine, 0);
        shares[g][1] = cosine > 0 && !(hides && alb_tracer_blocked(&surface->tracer, from, to)) ? (float)cosine : 0;
    }
}

void alb_shadow_glimpse_take(alb_shadow_glimpse *glimpse, const alb_shadow_surface *surface, const alb_vector *normals,
                             const alb_shadow_emitter *emitter, size_t light)
{
    float(*shares)[2] = glimpse->shares + light * glimpse->probe_count * GROUPS;
    const bool hides = hides_itself(surface);
#pragma omp parallel for schedule(dynamic, 8)
    for (size_t p = 0; p < glimpse->probe_count; p++)
        look(shares + p * GROUPS, surface, p, normals[surface->probes.vertices[p]], emitter, hides);
}

float alb_shadow_glimpse_at(const alb_shadow_glimpse *glimpse, const alb_shadow_surface *surface, size_t light,
                            size_t group, size_t vertex)
{
    const float(*shares)[2] = (const float(*)[2])glimpse->shares + light * glimpse->probe_count * GROUPS + group;
    float all = 0, seen = 0;
    for (int k = 0; k < ALB_SHADOW_PROBE_NEIGHBOURS; k++) {
        const float weight = surface->probes.weights[vertex][k],
                    *share = shares[surface->probes.neighbours[vertex][k] * GROUPS];
        all += weight * share[0];
        seen += weight * share[1];
    }
    return all > 0 ? seen / all : 1;
}

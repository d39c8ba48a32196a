// Even over the sphere, a Fibonacci lattice of N: heights 1 - (2 q + 1) / N, each turned on by the golden angle.
//     S_i = 4 pi / N sum over rays q that meet something of Y_i(d_q)
// Stops being true for what is narrower than the lattice, some sqrt(4 pi / N).
#include "render/shadow_lattice.h"
#include "base/memory.h"
#include "render/sh.h"
#include <stdlib.h>
#include <string.h>

bool alb_shadow_lattice_create(alb_shadow_lattice *lattice, int count, int order, alb_error *error)
{
    const size_t values = (size_t)(order * order);
    double basis[ALB_SH_COUNT_MAX];
    *lattice = (alb_shadow_lattice){.count = count, .order = order};
    if (!(lattice->directions = alb_allocate((size_t)count, sizeof *lattice->directions, error)) ||
        !(lattice->basis = alb_allocate((size_t)count * values, sizeof *lattice->basis, error))) {
        alb_shadow_lattice_free(lattice);
        return false;
    }
    for (int q = 0; q < count; q++) {
        const double z = 1 - (2 * q + 1.0) / count, turn = M_PI * (3 - sqrt(5)) * q, r = sqrt(1 - z * z);
        lattice->directions[q] = (alb_vector){r * cos(turn), r * sin(turn), z};
        alb_sh_evaluate(basis, order, lattice->directions[q]);
        for (size_t i = 0; i < values; i++)
            lattice->basis[(size_t)q * values + i] = (float)(4 * M_PI / count * basis[i]);
    }
    return true;
}

void alb_shadow_lattice_free(alb_shadow_lattice *lattice)
{
    free(lattice->directions);
    free(lattice->basis);
    *lattice = (alb_shadow_lattice){0};
}

bool alb_shadow_lattice_look(float *out, alb_vector *from, const alb_shadow_lattice *lattice, const alb_tracer *tracer)
{
    const size_t values = (size_t)(lattice->order * lattice->order);
    double nearest_mm = INFINITY;
    int backs = 0, towards = 0;
    memset(out, 0, values * sizeof *out);
    for (int q = 0; q < lattice->count; q++) {
        alb_hit hit;
        if (!alb_tracer_closest(&hit, tracer, *from, lattice->directions[q]))
            continue;
        backs += !hit.front;
        if (hit.distance_mm < nearest_mm)
            nearest_mm = hit.distance_mm, towards = q;
        for (size_t i = 0; i < values; i++)
            out[i] += lattice->basis[(size_t)q * values + i];
    }
    if (2 * backs <= lattice->count)
        return true;
    *from = alb_add(*from, alb_times(nearest_mm + 256 * tracer->slack_mm, lattice->directions[towards]));
    return false;
}

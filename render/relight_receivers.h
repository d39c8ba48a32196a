// Receivers: groups of neighbouring patches that get nearly the same light from other patches, so that one list of hits
// serves them all.
#pragma once
#include "render/radiosity.h"

typedef struct alb_receivers {
    size_t count;
    uint32_t *first, *members; // patches of receiver r: members[first[r] .. first[r + 1])
    alb_hit_rows rows;         // of each receiver: patches, then the sky, then backs, as those of form factors
    float (*values)[4];        // scratch of a product: what patches send out; zero for the sky and backs
    alb_rgb *gathered;         // scratch of a product: mean over the hits of each receiver
} alb_receivers;

enum { ALB_RECEIVER_PATCHES = 4, ALB_RECEIVER_RAYS = 192 };

// Quarters of the equations' clusters or so, those taken apart in whose patches light differs: given irradiances
// bounced[0 .. light_count) that patches send each other, and the length |B| of the solutions that they belong to,
// until what the means over receivers miss of them, times the row sums of S', is below error_wanted |B|, rms over the
// lights. It fails where there is no memory for it.
bool alb_receivers_create(alb_receivers *receivers, const alb_radiosity *equations, alb_rgb *const *bounced,
                          const double (*lengths)[3], size_t light_count, double error_wanted, alb_error *error);
void alb_receivers_free(alb_receivers *receivers);
size_t alb_receivers_bytes(const alb_receivers *receivers);
// Fills receivers->gathered from receivers->values.
void alb_receivers_gather(const alb_receivers *receivers);

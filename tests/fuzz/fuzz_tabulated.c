// Profiles that are tables: fit/tabulated.c.
#include "fit/material.h"
#include "fuzz.h"

#include <math.h>

bool fuzz_accepts(const uint8_t *bytes, size_t size, alb_error *error)
{
    alb_profile profile;
    if (!alb_profile_read_table(&profile, fuzz_file(bytes, size), error))
        return false;
    const double total = alb_profile_total(&profile);
    double before = 0;
    fuzz_law(total >= 0 && total < 1, "less light leaves than falls in");
    for (double r = 0; r < 1e6; r = 1.3 * r + 1e-3) {
        const double value = alb_profile_value(&profile, r), disc = alb_profile_disc(&profile, r);
        fuzz_law(value >= 0 && isfinite(value), "a profile is nowhere negative");
        fuzz_law(disc >= before * (1 - 1e-9) && 2 * M_PI * disc <= total * (1 + 1e-9), "light only adds up");
        before = disc;
    }
    fuzz_law(alb_profile_fastest(&profile) >= 0, "it falls off");
    alb_profile_free(&profile);
    return true;
}

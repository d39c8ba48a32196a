// material.json: fit/material.c.
#include "fit/material.h"
#include "fuzz.h"

#include <math.h>

bool fuzz_accepts(const uint8_t *bytes, size_t size, alb_error *error)
{
    alb_material material = {0};
    if (!alb_material_read(&material, fuzz_file(bytes, size), error))
        return false;
    fuzz_law(material.channels >= 1 && material.channels <= 3, "one to three channels");
    for (int side = 0; side < ALB_SIDES; side++)
        for (int c = 0; c < material.channels; c++) {
            const alb_fitted *fitted = &material.fitted[side][c];
            if (fitted->profile.form == ALB_FORM_NONE)
                continue;
            fuzz_law(fitted->profile.form < ALB_FORMS, "a form that there is");
            for (int p = 0; p < alb_form_parameter_count(fitted->profile.form); p++)
                fuzz_law(isfinite(fitted->profile.parameters[p]), "a parameter is finite");
            fuzz_law(alb_profile_value(&fitted->profile, 1) >= 0, "a profile is nowhere negative");
        }
    return true;
}

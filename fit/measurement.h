// Everything one fit made: per side and channel the readings, the forward model and the outcome, and the material.
#pragma once
#include "base/json.h"
#include "fit/choose.h"
#include "fit/properties.h"

typedef struct alb_measurement {
    bool measured;
    alb_readings readings;
    double exit_cosine; // to the normal, of the line of sight to their centre; 0: they are taken as exitance
    alb_operator forward;
    alb_common_sd common;
    alb_outcome outcome;
} alb_measurement;

typedef struct alb_fitting {
    alb_material
        material; // name, thickness_mm, refractive_index, channels and their names; fitted is filled by alb_fitting_run
    bool absolute; // values are in units of the incident flux
    alb_measurement sides[ALB_SIDES][3];
    alb_properties_basis basis;   // common_sd is filled by alb_fitting_run
    alb_properties properties[3]; // filled by alb_fitting_run
} alb_fitting;

// Fits every side and channel whose readings and forward model are there.
bool alb_fitting_run(alb_fitting *fitting, alb_error *error);
// Absorption and scattering from the totals of the material's sides and what is common to their readings;
// alb_fitting_run ends with it.
void alb_fitting_find_properties(alb_fitting *fitting);
void alb_fitting_free(alb_fitting *fitting);

// Puts the content of material.json into an open object.
void alb_material_put(alb_json *json, const alb_fitting *fitting);
// folder/material.json
bool alb_material_write(const alb_fitting *fitting, const alb_provenance *provenance, const char *folder,
                        alb_error *error);
// folder/report/fit.csv, fit.svg, fit.html and fit.json, which holds all that the page shows. `notes` are sentences for
// the reader, separated by line breaks.
bool alb_fitting_report(const alb_fitting *fitting, const alb_provenance *provenance, const char *notes,
                        const char *folder, alb_error *error);

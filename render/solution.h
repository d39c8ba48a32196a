// A scene solved: every step from patches to radiosity, with what each took and the balance of light.
#pragma once
#include "render/radiosity.h"
#include "render/scene.h"

typedef enum alb_stage {
    ALB_STAGE_TRACER,
    ALB_STAGE_FORM_FACTORS,
    ALB_STAGE_LIGHTS,
    ALB_STAGE_SCATTERING,
    ALB_STAGE_SOLVE,
    ALB_STAGES
} alb_stage;
extern const char *const alb_stage_names[ALB_STAGES];

// Where the light goes, in units of flux. In the sum, in = absorbed + escaped + lost + imbalance. The imbalance is the
// sampling error of the form factors (their rows are exact, their reciprocity is statistical); zero where patches do
// not see each other.
typedef struct alb_balance {
    double in[3];       // arrives from the lights and small lamps, or is emitted by large ones
    double absorbed[3]; // inside bodies and on opaque patches
    double escaped[3];  // leaves by the sky
    double lost[3];     // falls on the backs of patches
} alb_balance;

typedef struct alb_solution {
    alb_patches patches;
    alb_tracer tracer;
    alb_form_factors factors;
    alb_scatter scatter;
    alb_radiosity equations;
    double (*irradiance)[3]; // direct, of the lights
    double (*exitance)[3];   // emitted by lamps
    bool lamps_direct;       // small lamps: their light is in the irradiance
    double (*radiosity)[3];  // all that leaves
    double (*across)[3];     // the part of it that crossed a slab with smooth faces; NULL where there is none
    alb_radiosity_report report;
    double bound;              // how far the radiosity may be from its equations' exact solution, as a share of power
    double rays_error_percent; // of the irradiance by rays, rms, stated from their halves; NAN: a single ray
    double irradiance_error_percent; // the same of all irradiance, that of the lights with it
    double stated_error_percent;     // of all light, rms: irradiance and sampled scattering at random, the bound on top
    double row_sum, column_sum;      // largest of S'
    alb_balance balance;
    double seconds[ALB_STAGES];
    size_t bytes[ALB_STAGES];
} alb_solution;

// The scene is borrowed for the life of the solution. Fails where its parts fail; refuses scattering that creates
// light.
bool alb_solution_create(alb_solution *solution, const alb_scene *scene, alb_error *error);
void alb_solution_free(alb_solution *solution);
// The same meshes and materials under the scene's lights and exitances as they are now: lights and solve alone. A
// failure leaves the radiosity undefined, and the solution fit for another try.
bool alb_solution_relight(alb_solution *solution, const alb_scene *scene, alb_error *error);
// The same meshes under the scene's surfaces and lights as they are now: scattering is rewritten, rays stay.
bool alb_solution_rematerial(alb_solution *solution, const alb_scene *scene, alb_error *error);

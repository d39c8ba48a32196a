// The accounts of a solution that stands.
#pragma once
#include "render/solution.h"

// The relative error that scattering is made for, of what even light sends out: half of what the scene asks of all,
// between 0.1 and 0.5 percent. No more, so that coarse links make no energy; no less, for their memory.
double alb_solution_scatter_error(const alb_scene *scene);
// Writes the solution's bound, errors, column sum, balance and `across` from its radiosity, small lamps not yet added,
// and its report. ALB_NO_MEMORY; the radiosity stays.
bool alb_solution_account(alb_solution *solution, const alb_scene *scene, alb_error *error);

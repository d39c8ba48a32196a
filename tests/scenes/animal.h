// A quadruped of blended capsules, 160 mm long, that stands or gallops. x forward, z up, feet at z = 0.
#pragma once
#include "render/mesh.h"

// Standing at `feet`, looking along +x. bumps_mm: height of bumps 12 mm apart on the skin; 0 for none.
bool animal_add(alb_mesh *mesh, alb_vector feet, double cell_mm, double bumps_mm, uint16_t group, alb_error *error);
// The same faces bent into a gallop at `phase` of a stride, 0 to 1.
bool animal_gallop_add(alb_mesh *mesh, alb_vector feet, double cell_mm, double phase, uint16_t group, alb_error *error);

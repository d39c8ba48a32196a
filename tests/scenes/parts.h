// What the five scenes share: surfaces, lights and a camera put into an alb_scene.
#pragma once
#include "render/scene.h"

// S = a1 exp(-b1 r) + a2 exp(-b2 r) (Sheng et al. 2014, sec. 6) of each channel: its total 2 pi (a1/b1^2 + a2/b2^2) and
// the slower decay; the faster one is four times that and carries half.
alb_surface surface_translucent(const char *name, const double total[3], const double decay_per_mm[3]);
alb_surface surface_opaque(const char *name, double r, double g, double b);

// Copies of the lists; the usual solver settings: 256 rays, residual 1e-3, seed 1.
bool scene_furnish(alb_scene *scene, const alb_surface *surfaces, size_t surface_count, const alb_light *lights,
                   size_t light_count, alb_error *error);
// A box of outward faces with edges near edge_mm, closed.
bool scene_add_box(alb_scene *scene, alb_vector centre, alb_vector size, double turn_deg, double edge_mm, bool inward,
                   uint16_t group, alb_error *error);

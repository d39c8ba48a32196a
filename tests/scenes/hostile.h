// Meshes that break radiosity programs, as scenes of a few hundred patches: a sound room or object with one kind of
// damage, in several variants (degrees, places, random numbers).
#pragma once
#include "render/scene.h"

typedef struct hostile_kind {
    const char *name;
    int variants;
    bool enclosed; // a room closed but for the damage: no light should escape
    // Variants 0 .. variants - 1. Free with alb_scene_free.
    bool (*create)(alb_scene *scene, int variant, alb_error *error);
} hostile_kind;

extern const hostile_kind hostile_kinds[];
extern const int hostile_kind_count;

// The kind of that name; NULL where there is none.
const hostile_kind *hostile_find(const char *name);

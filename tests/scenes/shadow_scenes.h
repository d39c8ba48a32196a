// The four animated scenes of soft shadows (Wang et al. 2006, figs. 8 to 11), re-made with free geometry of the same
// counts: vertices of the model and of the plane. Lengths in mm, z up.
#pragma once
#include "render/scene.h"

typedef struct shadow_scene {
    const char *name, *what;
    size_t model_vertices, plane_vertices; // of the paper's scene
    double paper_fps;
    int frames;
    // Frame 0 .. frames - 1: the same faces, other vertices and lights. Free with alb_scene_free.
    bool (*create)(alb_scene *scene, int frame, alb_error *error);
} shadow_scene;

enum { SHADOW_SCENES = 4 };
extern const shadow_scene shadow_scenes[SHADOW_SCENES];

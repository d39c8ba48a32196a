// The five scenes that radiosity is measured on, generated: any number of patches, the same bytes every time. Lengths
// in mm. The stand-ins follow the scenes of Sheng et al. 2014, section 7, in content and count, not in shape.
#pragma once
#include "render/scene.h"

typedef struct test_scene {
    const char *name, *what;
    size_t patches; // of the full scene
    int frames;
    // Builds frame 0 .. frames - 1 with edges 1/detail as long, so about detail^2 as many patches. Free with
    // alb_scene_free.
    bool (*create)(alb_scene *scene, double detail, int frame, alb_error *error);
} test_scene;

enum { TEST_SCENES = 5 };
extern const test_scene test_scenes[TEST_SCENES];

// The detail at which the scene has about that many patches.
double test_scene_detail(const test_scene *scene, size_t patches);

bool scene_cornell(alb_scene *scene, double detail, int frame, alb_error *error);
bool scene_bowls(alb_scene *scene, double detail, int frame, alb_error *error);
bool scene_chess(alb_scene *scene, double detail, int frame, alb_error *error);
bool scene_rose(alb_scene *scene, double detail, int frame, alb_error *error);
bool scene_gallop(alb_scene *scene, double detail, int frame, alb_error *error);

// Two animals of translucent stone gallop side by side over the ground, half a stride apart: 48 frames are one stride.
#include "scenes/animal.h"
#include "scenes/parts.h"
#include "scenes/scenes.h"

enum { GROUND, JADE, QUARTZ, SURFACES };

bool scene_gallop(alb_scene *scene, double detail, int frame, alb_error *error)
{
    const double totals[2][3] = {{0.28, 0.44, 0.36}, {0.42, 0.36, 0.36}};
    const double decays[2][3] = {{0.45, 0.3, 0.4}, {0.3, 0.4, 0.4}};
    const alb_surface surfaces[SURFACES] = {surface_opaque("ground", 0.4, 0.36, 0.3),
                                            surface_translucent("jade", totals[0], decays[0]),
                                            surface_translucent("quartz", totals[1], decays[1])};
    const alb_light lights[2] = {
        {.kind = ALB_LIGHT_ENVIRONMENT, .radiance = {0.3, 0.34, 0.4}},
        {.kind = ALB_LIGHT_POINT, .position_mm = {200, -260, 380}, .flux = {3e6, 2.8e6, 2.5e6}}};
    const double phase = frame / 48.0;
    *scene = (alb_scene){.camera = alb_camera_look_at((alb_vector){60, -390, 170}, (alb_vector){0, 0, 55},
                                                      (alb_vector){0, 0, 1}, 38, 640, 440)};
    if (scene_furnish(scene, surfaces, SURFACES, lights, 2, error) &&
        scene_add_box(scene, (alb_vector){0, 0, -11}, (alb_vector){460, 320, 10}, 0, 8 / detail, false, GROUND,
                      error) &&
        animal_gallop_add(&scene->mesh, (alb_vector){25, -48, 0}, 1.65 / detail, phase, JADE, error) &&
        animal_gallop_add(&scene->mesh, (alb_vector){-25, 48, 0}, 1.65 / detail, phase + 0.5, QUARTZ, error))
        return true;
    alb_scene_free(scene);
    return false;
}

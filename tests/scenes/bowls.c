// Three bowls with walls of 5 mm and a bumpy animal, each of its own wax or stone, 0.5 mm above a table under an even
// sky and a lamp.
#include "scenes/animal.h"
#include "scenes/parts.h"
#include "scenes/scenes.h"
#include "scenes/shapes.h"

enum { TABLE, GREEN, WHITE, ROSE, WAX, SURFACES };
enum { ARC = 24 };

// Outside from the middle of the foot up to the rim, over its rounding, and down the inside. Spheres about (0, centre).
static int bowl_outline(double outline[][2], double radius, double wall)
{
    int n = 0;
    const double rim = 100 * M_PI / 180, foot = 14 * M_PI / 180; // angles from straight down
    outline[n][0] = 0, outline[n++][1] = 0;
    const double sink = radius * cos(foot);
    for (int k = 0; k <= ARC; k++) {
        const double angle = foot + (rim - foot) * k / ARC;
        outline[n][0] = radius * sin(angle), outline[n++][1] = sink - radius * cos(angle);
    }
    const double middle = radius - wall / 2;
    for (int k = 1; k < 6; k++) { // half a circle over the rim
        const double turn = M_PI * k / 6, r = middle + wall / 2 * cos(turn), along = wall / 2 * sin(turn);
        outline[n][0] = r * sin(rim) + along * cos(rim);
        outline[n++][1] = sink - r * cos(rim) + along * sin(rim);
    }
    for (int k = ARC; k > 0; k--) {
        const double angle = rim * k / ARC, r = radius - wall;
        outline[n][0] = r * sin(angle), outline[n++][1] = sink - r * cos(angle);
    }
    outline[n][0] = 0, outline[n++][1] = sink - (radius - wall);
    return n;
}

bool scene_bowls(alb_scene *scene, double detail, int frame, alb_error *error)
{
    (void)frame;
    const double totals[4][3] = {{0.3, 0.46, 0.34}, {0.48, 0.46, 0.42}, {0.48, 0.33, 0.33}, {0.45, 0.4, 0.34}};
    const double decays[4][3] = {{0.4, 0.25, 0.35}, {0.15, 0.17, 0.2}, {0.2, 0.35, 0.35}, {0.25, 0.3, 0.4}};
    const alb_surface surfaces[SURFACES] = {
        surface_opaque("table", 0.35, 0.25, 0.18), surface_translucent("green glass", totals[0], decays[0]),
        surface_translucent("white stone", totals[1], decays[1]),
        surface_translucent("rose quartz", totals[2], decays[2]), surface_translucent("wax", totals[3], decays[3])};
    const alb_light lights[2] = {
        {.kind = ALB_LIGHT_ENVIRONMENT, .radiance = {0.25, 0.3, 0.4}},
        {.kind = ALB_LIGHT_POINT, .position_mm = {-320, 240, 380}, .flux = {3e6, 2.8e6, 2.4e6}}};
    const alb_vector feet[3] = {{-135, 35, 0.5}, {10, 110, 0.5}, {150, 25, 0.5}};
    const double radius[3] = {62, 70, 56};
    *scene = (alb_scene){.camera = alb_camera_look_at((alb_vector){40, -420, 270}, (alb_vector){0, 10, 35},
                                                      (alb_vector){0, 0, 1}, 38, 640, 440)};
    bool ok =
        scene_furnish(scene, surfaces, SURFACES, lights, 2, error) &&
        scene_add_box(scene, (alb_vector){0, 0, -10}, (alb_vector){560, 440, 20}, 0, 8.2 / detail, false, TABLE, error);
    for (int k = 0; ok && k < 3; k++) {
        double outline[2 * ARC + 10][2];
        const int count = bowl_outline(outline, radius[k], 5);
        ok = shape_lathe(&scene->mesh, (const double(*)[2])outline, count, feet[k], 2.9 / detail, (uint16_t)(GREEN + k),
                         error);
    }
    if (ok && animal_add(&scene->mesh, (alb_vector){10, -65, 0.5}, 2.04 / detail, 1, WAX, error))
        return true;
    alb_scene_free(scene);
    return false;
}

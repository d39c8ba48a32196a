// A box of 550 mm, open in front, with a lamp in its ceiling; a tall block of marble and an opaque cube stand 1 mm
// above the floor, so that no two faces coincide. y up the picture is z here: x right, y away, z up.
#include "scenes/parts.h"
#include "scenes/scenes.h"
#include "scenes/shapes.h"

enum { WHITE, RED, GREEN, LAMP, MARBLE, SURFACES };
static const double side = 550;

static bool add_walls(alb_mesh *mesh, double edge_mm, alb_error *error)
{
    const alb_vector x = {side, 0, 0}, y = {0, side, 0}, z = {0, 0, side}, o = {0};
    const int cells = (int)fmax(5, 5 * round(side / edge_mm / 5)); // the lamp's edges lie on the lattice
    const size_t ceiling = mesh->face_count;
    if (!shape_sheet(mesh, z, y, x, cells, cells, WHITE, error))
        return false;
    for (size_t f = ceiling; f < mesh->face_count; f++) { // the middle fifth of the ceiling shines
        double mean_x = 0, mean_y = 0;
        for (int k = 0; k < 3; k++) {
            mean_x += mesh->vertices[mesh->faces[f][k]].x / 3;
            mean_y += mesh->vertices[mesh->faces[f][k]].y / 3;
        }
        if (fabs(mean_x / side - 0.5) < 0.1 && fabs(mean_y / side - 0.5) < 0.1)
            mesh->groups[f] = LAMP;
    }
    return shape_sheet(mesh, o, x, y, cells, cells, WHITE, error) && // floor
           shape_sheet(mesh, y, x, z, cells, cells, WHITE, error) && // back
           shape_sheet(mesh, o, y, z, cells, cells, RED, error) &&   // left
           shape_sheet(mesh, x, z, y, cells, cells, GREEN, error) && // right
           alb_mesh_weld(mesh, error);
}

bool scene_cornell(alb_scene *scene, double detail, int frame, alb_error *error)
{
    (void)frame;
    const double total[3] = {0.86, 0.82, 0.75}, decay[3] = {0.05, 0.065, 0.09};
    alb_surface surfaces[SURFACES] = {
        [WHITE] = surface_opaque("white", 0.74, 0.73, 0.7),     [RED] = surface_opaque("red", 0.6, 0.06, 0.05),
        [GREEN] = surface_opaque("green", 0.13, 0.45, 0.1),     [LAMP] = surface_opaque("lamp", 0.7, 0.7, 0.7),
        [MARBLE] = surface_translucent("marble", total, decay),
    };
    for (int c = 0; c < 3; c++)
        surfaces[LAMP].exitance[c] = c == 0 ? 40 : c == 1 ? 34 : 24;
    *scene = (alb_scene){.camera = alb_camera_look_at((alb_vector){side / 2, -800, side / 2},
                                                      (alb_vector){side / 2, 0, side / 2}, (alb_vector){0, 0, 1}, 38,
                                                      480, 480)};
    if (scene_furnish(scene, surfaces, SURFACES, NULL, 0, error) && add_walls(&scene->mesh, 15.7 / detail, error) &&
        scene_add_box(scene, (alb_vector){185, 350, 166}, (alb_vector){160, 160, 330}, 18, 7.07 / detail, false, MARBLE,
                      error) &&
        scene_add_box(scene, (alb_vector){365, 180, 83.5}, (alb_vector){165, 165, 165}, -17, 12 / detail, false, WHITE,
                      error))
        return true;
    alb_scene_free(scene);
    return false;
}

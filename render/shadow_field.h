// A shadow field: what an object hides, or how it shines, around it. Sampled at the nodes of a grid on a sphere outside
// the object and, if asked for, on shells inside its bounding sphere; each sample is a function on the sphere of
// directions in the world's frame, as spherical harmonics (render/sh.h). Zhou et al. 2005; one radius and scaling
// instead of many radii: Wang et al. 2006. Fields of different objects are independent.
#pragma once
#include "render/mesh.h"
#include "render/sh.h"
#include "render/shadow_grid.h"
#include "render/shadow_sphere.h"
#include "render/shadow_view.h"

enum {
    ALB_SHADOW_INNER_MAX = 6,
    ALB_SHADOW_OUTER_MAX = 6,
    ALB_SHADOW_SHELLS_MAX = ALB_SHADOW_INNER_MAX + ALB_SHADOW_OUTER_MAX + 1,
    ALB_SHADOW_PROBES_MAX = 4096,
};

// Fields know of probes only that their number is within bounds: who lights with fields makes the surfaces.
typedef struct alb_shadow_settings {
    int order;       // of the samples, 2 to ALB_SH_ORDER_MAX; receivers get order 4
    int cells;       // of the grid, a side of a cube's face
    int pixels;      // of a picture, a side
    double distance; // of the first shell outside from the middle, in radii of the bounding sphere
    int outer;       // shells outside, 1 to ALB_SHADOW_OUTER_MAX
    int inner;       // shells inside, 0 to ALB_SHADOW_INNER_MAX; occlusion only
    bool far;        // one more at 2.9 radii, beyond the others, of order 8 on half the cells: from afar finer bands
                     // matter more than nodes do; occlusion only
    int rays;        // from each inner node
    int probes;      // on the object's own surface (shadow_surface.h), 0 to ALB_SHADOW_PROBES_MAX; occlusion only
    bool packed;     // samples as bytes: a third of the memory at order 4, off by 1/254 of their largest coefficient
    double cluster;  // vertices within about so many radii move as one in pictures from outside; 0: each for itself
} alb_shadow_settings;
// Order 4, 8 cells, 64 pixels, one shell at 1.1 radii, none inside or far, 256 rays, 1200 probes, 0.04.
extern const alb_shadow_settings alb_shadow_defaults;
// Six shells and 40 pixels: what a light shows of itself changes with the distance more than a silhouette does.
extern const alb_shadow_settings alb_shadow_light_settings;
typedef struct alb_shadow_shell {
    double radius; // in radii of the bounding sphere
    int order, cells;
    bool turns;   // the far one: samples are in the frames of their nodes' axes and turn with the receiver's
    size_t first; // of its samples among all
} alb_shadow_shell;

typedef struct alb_shadow_field {
    alb_shadow_settings settings;
    alb_shadow_sphere sphere;
    int channels;                                   // 1: occlusion, 3: radiance
    int shell_count;                                // inner + outer + far
    alb_shadow_shell shells[ALB_SHADOW_SHELLS_MAX]; // by radius, ascending
    float *samples;                                 // [shell][node], each as alb_shadow_sample_put has it
    size_t sample_count;                            // floats
    size_t moved;                     // inner nodes that lie inside the object: they see from just outside of it
    struct alb_shadow_studio *studio; // what pictures are taken with
} alb_shadow_field;

// The mesh's faces are copied; vertices come with every sample. face_radiance: NULL for an occluder, or of each face of
// a light. `name` is for messages, borrowed. ALB_BAD_DATA: settings out of bounds, no faces.
bool alb_shadow_field_create(alb_shadow_field *field, const alb_shadow_settings *settings, const alb_mesh *mesh,
                             const float (*face_radiance)[3], const char *name, alb_error *error);
void alb_shadow_field_free(alb_shadow_field *field);
// Takes the samples of the object as it is now: the created mesh with other vertices. Fails as
// alb_shadow_sphere_follow does; the samples are then those of before.
bool alb_shadow_field_sample(alb_shadow_field *field, const alb_vector *vertices, alb_error *error);
size_t alb_shadow_field_bytes(const alb_shadow_field *field);

// The samples of a shell interpolated at a direction from the middle: out[channel][order^2], order that of the shell,
// in the world's frame; of one that turns in the frame of the axis -direction (sh_rotate.h), and one channel.
void alb_shadow_field_at(float *out, const alb_shadow_field *field, int shell, alb_vector direction);

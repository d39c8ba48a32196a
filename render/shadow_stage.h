// A scene as shadow fields see it: the objects that cast shadows, the lights and skies, the vertices that receive.
#pragma once
#include "render/scene.h"
#include "render/shadow_light.h"

typedef struct alb_shadow_stage {
    alb_shadow_settings settings; // of occluders; where lights have a surface their order is ALB_SH_ORDER_MAX
    bool paper;                   // scaling as printed
    uint32_t (*faces)[3];         // of the scene for which the fields were made
    uint16_t *groups;
    size_t face_count, vertex_count;
    bool under_skies;             // whether there were any: without them shells that lights make no use of are left out
    alb_shadow_field *fields;     // of the occluders and then of the lights
    alb_shadow_emitter *emitters; // of the lights, unless as printed
    size_t *objects;              // index of each in the scene
    char (*names)[32];
    size_t occluder_count, light_count;
    alb_shadow_transport transport; // of what is rigid, for the skies
    bool *of_body;                  // whether each occluder is part of it
    alb_shadow_surface *surfaces;   // of the occluders, if settings have probes
    alb_shadow_glimpse *glimpses;   // of the surfaces, if there are emitters
    size_t *first_vertices;         // of each occluder
    alb_shadow_sky *skies;
    size_t sky_count;
    alb_shadow_laws laws;
    int laws_order;             // for which they were made; 0: none
    alb_vector *normals;        // of the vertices: means over their faces by area
    float (*irradiance)[3];     // of the vertices
    double transport_s;         // of making it
    double sampling_s, light_s; // of the latest frame
    alb_shadow_seconds seconds; // of light_s, by threads
} alb_shadow_stage;

// Lights every vertex of the scene. A stage starts with all zero but settings and paper. Frames of a sequence keep
// their fields, and with them their bounding spheres, as long as the faces stay the same. Fails where a light is a
// point, a spot or a projector, which have no soft shadows (ALB_BAD_DATA), where there is no light at all, and where
// its parts fail, also where what is rigid does not move as one body; the stage then makes new fields at the next try.
bool alb_shadow_stage_light(alb_shadow_stage *stage, const alb_scene *scene, alb_error *error);
void alb_shadow_stage_free(alb_shadow_stage *stage);
// Other settings from the next frame on.
void alb_shadow_stage_set(alb_shadow_stage *stage, const alb_shadow_settings *settings);
// What alb_shadow_irradiance was given; borrows from the stage.
alb_shadow_world alb_shadow_stage_world(const alb_shadow_stage *stage);

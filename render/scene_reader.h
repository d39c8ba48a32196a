// What the readers of a scene's parts share.
#pragma once
#include "base/file.h"
#include "base/record.h"
#include "render/scene.h"

enum { ALB_SCENE_LONGEST_MM = 10000000 }; // the largest length a scene may state

typedef struct alb_scene_reader {
    alb_scene *scene;
    alb_provenance *provenance;
    const char *folder; // of SCENE.json
    int frame;
    alb_error *error;
} alb_scene_reader;

// The file that a key names: its path, entered in the provenance.
bool alb_scene_input(char path[ALB_PATH_SIZE], alb_scene_reader *in, alb_node node, const char *key);
bool alb_scene_vector(alb_vector *out, alb_node node, const char *key, alb_error *error);

// The materials first, so that objects can refer to them by name.
bool alb_scene_read_surfaces(alb_scene_reader *in, alb_node root);
bool alb_scene_read_objects(alb_scene_reader *in, alb_node root);

// A scene: what render reads. SCENE.json, strict:
//   {"format": 1,
//    "objects": [{"mesh": "block.obj", "mm_per_unit": 30, "translate_mm": [0,0,0], "subdivide_mm": 2,
//                 "material": "wax" | "materials": {"name in the mesh": "material", ...}},
//                {"shape": "box", "size_mm": [60,60,10], "centre_mm": [0,0,-5], "cells": [40,40,6], "grading": 8,
//                 "inward": false, "material": "wax", "subdivide_mm": 2},
//                {"shape": "sphere", "radius_mm": 30, "centre_mm": [0,0,0], "subdivisions": 4, "inward": false,
//                 "material": "wax"}],
//    "materials": {"wall": {"reflectance": [r,g,b]}, "lamp": {"reflectance": [..], "exitance": [..]},
//                  "wax": {"measured": "wax/material.json", "path": "slab" | "solid"},
//                  "marble": {"dipole": {"absorption_per_mm": [..], "reduced_scattering_per_mm": [..],
//                                        "refractive_index": 1.5, "finish": "smooth" | "ground"}},
//                  "milk": {"tabulated": {"reflection": ["r.csv", "g.csv", "b.csv"],
//                                         "transmission": [.., .., ..], "thickness_mm": 2}},
//                  "petal": {"multipole": {as a dipole, "thickness_mm": 2}}},
//    "lights": [{"kind": "point", "position_mm": [..], "flux": [..]},
//               {"kind": "spot", "position_mm": [..], "direction": [..], "half_angle_deg": 10, "flux": [..]},
//               {"kind": "projector", "centre_mm": [..], "direction": [..], "blur_sd_mm": 0.1, "flux": [..],
//                "diameter_mm": 1 | "pixel_mm": 0.25, "diameter_px": 4},
//               {"kind": "environment", "radiance": [..] | "file": "sky.exr", "centre_mm": [..], "radius_mm": 500}],
//              | "lights.json", which holds {"format": 1, "lights": [as here]},
//    "camera": {"calibration": "SESSION", "side": "reflection"} |
//              {"position_mm": [..], "look_at_mm": [..], "up": [0,1,0], "vertical_field_deg": 40,
//               "width": 640, "height": 480},
//    "rays_per_patch": 256, "error_percent": 1, "memory_mb": 4096, "residual": 1e-4, "seed": 1, "frames": 1}
// mm_per_unit 1, translate_mm 0, subdivide_mm none, grading 1, inward false, path "solid", blur_sd_mm 0, finish
// "smooth", lights none, rays_per_patch 256, memory_mb 4096, residual 1e-4 and seed 1 are what stands where nothing is
// written. rays_per_patch is 2 or more: its halves tell the error. With error_percent, rows start at rays_per_patch (64
// where nothing is written) and grow until the rms error of the irradiance by rays is that or every row has
// ALB_RAYS_REFINED_MAX. Rays beyond memory_mb lie in a temporary file. With frames above 1 every run of # in the name
// of a file stands for the frame's number, 0 to frames - 1, with zeros in front. For --method shadow objects take
// "shadow": "casts" (what stands where nothing is written) | "receives" and "rigid": true for what moves as one body
// with all that is rigid, and an environment with radius_mm lies on a sphere of that radius instead of infinitely far
// away. Paths are relative to the file. Units are the user's as long as they agree: flux 1 makes the picture radiance
// per incident flux, 1/(mm^2 sr).
#pragma once
#include "base/camera.h"
#include "base/json.h"
#include "render/light.h"
#include "render/scatter.h"

enum { ALB_OBJECTS_MAX = 256, ALB_SURFACES_MAX = 256, ALB_LIGHTS_MAX = 64 };
enum { ALB_RAYS_REFINED_FROM = 64, ALB_RAYS_REFINED_MAX = 4096 };
enum { ALB_FRAMES_MAX = 100000 };

// The vertices of one object in the scene's mesh.
typedef struct alb_object {
    size_t first_vertex, vertex_count;
    bool receives_only; // casts no shadow: ground, walls
    bool rigid;         // moves with all others that are, as one body
} alb_object;

static inline bool alb_object_owns(const alb_object *object, size_t vertex)
{
    return vertex >= object->first_vertex && vertex - object->first_vertex < object->vertex_count;
}

typedef struct alb_scene {
    alb_mesh mesh; // all objects, mm; groups index surfaces. Objects share no vertices
    alb_object *objects;
    size_t object_count;
    alb_surface *surfaces;
    size_t surface_count;
    alb_light *lights;
    size_t light_count;
    alb_camera camera;
    int rays_per_patch;
    bool rays_given;      // in the file
    double error_percent; // 0: as many rays as rays_per_patch says
    size_t memory_bytes;  // 0: no limit
    double residual;
    uint64_t seed;
    int frames;      // of the sequence; 1: a still
    int body_inputs; // of the provenance's inputs those, the first, that meshes and materials were read from
} alb_scene;

// Reads the scene and all it refers to; every file read is added to the provenance's inputs. Of a sequence the first
// frame.
bool alb_scene_read(alb_scene *scene, alb_provenance *provenance, const char *path, alb_error *error);
// Any frame of a sequence, 0 to frames - 1.
bool alb_scene_read_frame(alb_scene *scene, alb_provenance *provenance, const char *path, int frame, alb_error *error);
// `name` with each run of # replaced by the number, as many digits as there are #, zeros in front; more where it is
// longer. False: the result is longer than a path may be.
bool alb_scene_frame_name(char out[ALB_PATH_SIZE], const char *name, int frame, alb_error *error);
// As error_percent in the file does: rows start at few rays where the file does not say how many.
void alb_scene_ask_error(alb_scene *scene, double percent);
void alb_scene_free(alb_scene *scene);

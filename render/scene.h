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
//                  "petal": {"multipole": {as a dipole, "thickness_mm": 2}}},
//    "lights": [{"kind": "point", "position_mm": [..], "flux": [..]},
//               {"kind": "spot", "position_mm": [..], "direction": [..], "half_angle_deg": 10, "flux": [..]},
//               {"kind": "projector", "centre_mm": [..], "direction": [..], "blur_sd_mm": 0.1, "flux": [..],
//                "diameter_mm": 1 | "pixel_mm": 0.25, "diameter_px": 4},
//               {"kind": "environment", "radiance": [..] | "file": "sky.exr"}],
//    "camera": {"calibration": "SESSION", "side": "reflection"} |
//              {"position_mm": [..], "look_at_mm": [..], "up": [0,1,0], "vertical_field_deg": 40,
//               "width": 640, "height": 480},
//    "rays_per_patch": 256, "error_percent": 1, "memory_mb": 4096, "residual": 1e-4, "seed": 1}
// mm_per_unit 1, translate_mm 0, subdivide_mm none, grading 1, inward false, path "solid", blur_sd_mm 0, finish
// "smooth", lights none, rays_per_patch 256, memory_mb 4096, residual 1e-4 and seed 1 are what stands where nothing is
// written. With error_percent, rows start at rays_per_patch (64 where nothing is written) and grow until the rms error
// of the irradiance by rays is that or every row has ALB_RAYS_REFINED_MAX. Rays beyond memory_mb lie in a temporary
// file. Paths are relative to the file. Units are the user's as long as they agree: flux 1 makes the picture radiance
// per incident flux, 1/(mm^2 sr).
#pragma once
#include "base/camera.h"
#include "base/json.h"
#include "render/light.h"
#include "render/scatter.h"

enum { ALB_OBJECTS_MAX = 256, ALB_SURFACES_MAX = 256, ALB_LIGHTS_MAX = 64, ALB_RAYS_REFINED_MAX = 4096 };

typedef struct alb_scene {
    alb_mesh mesh; // all objects, mm; groups index surfaces. Objects share no vertices
    alb_surface *surfaces;
    size_t surface_count;
    alb_light *lights;
    size_t light_count;
    alb_camera camera;
    int rays_per_patch;
    double error_percent; // 0: as many rays as rays_per_patch says
    size_t memory_bytes;  // 0: no limit
    double residual;
    uint64_t seed;
} alb_scene;

// Reads the scene and all it refers to; every file read is added to the provenance's inputs.
bool alb_scene_read(alb_scene *scene, alb_provenance *provenance, const char *path, alb_error *error);
void alb_scene_free(alb_scene *scene);

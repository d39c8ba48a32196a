// Compares a render with a photograph, and a fitted material with what a virtual rig knows of its own.
#pragma once
#include "base/image.h"
#include "base/json.h"
#include "base/page.h"
#include "fit/material.h"

// Of one channel, or of all. In the photo's units, over the compared pixels, after the render was scaled.
typedef struct alb_measure {
    double scale;         // least squares of these channels alone: photo ~ scale * render
    double rmse;          // root of the mean square of photo - scaled render
    double relative_rmse; // rmse over the photo's own rms
    double psnr_db;       // 20 log10(peak / rmse); INFINITY where nothing differs
    double ssim;          // mean over the compared pixels; see compare.c
} alb_measure;

// Two pictures of one size. Zero is empty; alb_comparison_free leaves it zero.
typedef struct alb_comparison {
    int channels;
    char names[3][8];
    double scale; // the one factor all measures use
    double peak;  // 99.9th percentile of the photo's compared values
    alb_measure channel[3], all;
    long compared, outside_mask, bad_photo, bad_render; // pixels; bad: a value that is not finite. They add up to all.
    int spot_x, spot_y;                                 // brightest place of the photo (5 x 5 mean)
    alb_image photo, render;                            // the compared channels, render scaled; 0 where not compared
    unsigned char *used;                                // a pixel each: 1 where compared
} alb_comparison;

// Compares R,G,B (or else Y); other channels are ignored. mask (may be NULL): pixels whose first channel is above 0.5
// are compared. `photo_name` and `render_name` are for messages. ALB_BAD_DATA with numbers where the sizes or channels
// differ, no pixel is left, the render is zero, the photo is dark, or the best scale is not positive.
bool alb_compare_images(alb_comparison *comparison, const alb_image *photo, const char *photo_name,
                        const alb_image *render, const char *render_name, const alb_image *mask, alb_error *error);
void alb_comparison_free(alb_comparison *comparison);

// Reads a picture as linear light: floating point as it is, 16-bit integers as proportional to light, 8-bit integers
// decoded from sRGB; an integer at full scale is clipped and becomes NaN. *how says which it was.
bool alb_compare_read(alb_image *image, const char **how, const char *path, alb_error *error);

// Writes REPORT/<stem>_*.png and .svg and appends pictures, plots and tables to the page.
bool alb_comparison_draw(alb_page *page, const alb_comparison *comparison, const char *folder, const char *stem,
                         alb_error *error);
void alb_comparison_put(alb_json *json, const alb_comparison *comparison);

// One side and channel of a material against the truth.
typedef struct alb_profile_check {
    alb_side side;
    char channel[8];
    bool measured; // the material has this profile
    alb_fitted fitted;
    double total, total_sd;   // of the truth
    double deviation_percent; // (recovered - true) / true
    double deviation_sd;      // (recovered - true) / sqrt(sd^2 + true sd^2)
    double curve_rms;         // rms of fit / truth - 1 over the bins from from_mm to to_mm; NaN for none
    double from_mm, to_mm;
    int bins;
    double *r_mm, *value_per_mm2, *sd_per_mm2; // the truth's bins
    size_t count;
} alb_profile_check;

// Zero is empty; alb_material_check_free leaves it zero.
typedef struct alb_material_check {
    char name[ALB_NAME_SIZE];
    alb_profile_check profiles[ALB_SIDES * 3];
    int count;
} alb_material_check;

// Every side and channel of the truth file: reflection first. ALB_BAD_DATA where the files have no channel in common.
bool alb_compare_material(alb_material_check *check, const alb_material *material, const char *truth_path,
                          alb_error *error);
void alb_material_check_free(alb_material_check *check);
bool alb_material_check_draw(alb_page *page, const alb_material_check *check, const char *folder, const char *stem,
                             alb_error *error);
void alb_material_check_put(alb_json *json, const alb_material_check *check);

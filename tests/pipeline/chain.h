// A small session that the whole chain follows: 240 x 180 pixels, one spot, both sides.
#pragma once
#include "program.h"

static const char chain_plan[] =
    "{\"format\": 1, \"sample\": {\"name\": \"stated\", \"thickness_mm\": 6, \"refractive_index\": 1.5, \"finish\": "
    "\"ground\"},\n"
    " \"white_reference\": {\"reflectance\": [0.99, 0.98, 0.97]},\n"
    " \"board\": {\"columns\": 7, \"rows\": 5, \"square_mm\": 3.5},\n"
    " \"shots\": [\n"
    "  {\"name\": \"dark\", \"target\": \"cap\", \"pattern\": {\"kind\": \"black\"}, \"exposures_s\": [0.02], "
    "\"repeats\": 2},\n"
    "  {\"name\": \"flat\", \"target\": \"diffuser\", \"pattern\": {\"kind\": \"white\"}, \"exposures_s\": [0.02], "
    "\"repeats\": 2},\n"
    "  {\"name\": \"hand\", \"target\": \"board\", \"pattern\": {\"kind\": \"chessboard\"}, \"in_hand\": true,\n"
    "   \"exposures_s\": [0.02], \"repeats\": 5},\n"
    "  {\"name\": \"front\", \"target\": \"board\", \"pattern\": {\"kind\": \"chessboard\"}, \"exposures_s\": "
    "[0.02]},\n"
    "  {\"name\": \"back\", \"side\": \"transmission\", \"target\": \"board\", \"pattern\": {\"kind\": "
    "\"chessboard\"},\n"
    "   \"exposures_s\": [0.02]},\n"
    "  {\"name\": \"white\", \"target\": \"white_reference\", \"pattern\": {\"kind\": \"spot\", \"diameter_px\": 4},\n"
    "   \"exposures_s\": [0.02, 0.3], \"repeats\": 2},\n"
    "  {\"name\": \"r\", \"target\": \"slab\", \"pattern\": {\"kind\": \"spot\", \"diameter_px\": 4}, \"exposures_s\": "
    "[0.2, 2, 20]},\n"
    "  {\"name\": \"t\", \"side\": \"transmission\", \"target\": \"slab\", \"pattern\": {\"kind\": \"spot\", "
    "\"diameter_px\": 4},\n"
    "   \"exposures_s\": [2, 20]}]}\n";

static const char chain_profile[] =
    "\"profile\": {\"reflection\": {\"amplitude_per_mm2\": [[0.01, 0.06], [0.012, 0.05], [0.015, 0.04]],\n"
    "  \"decay_per_mm\": [[0.4, 1.5], [0.45, 1.6], [0.55, 1.8]]}, \"transmission\": {\"amplitude_per_mm2\":\n"
    "  [[0.02, -0.016], [0.018, -0.014], [0.016, -0.012]], \"decay_per_mm\": [[0.6, 1.4], [0.65, 1.5], [0.7, 1.6]]}}";
static const char chain_medium[] =
    "\"medium\": {\"absorption_per_mm\": [0.01, 0.02, 0.04], \"scattering_per_mm\": [2, 2.2, 2.5],\n"
    "  \"anisotropy\": [0.5, 0.5, 0.5], \"refractive_index\": 1.5, \"photons\": 20000}";

static inline void save_chain_truth(const char *path, const char *slab, int tilt_deg)
{
    char text[2048];
    snprintf(text, sizeof text,
             "{\"format\": 1, \"seed\": 1, %s,\n"
             " \"projector\": {\"pixel_mm\": 0.3, \"blur_sd_mm\": 0.15, \"irradiance_w_per_mm2\": [1, 1, 1]},\n"
             " \"lamp\": {\"radiance_w_per_mm2_sr\": 0.25},\n"
             " \"camera\": {\"width\": 240, \"height\": 180, \"focal_px\": 1000, \"centre_px\": [121, 88],\n"
             "  \"distortion\": [-0.1, 0.05, 0, 0, 0], \"distance_mm\": 200, \"tilt_deg\": %d},\n"
             " \"sensor\": {\"responsivity_e\": [1e6, 1e6, 1e6], \"full_well_e\": 10000, \"read_noise_e\": 3,\n"
             "  \"gain_dn_per_e\": 0.4, \"black_level_dn\": 64, \"bits\": 12, \"vignetting\": 0.2}}\n",
             slab, tilt_deg);
    save_text(path, text);
}

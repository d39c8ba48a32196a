// What a virtual rig is made of: TRUTH.json read, and the truth.json that a capture leaves for comparison.
#pragma once
#include "base/json.h"
#include "capture/photon.h"
#include "capture/session.h"

enum { ALB_TERMS_MAX = 4 };

// A stated profile: sum of amplitude e^(-decay r), 1/mm^2.
typedef struct alb_stated_profile {
    int terms;
    double amplitude_per_mm2[ALB_TERMS_MAX], decay_per_mm[ALB_TERMS_MAX];
} alb_stated_profile;

typedef struct alb_sensor {
    double responsivity_e[3]; // electrons per second per W/(mm^2 sr) of scene radiance, at the middle of the picture
    double full_well_e, read_noise_e, gain_dn_per_e, black_level_dn;
    int bits;
    double vignetting; // share of the light lost in the corners
} alb_sensor;

typedef struct alb_truth {
    uint64_t seed;
    bool is_medium; // else profile
    alb_medium medium[3];
    long photons; // per channel
    alb_stated_profile profile[ALB_SIDES][3];
    struct {
        double pixel_mm, blur_sd_mm;
        double irradiance_w_per_mm2[3]; // of a white pixel on the face, before blur
    } projector;
    double lamp_radiance; // W/(mm^2 sr) of the diffuser and of white paper
    struct {
        int width, height;
        double focal_px, centre_px[2], distortion[5]; // k1, k2, p1, p2, k3
        double distance_mm, tilt_deg;
    } camera;
    alb_sensor sensor;
} alb_truth;

// Reads and checks TRUTH.json; the slab's thickness is the plan's. ALB_BAD_DATA names file, line and key.
bool alb_truth_read(alb_truth *truth, const char *path, double thickness_mm, alb_error *error);

// How a face answers a pencil beam, as truth.json tells it: means over rings, 1/mm^2, with their standard deviations.
typedef struct alb_response {
    double total, total_sd; // share of the incident flux that leaves, at all radii
    double r_mm[ALB_PHOTON_BINS], value_per_mm2[ALB_PHOTON_BINS],
        sd_per_mm2[ALB_PHOTON_BINS]; // r: the ring's mean radius
} alb_response;

bool alb_truth_write(const alb_response responses[ALB_SIDES][3], const alb_provenance *provenance, const char *folder,
                     alb_error *error);

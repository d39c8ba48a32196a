// Optical properties of a fitted slab: per channel (sigma_a, sigma_s') from the totals of its two sides, with what they
// rest on. Part of material.json ("optical_properties").
#pragma once
#include "base/json.h"
#include "base/record.h"
#include "fit/images.h"
#include "fit/material.h"
#include "fit/optical.h"

typedef struct alb_properties {
    bool half_space;     // transmission was not measured: the ratio alone
    bool known;          // false: not tried (refused empty), or refused
    alb_optical optical; // with the anisotropy that was assumed
    double anisotropy;
    double other_anisotropy, other[2]; // sigma_a, sigma_s' of the same totals with another anisotropy: the price of not
                                       // knowing it; NaN where no slab has them
    char refused[320];
    alb_image_properties images; // the same slab by its images
} alb_properties;

// What the totals do not say themselves.
typedef struct alb_properties_basis {
    alb_finish finish;              // of the faces
    double anisotropy;              // g, assumed
    double common_sd[ALB_SIDES][3]; // relative, common to all readings of a side and channel
    double own_sd[ALB_SIDES][3];    // the part of it that the other side does not share
} alb_properties_basis;

// Another one than the assumed g, to say what not knowing it costs.
double alb_other_anisotropy(double assumed);

// Of a slab: both sides fitted, thickness and index known; where reflection alone was fitted, of a half-space of the
// index.
void alb_properties_find(alb_properties properties[3], const alb_material *material, const alb_properties_basis *basis);

// Writes "optical_properties" into an open object; nothing where it was not tried.
void alb_properties_put(alb_json *json, const alb_properties *properties);
// Adds sentences for a reader: values, assumption, flags.
void alb_properties_note(alb_text *notes, const char *channel, const alb_properties *properties);
// Reads "optical_properties" of a channel, where it is there; else not known.
bool alb_properties_read(alb_optical_estimate *estimate, alb_node channel, alb_error *error);

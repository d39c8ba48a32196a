// Optical properties of a photographed slab from where its light leaves, not only how much: the "images" of
// "optical_properties" in material.json.
#pragma once
#include "base/json.h"
#include "base/record.h"
#include "base/text.h"
#include "fit/joint.h"

typedef struct alb_image_properties {
    bool known; // false: not tried (refused empty), or refused
    alb_joint joint;
    char refused[320];
} alb_image_properties;

// A second a slab on one core.
void alb_image_properties_find(alb_image_properties *properties, const alb_joint_side sides[ALB_SIDES],
                               const alb_joint_known *known);
// Writes "images" into the open object; nothing where it was not tried.
void alb_image_properties_put(alb_json *json, const alb_image_properties *properties);
void alb_image_properties_note(alb_text *notes, const char *channel, const alb_image_properties *properties);
// Checks "images" of an object, where it is there.
bool alb_image_properties_check(alb_node object, alb_error *error);

// What joint.h found of a slab, as material.json and the reader are told it. The sds are relative ones of logarithms
// times the value; the unit of length, which both sides share, is not in them, nor is the thickness.
#include "fit/images.h"
#include <math.h>
#include <stdio.h>

void alb_image_properties_find(alb_image_properties *properties, const alb_joint_side sides[ALB_SIDES],
                               const alb_joint_known *known)
{
    alb_error error = {0};
    *properties = (alb_image_properties){0};
    properties->known = alb_joint_fit(&properties->joint, sides, known, &error);
    if (properties->known && *properties->joint.undecided) {
        properties->known = false;
        alb_fail(&error, ALB_UNDECIDED, "%s", properties->joint.undecided);
    }
    snprintf(properties->refused, sizeof properties->refused, "%.319s", error.text);
}

static double correlation(const alb_joint *joint)
{
    return joint->covariance[0][1] / (joint->relative_sd[0] * joint->relative_sd[1]);
}

void alb_image_properties_put(alb_json *json, const alb_image_properties *p)
{
    const alb_joint *j = &p->joint;
    if (!p->known && !*p->refused)
        return;
    alb_json_object(json, "images");
    if (p->known) {
        const double used[ALB_SIDES] = {j->used[0], j->used[1]};
        alb_json_string(json, "method", "radiative transport of the readings of both sides, scale and anisotropy free");
        alb_json_estimate(json, "absorption_per_mm", j->absorption_per_mm, j->absorption_per_mm * j->relative_sd[0]);
        alb_json_estimate(json, "reduced_scattering_per_mm", j->reduced_scattering_per_mm,
                          j->reduced_scattering_per_mm * j->relative_sd[1]);
        alb_json_number(json, "correlation", correlation(j));
        alb_json_numbers(json, "relative_bound", j->relative_bound, ALB_JOINT_ANISOTROPY);
        alb_json_estimate(json, "anisotropy", j->anisotropy, j->relative_sd[ALB_JOINT_ANISOTROPY]);
        alb_json_estimate(json, "scale", j->scale, j->scale * j->relative_sd[ALB_JOINT_SCALE]);
        alb_json_estimate(json, "transmission_over_reflection", j->balance,
                          j->balance * j->relative_sd[ALB_JOINT_BALANCE]);
        alb_json_number(json, "chi_square", j->chi_square);
        alb_json_number(json, "degrees_of_freedom", j->degrees_of_freedom);
        alb_json_number(json, "discrepancy_relative", j->discrepancy_relative);
        alb_json_numbers(json, "readings", used, ALB_SIDES);
        alb_json_numbers(json, "from_mm", j->from_mm, ALB_SIDES);
        alb_json_number(json, "unscattered_share", j->unscattered);
    } else {
        alb_json_string(json, "refused", p->refused);
    }
    alb_json_end_object(json);
}

void alb_image_properties_note(alb_text *notes, const char *channel, const alb_image_properties *p)
{
    const alb_joint *j = &p->joint;
    char missed[96] = "";
    if (j->discrepancy_relative > 0)
        snprintf(missed, sizeof missed, "; it misses the readings by %.2g %% beyond their noise, which is in the sd",
                 100 * j->discrepancy_relative);
    if (*p->refused)
        alb_text_add(notes, "%s: no optical properties from the images: %s.\n", channel, p->refused);
    if (p->known)
        alb_text_add(
            notes,
            "%s: absorption %.4g +- %.2g, reduced scattering %.4g +- %.2g per mm by radiative transport from the "
            "images, anisotropy %.3g +- %.2g and scale %.4g +- %.2g fitted, chi-square %.4g / %d%s.\n",
            channel, j->absorption_per_mm, j->absorption_per_mm * j->relative_sd[0], j->reduced_scattering_per_mm,
            j->reduced_scattering_per_mm * j->relative_sd[1], j->anisotropy, j->relative_sd[ALB_JOINT_ANISOTROPY],
            j->scale, j->scale * j->relative_sd[ALB_JOINT_SCALE], j->chi_square, j->degrees_of_freedom, missed);
}

bool alb_image_properties_check(alb_node object, alb_error *error)
{
    static const char *const estimates[] = {"absorption_per_mm", "reduced_scattering_per_mm", "scale",
                                            "transmission_over_reflection"};
    alb_node images, estimate;
    const char *text;
    double value;
    if (!alb_node_has(object, "images"))
        return true;
    if (!alb_node_object(&images, object, "images", error))
        return false;
    if (alb_node_has(images, "refused"))
        return alb_node_allow(images, "refused", error) && alb_node_text(&text, images, "refused", error);
    if (!alb_node_allow(
            images,
            "method absorption_per_mm reduced_scattering_per_mm correlation relative_bound anisotropy scale "
            "transmission_over_reflection chi_square degrees_of_freedom discrepancy_relative readings from_mm "
            "unscattered_share",
            error) ||
        !alb_node_number(&value, images, "correlation", -1.001, 1.001, error) ||
        !alb_node_number(&value, images, "chi_square", 0, 1e300, error))
        return false;
    for (int i = 0; i < 4; i++)
        if (!alb_node_object(&estimate, images, estimates[i], error) || !alb_node_allow(estimate, "value sd", error) ||
            !alb_node_number(&value, estimate, "value", 0, 1e300, error) ||
            !alb_node_number(&value, estimate, "sd", 0, 1e300, error))
            return false;
    return true;
}

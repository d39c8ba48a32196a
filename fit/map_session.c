// The grids of a session, spot by spot.
//
// The photograph of the grid on the white reference says where the spots lie, how the light of each lies about its
// centre (one shape for all, averaged: the projector's) and which share w_i of the flux it has. A spot's readings end
// half way to its nearest neighbour and are divided by its share. What its neighbours add is in the forward model: the
// mean over a circle of radius r about the spot of light that entered at distance D is the mean over a circle of radius
// D of light that leaves at r, so that a neighbour is a sample of the spot at distance D_ij with the share w_j / w_i;
// of sd s along each axis, two samples of half the share at D_ij + s^2 / (2 D_ij) +- s, true to second order in s.
// Stops being true where neighbours differ so much that a spot's own profile is not theirs, seen through the share of
// their light there.
//
// The mean material has the weighted mean of the parameters (weights 1 / sd^2 of the totals), which keeps every
// constraint of the form, for those are linear, and the covariance sum w_i^2 C_i with what all spots share.
#include "base/memory.h"
#include "fit/exit_angle.h"
#include "fit/map.h"
#include "fit/product.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { SHAPE_BINS = 20 };

// The grid on the white reference.
typedef struct lamp {
    int count;
    alb_site *sites;
    double *flux[3], flux_sd[3]; // shares of the flux; mean relative sd of one
    double shape_r_mm[3][SHAPE_BINS], shape_share[3][SHAPE_BINS];
    double shape_sd_mm[3]; // along one axis
} lamp;

static void lamp_free(lamp *out)
{
    free(out->sites);
    for (int c = 0; c < 3; c++)
        free(out->flux[c]);
    *out = (lamp){0};
}

// Share of the flux of each spot, and the mean shape.
static bool measure_lamp(lamp *out, int channel, const alb_channel *white, alb_error *error)
{
    double weights[SHAPE_BINS] = {0}, distances[SHAPE_BINS] = {0}, extent_mm = 0;
    for (int i = 0; i < out->count; i++) {
        alb_face face;
        double *value, *variance, flux = 0, flux_variance = 0;
        if (!alb_site_cut(&face, &value, &variance, &out->sites[i], 1, white, error))
            return false;
        for (size_t k = 0; k < (size_t)face.width * (size_t)face.height; k++)
            if (isfinite(value[k])) {
                flux += value[k] * face.area_mm2[k];
                flux_variance += variance ? variance[k] * face.area_mm2[k] * face.area_mm2[k] : 0;
            }
        alb_channel cut = {&face, value, variance, white->name};
        alb_spot spot = {0};
        const bool ok = alb_spot_measure(&spot, &cut, error);
        if (ok && i == 0)
            extent_mm = spot.r_mm[spot.count - 1];
        for (int k = 0; k < spot.count; k++) {
            const int bin = (int)fmin(spot.r_mm[k] / extent_mm * SHAPE_BINS, SHAPE_BINS - 1);
            out->shape_share[channel][bin] += spot.share[k] / out->count;
            weights[bin] += spot.share[k] != 0;
            distances[bin] += spot.share[k] != 0 ? spot.r_mm[k] : 0;
        }
        alb_spot_free(&spot);
        alb_face_free(&face);
        free(value);
        free(variance);
        if (!ok)
            return false;
        out->flux[channel][i] = flux;
        out->flux_sd[channel] += sqrt(flux_variance) / flux / out->count;
    }
    double square = 0;
    for (int b = 0; b < SHAPE_BINS; b++) {
        out->shape_r_mm[channel][b] = weights[b] > 0 ? distances[b] / weights[b] : 0;
        square += out->shape_share[channel][b] * out->shape_r_mm[channel][b] * out->shape_r_mm[channel][b];
    }
    out->shape_sd_mm[channel] = sqrt(fmax(square, 0) / 2);
    return true;
}

static bool lamp_create(lamp *out, alb_provenance *provenance, const alb_calibration *calibration,
                        const alb_product *white, alb_error *error)
{
    const int count = white->pattern.columns * white->pattern.rows;
    alb_image image = {0};
    alb_face face = {0};
    *out = (lamp){.count = count, .sites = alb_allocate((size_t)count, sizeof *out->sites, error)};
    bool ok = out->sites && alb_product_read(&image, provenance, calibration, white, error) &&
              alb_face_seen(&face, &calibration->views[white->side].camera, error);
    for (int c = 0; ok && c < calibration->channels; c++) {
        char name[ALB_NAME_SIZE + 16];
        alb_plane plane = {0};
        snprintf(name, sizeof name, "%s %s", white->shot, calibration->channel_names[c]);
        ok = (out->flux[c] = alb_allocate((size_t)count, sizeof(double), error)) &&
             alb_plane_take(&plane, &image, calibration->channel_names[c], NULL, INFINITY, error);
        const alb_channel channel = {&face, plane.value, plane.variance, name};
        ok = ok &&
             (c || alb_sites_find(out->sites, white->pattern.columns, white->pattern.rows, false, &channel, error)) &&
             measure_lamp(out, c, &channel, error);
        alb_plane_free(&plane);
    }
    alb_face_free(&face);
    alb_image_free(&image);
    return ok;
}

// What a spot's readings are made from.
typedef struct lit {
    const lamp *light;
    const alb_site *sites; // on this face
    const alb_channel *channel;
    int colour;
} lit;

// The light that enters about (x, y), where the readings of spot i have their centre, in units of its own. Off its site
// by e the spot's own light lies at sqrt(r^2 + e^2).
static bool light_about(alb_spot *spot, const lit *from, int i, double x_mm, double y_mm, alb_error *error)
{
    const lamp *light = from->light;
    const int count = SHAPE_BINS + 2 * (light->count - 1);
    const double sd = light->shape_sd_mm[from->colour];
    *spot = (alb_spot){.count = count,
                       .r_mm = alb_allocate((size_t)count, sizeof(double), error),
                       .share = alb_allocate((size_t)count, sizeof(double), error)};
    if (!spot->r_mm || !spot->share)
        return false;
    const double off = hypot(x_mm - from->sites[i].x_mm, y_mm - from->sites[i].y_mm);
    for (int b = 0; b < SHAPE_BINS; b++)
        spot->r_mm[b] = hypot(light->shape_r_mm[from->colour][b], off);
    memcpy(spot->share, light->shape_share[from->colour], SHAPE_BINS * sizeof(double));
    for (int j = 0, k = SHAPE_BINS; j < light->count; j++)
        if (j != i) {
            const double distance = hypot(x_mm - from->sites[j].x_mm, y_mm - from->sites[j].y_mm);
            for (int sign = -1; sign <= 1; sign += 2, k++) {
                spot->r_mm[k] = distance + sd * sd / (2 * distance) + sign * sd;
                spot->share[k] = 0.5 * light->flux[from->colour][j] / light->flux[from->colour][i];
            }
        }
    return true;
}

// Drops the rings that the cut about the site leaves in part: light of neighbours is not the same all round them.
static void keep_whole_rings(alb_readings *readings, const alb_site *site)
{
    const double whole_mm = site->reach_mm - hypot(readings->x_mm - site->x_mm, readings->y_mm - site->y_mm);
    for (; readings->count > 1; readings->count--) {
        const double r = readings->r_mm[readings->count - 1], half = 0.5 * (r - readings->r_mm[readings->count - 2]);
        if (r + half <= whole_mm)
            break;
        readings->outer_mm = r - half;
    }
}

// A ring's samples four by four: a forward model of a quarter of the work. Within a quarter of a ring of width w the
// mean stands for the samples to (b w)^2 / 384 of a profile that falls as e^(-b r): 1e-4 where it falls by a fifth a
// ring.
static void merge_samples(alb_readings *readings)
{
    enum { MERGED = 4 };
    for (int i = 0; i < readings->count; i++)
        for (int k = 0; k < ALB_RING_SAMPLES; k += MERGED) {
            double share = 0, r_mm = 0, value = 0;
            for (int m = k; m < k + MERGED; m++) {
                share += readings->sample_share[i][m];
                r_mm += readings->sample_share[i][m] * readings->sample_r_mm[i][m];
                value += readings->sample_share[i][m] * readings->sample_value[i][m];
                readings->sample_share[i][m] = 0;
            }
            readings->sample_share[i][k] = share;
            readings->sample_r_mm[i][k] = share > 0 ? r_mm / share : 0;
            readings->sample_value[i][k] = share > 0 ? value / share : 0;
        }
}

static bool read_spot(alb_readings *readings, alb_operator *forward, int i, const void *context, alb_error *error)
{
    const lit *from = context;
    alb_face face;
    double *value, *variance;
    alb_spot spot = {0};
    if (!alb_site_cut(&face, &value, &variance, &from->sites[i], 1 / from->light->flux[from->colour][i], from->channel,
                      error))
        return false;
    const alb_channel cut = {&face, value, variance, from->channel->name};
    bool ok =
        alb_observe_whole(readings, &cut, error) && light_about(&spot, from, i, readings->x_mm, readings->y_mm, error);
    if (ok) {
        keep_whole_rings(readings, &from->sites[i]);
        merge_samples(readings);
        ok = alb_operator_create(forward, readings, &spot, error);
    }
    alb_spot_free(&spot);
    alb_face_free(&face);
    free(value);
    free(variance);
    return ok;
}

static void take_mean(alb_outcome *mean, const alb_map_layer *layer, alb_common_sd common)
{
    alb_fitted *fitted = &mean->fitted;
    const int n = alb_form_parameter_count(layer->candidate.form);
    double weights = 0;
    *mean = (alb_outcome){.tied = layer->candidate.tied,
                          .rms_relative = NAN,
                          .measured_share = NAN,
                          .slope_per_mm = NAN,
                          .slope_sd = NAN,
                          .slope_from_mm = NAN,
                          .slope_to_mm = NAN};
    fitted->profile.form = layer->candidate.form;
    for (int i = 0; i < layer->count; i++)
        weights += layer->spots[i].total_sd > 0 ? pow(layer->spots[i].total_sd, -2) : 0;
    for (int i = 0; i < layer->count; i++) {
        const alb_fitted *spot = &layer->spots[i];
        const double w = spot->total_sd > 0 ? pow(spot->total_sd, -2) / weights : 0;
        for (int p = 0; p < n; p++) {
            fitted->profile.parameters[p] += w * spot->profile.parameters[p];
            for (int q = 0; q < n; q++)
                fitted->covariance[p][q] += w * w * spot->covariance[p][q];
        }
    }
    double gradient[ALB_PARAMETERS_MAX], variance = 0;
    fitted->total = alb_profile_total_gradient(gradient, &fitted->profile);
    for (int p = 0; p < n; p++)
        for (int q = 0; q < n; q++)
            variance += gradient[p] * fitted->covariance[p][q] * gradient[q];
    alb_common_add(fitted, common);
    fitted->total_sd = sqrt(fmax(variance, 0) + pow(common.flux * fitted->total, 2));
    for (int p = 0; p < n; p++)
        fitted->sd[p] = sqrt(fitted->covariance[p][p]);
    fitted->chi_square = layer->total.chi_square;
    fitted->degrees_of_freedom = layer->total.count - 1;
    fitted->identifiable = true;
    mean->free_total = fitted->total;
    for (int p = 0; p < n; p++) {
        const double value = fitted->profile.parameters[p], half = 1.96 * fitted->sd[p];
        mean->knowledge.parameters[p] =
            (alb_certainty){.lower = value - half, .upper = value + half, .cramer_rao_sd = fitted->sd[p]};
    }
    mean->knowledge.total = (alb_certainty){.lower = fitted->total - 1.96 * fitted->total_sd,
                                            .upper = fitted->total + 1.96 * fitted->total_sd,
                                            .cramer_rao_sd = fitted->total_sd};
}

// The layers of one side.
static bool fit_side(alb_map *map, alb_fitting *fitting, const lamp *light, alb_text *notes,
                     const alb_calibration *calibration, const alb_product *product, const alb_image *image,
                     const alb_face *face, const double *factor, alb_error *error)
{
    const alb_side side = product->side;
    for (int c = 0; c < calibration->channels; c++) {
        char name[64];
        alb_plane plane = {0};
        snprintf(name, sizeof name, "%s %s", alb_side_names[side], calibration->channel_names[c]);
        const alb_common_sd common = {
            hypot(hypot(product->relative_scale_sd[c], light->flux_sd[c] / sqrt(light->count)),
                  calibration->finish == ALB_FINISH_SMOOTH ? ALB_EXIT_RELATIVE_SD : 0),
            calibration->views[side].relative_length_sd};
        bool ok = alb_plane_take(&plane, image, calibration->channel_names[c], factor, INFINITY, error);
        const alb_channel channel = {face, plane.value, plane.variance, name};
        const lit from = {light, map->sites[side], &channel, c};
        if (ok && c == 0 && side == ALB_TRANSMISSION) {
            ok = alb_sites_find(map->sites[side], map->columns, map->rows, true, &channel, error);
            if (ok)
                alb_sites_align(map->sites[side], light->sites, light->count);
        }
        alb_map_layer *layer = &map->layers[side][c];
        ok = ok && alb_map_layer_fit(layer, light->count, light->flux_sd[c], read_spot, &from, name, error);
        alb_plane_free(&plane);
        if (!ok)
            return false;
        alb_measurement *measurement = &fitting->sides[side][c];
        measurement->measured = true;
        measurement->common = common;
        take_mean(&measurement->outcome, layer, common);
        fitting->material.fitted[side][c] = measurement->outcome.fitted;
        if (layer->total.count < light->count)
            alb_text_add(notes, "%s: %d of %d spots do not decide and are left out.\n", name,
                         light->count - layer->total.count, light->count);
    }
    return true;
}

static bool map_product(alb_map *map, alb_fitting *fitting, alb_provenance *provenance, alb_text *notes,
                        const alb_calibration *calibration, const alb_product *product, const lamp *light,
                        alb_error *error)
{
    alb_image image = {0};
    alb_face face = {0};
    double *factor = NULL;
    alb_site *sites = alb_allocate((size_t)light->count, sizeof *sites, error);
    if (sites && product->side == ALB_REFLECTION) // the same view as of the white reference
        memcpy(sites, light->sites, (size_t)light->count * sizeof *sites);
    map->sites[product->side] = sites;
    const bool ok = sites && alb_product_read(&image, provenance, calibration, product, error) &&
                    alb_face_seen(&face, &calibration->views[product->side].camera, error) &&
                    alb_exitance_factor(&factor, notes, calibration, product->side, &face, error) &&
                    fit_side(map, fitting, light, notes, calibration, product, &image, &face, factor, error);
    free(factor);
    alb_face_free(&face);
    alb_image_free(&image);
    return ok;
}

static bool on_slab(const alb_product *product, alb_pattern_kind kind)
{
    return product->target == ALB_TARGET_SLAB && product->pattern.kind == kind;
}

bool alb_map_is_wanted(const alb_calibration *calibration)
{
    bool grid = false, spot = false;
    for (int i = 0; i < calibration->product_count; i++) {
        grid |= on_slab(&calibration->products[i], ALB_PATTERN_GRID);
        spot |= on_slab(&calibration->products[i], ALB_PATTERN_SPOT);
    }
    return grid && !spot;
}

// Of n quantities tested at once each at 5 % / n.
static void judge(alb_map *map, int channels)
{
    double least = 1;
    int tested = 0;
    for (int side = 0; side < ALB_SIDES; side++)
        for (int c = 0; c < channels; c++)
            if (map->layers[side][c].spots) {
                tested += 2;
                least = fmin(least, fmin(map->layers[side][c].total.tail, map->layers[side][c].half.tail));
            }
    map->tail_wanted = 0.05 / tested;
    map->heterogeneous = least < map->tail_wanted;
}

bool alb_map_from_session(alb_map *map, alb_fitting *fitting, alb_provenance *provenance, alb_text *notes,
                          const alb_calibration *calibration, alb_error *error)
{
    const alb_product *white = NULL;
    lamp light = {0};
    bool ok = true;
    *map = (alb_map){0};
    for (int i = 0; ok && i < calibration->product_count; i++) {
        const alb_product *product = &calibration->products[i];
        if (!on_slab(product, ALB_PATTERN_GRID))
            continue;
        for (int k = 0; k < calibration->product_count && !white; k++)
            if (calibration->products[k].target == ALB_TARGET_WHITE &&
                alb_pattern_same(&calibration->products[k].pattern, &product->pattern))
                white = &calibration->products[k];
        if (!white || !alb_pattern_same(&white->pattern, &product->pattern) || map->sites[product->side]) {
            ok = alb_fail(error, ALB_BAD_DATA,
                          "%s: one grid a side, and the same one on the white reference, make a map",
                          calibration->folder);
            break;
        }
        map->columns = white->pattern.columns, map->rows = white->pattern.rows;
        ok = (light.count || lamp_create(&light, provenance, calibration, white, error)) &&
             map_product(map, fitting, provenance, notes, calibration, product, &light, error);
    }
    lamp_free(&light);
    if (ok) {
        judge(map, calibration->channels);
        alb_fitting_find_properties(fitting);
    } else {
        alb_map_free(map);
    }
    return ok;
}

void alb_map_free(alb_map *map)
{
    for (int side = 0; side < ALB_SIDES; side++) {
        free(map->sites[side]);
        for (int c = 0; c < 3; c++)
            alb_map_layer_free(&map->layers[side][c]);
    }
    *map = (alb_map){0};
}

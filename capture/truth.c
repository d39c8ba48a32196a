// Reads TRUTH.json strictly and writes truth.json.
#include "capture/truth.h"
#include "base/record.h"
#include <math.h>

static const char *const channel_names[3] = {"R", "G", "B"};

static bool parse_medium(alb_truth *truth, alb_node root, double thickness_mm, alb_error *error)
{
    alb_node node;
    double absorption[3], scattering[3], anisotropy[3], index;
    if (!alb_node_object(&node, root, "medium", error) ||
        !alb_node_allow(node, "absorption_per_mm scattering_per_mm anisotropy refractive_index photons", error) ||
        !alb_node_numbers(absorption, 3, node, "absorption_per_mm", 0, 1000, error) ||
        !alb_node_numbers(scattering, 3, node, "scattering_per_mm", 0, 1000, error) ||
        !alb_node_numbers(anisotropy, 3, node, "anisotropy", -0.99, 0.99, error) ||
        !alb_node_number(&index, node, "refractive_index", 1, 4, error) ||
        !alb_node_integer(&truth->photons, node, "photons", 1000, 1000000000, error))
        return false;
    for (int c = 0; c < 3; c++) {
        if (scattering[c] * thickness_mm > 2000)
            return alb_node_fail(error, node, "scattering_per_mm",
                                 "%g scattering lengths thick: more than the 2000 that "
                                 "photons are followed through",
                                 scattering[c] * thickness_mm);
        truth->medium[c] = (alb_medium){absorption[c], scattering[c], anisotropy[c], index, thickness_mm};
    }
    return true;
}

// Items of a list, counted up to one more than the terms that are allowed.
static int item_count(alb_node list)
{
    int count = 0;
    while (count <= ALB_TERMS_MAX && alb_node_item(list, (size_t)count).value)
        count++;
    return count;
}

static bool parse_profile(alb_stated_profile profile[3], alb_node sides, const char *side, alb_error *error)
{
    alb_node node, amplitudes, decays;
    size_t rows, decay_rows;
    if (!alb_node_object(&node, sides, side, error) || !alb_node_allow(node, "amplitude_per_mm2 decay_per_mm", error) ||
        !alb_node_list(&amplitudes, &rows, node, "amplitude_per_mm2", error) ||
        !alb_node_list(&decays, &decay_rows, node, "decay_per_mm", error))
        return false;
    if (rows != 3 || decay_rows != 3)
        return alb_node_fail(error, node, NULL, "expected three lists each, one per channel");
    for (size_t c = 0; c < 3; c++) {
        const alb_node a = alb_node_item(amplitudes, c), b = alb_node_item(decays, c);
        const int terms = profile[c].terms = item_count(a);
        double total = 0;
        if (terms < 1 || terms > ALB_TERMS_MAX || item_count(b) != terms)
            return alb_node_fail(error, node, NULL, "channel %s: expected 1 to %d amplitudes and as many decays",
                                 channel_names[c], ALB_TERMS_MAX);
        for (int i = 0; i < terms; i++) {
            double *amplitude = &profile[c].amplitude_per_mm2[i], *decay = &profile[c].decay_per_mm[i];
            if (!alb_node_item_number(amplitude, a, (size_t)i, -1e6, 1e6, error) ||
                !alb_node_item_number(decay, b, (size_t)i, 1e-3, 1e4, error))
                return false;
            total += 2 * M_PI * *amplitude / (*decay * *decay);
        }
        if (!(total >= 0 && total <= 1))
            return alb_node_fail(error, node, NULL, "channel %s sheds %.4g of the light it gets; expected 0 to 1",
                                 channel_names[c], total);
    }
    return true;
}

static bool parse_projector(alb_truth *truth, alb_node root, alb_error *error)
{
    alb_node projector, lamp;
    if (!alb_node_object(&projector, root, "projector", error) ||
        !alb_node_allow(projector, "pixel_mm blur_sd_mm irradiance_w_per_mm2", error) ||
        !alb_node_number(&truth->projector.pixel_mm, projector, "pixel_mm", 1e-3, 100, error) ||
        !alb_node_number(&truth->projector.blur_sd_mm, projector, "blur_sd_mm", 1e-4, 100, error) ||
        !alb_node_numbers(truth->projector.irradiance_w_per_mm2, 3, projector, "irradiance_w_per_mm2", 0, 1e6, error) ||
        !alb_node_object(&lamp, root, "lamp", error) || !alb_node_allow(lamp, "radiance_w_per_mm2_sr", error) ||
        !alb_node_number(&truth->lamp_radiance, lamp, "radiance_w_per_mm2_sr", 0, 1e6, error))
        return false;
    if (truth->projector.blur_sd_mm < 0.2 * truth->projector.pixel_mm) // the sum over points of a pixel needs it smooth
        return alb_node_fail(error, projector, "blur_sd_mm", "found %g, expected at least a fifth of the pixel (%g)",
                             truth->projector.blur_sd_mm, 0.2 * truth->projector.pixel_mm);
    return true;
}

static bool parse_camera(alb_truth *truth, alb_node root, alb_error *error)
{
    alb_node node;
    long width, height;
    if (!alb_node_object(&node, root, "camera", error) ||
        !alb_node_allow(node, "width height focal_px centre_px distortion distance_mm tilt_deg", error) ||
        !alb_node_integer(&width, node, "width", 16, 8192, error) ||
        !alb_node_integer(&height, node, "height", 16, 8192, error) ||
        !alb_node_number(&truth->camera.focal_px, node, "focal_px", 16, 1e6, error) ||
        !alb_node_numbers(truth->camera.centre_px, 2, node, "centre_px", -1e4, 1e4, error) ||
        !alb_node_numbers(truth->camera.distortion, 5, node, "distortion", -10, 10, error) ||
        !alb_node_number(&truth->camera.distance_mm, node, "distance_mm", 1, 1e5, error) ||
        !alb_node_number(&truth->camera.tilt_deg, node, "tilt_deg", -70, 70, error))
        return false;
    truth->camera.width = (int)width, truth->camera.height = (int)height;
    return true;
}

static bool parse_sensor(alb_sensor *sensor, alb_node root, alb_error *error)
{
    alb_node node;
    long bits;
    if (!alb_node_object(&node, root, "sensor", error) ||
        !alb_node_allow(node, "responsivity_e full_well_e read_noise_e gain_dn_per_e black_level_dn bits vignetting",
                        error) ||
        !alb_node_numbers(sensor->responsivity_e, 3, node, "responsivity_e", 0, 1e30, error) ||
        !alb_node_number(&sensor->full_well_e, node, "full_well_e", 100, 1e9, error) ||
        !alb_node_number(&sensor->read_noise_e, node, "read_noise_e", 0, 1e4, error) ||
        !alb_node_number(&sensor->gain_dn_per_e, node, "gain_dn_per_e", 1e-6, 1e3, error) ||
        !alb_node_integer(&bits, node, "bits", 4, 16, error) ||
        !alb_node_number(&sensor->black_level_dn, node, "black_level_dn", 0, (double)(1L << bits) / 2, error) ||
        !alb_node_number(&sensor->vignetting, node, "vignetting", 0, 0.9, error))
        return false;
    sensor->bits = (int)bits;
    return true;
}

bool alb_truth_read(alb_truth *truth, const char *path, double thickness_mm, alb_error *error)
{
    alb_node root, profile;
    long seed;
    bool ok = false;
    *truth = (alb_truth){0};
    alb_record *record = alb_record_read(path, error);
    if (!record || !alb_record_root(&root, record, error) ||
        !alb_node_allow(root, "format seed medium profile projector lamp camera sensor", error) ||
        !alb_node_integer(&seed, root, "seed", 0, 1L << 53, error))
        goto done;
    truth->seed = (uint64_t)seed;
    truth->is_medium = alb_node_has(root, "medium");
    if (truth->is_medium == alb_node_has(root, "profile")) {
        alb_node_fail(error, root, NULL, "expected \"medium\" or \"profile\", one of them");
        goto done;
    }
    if (truth->is_medium) {
        if (!parse_medium(truth, root, thickness_mm, error))
            goto done;
    } else if (!alb_node_object(&profile, root, "profile", error) ||
               !alb_node_allow(profile, "reflection transmission", error) ||
               !parse_profile(truth->profile[ALB_REFLECTION], profile, "reflection", error) ||
               !parse_profile(truth->profile[ALB_TRANSMISSION], profile, "transmission", error)) {
        goto done;
    }
    ok = parse_projector(truth, root, error) && parse_camera(truth, root, error) &&
         parse_sensor(&truth->sensor, root, error);
done:
    alb_record_free(record);
    return ok;
}

bool alb_truth_write(const alb_response responses[ALB_SIDES][3], const alb_provenance *provenance, const char *folder,
                     alb_error *error)
{
    alb_json json;
    char path[ALB_PATH_SIZE];
    if (!alb_path_join(path, folder, "truth.json", error))
        return false;
    alb_json_begin(&json, provenance);
    alb_json_object(&json, "channels");
    for (int c = 0; c < 3; c++) {
        alb_json_object(&json, channel_names[c]);
        for (int side = 0; side < ALB_SIDES; side++) {
            const alb_response *response = &responses[side][c];
            alb_json_object(&json, alb_side_names[side]);
            alb_json_number(&json, "total", response->total);
            alb_json_number(&json, "total_sd", response->total_sd);
            alb_json_numbers(&json, "r_mm", response->r_mm, ALB_PHOTON_BINS);
            alb_json_numbers(&json, "value_per_mm2", response->value_per_mm2, ALB_PHOTON_BINS);
            alb_json_numbers(&json, "sd_per_mm2", response->sd_per_mm2, ALB_PHOTON_BINS);
            alb_json_end_object(&json);
        }
        alb_json_end_object(&json);
    }
    alb_json_end_object(&json);
    return alb_json_write(&json, path, error);
}

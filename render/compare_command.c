// alabaster compare: pairs of files in, one report out. Everything is read and measured before anything is written, so
// that bad input leaves an earlier report as it was.
#include "base/command.h"
#include "base/memory.h"
#include "render/compare.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { PAIRS_MAX = 15 }; // provenance holds 32 inputs: these and the mask

typedef struct pair {
    const char *first, *second; // paths
    bool pictures;
    const char *how[2]; // how each picture was read
    alb_comparison comparison;
    alb_material_check check;
} pair;

typedef struct job {
    pair pairs[PAIRS_MAX];
    int pair_count;
    const char *output, *mask, *limit_text;
    double limit_percent;
    bool json;
    alb_provenance provenance;
} job;

// What the report calls a file: the path as given, but never where on this machine it lies.
static const char *shown_name(const char *path) { return path[0] == '/' ? alb_path_name(path) : path; }

static bool is_json(const char *path)
{
    const size_t size = strlen(path);
    return size > 5 && strcmp(path + size - 5, ".json") == 0;
}

static bool pair_up(job *j, const char *const *files, alb_error *error)
{
    int count = 0;
    while (count < 2 * PAIRS_MAX && files[count])
        count++;
    if (count == 0 || count % 2)
        return alb_fail(error, ALB_USAGE, "%d file%s; expected pairs: PHOTO RENDER or MATERIAL.json TRUTH.json", count,
                        count == 1 ? "" : "s");
    j->pair_count = count / 2;
    for (int i = 0; i < j->pair_count; i++) {
        pair *p = &j->pairs[i];
        p->first = files[2 * i], p->second = files[2 * i + 1];
        p->pictures = !is_json(p->first);
        if (is_json(p->second) == p->pictures)
            return alb_fail(error, ALB_USAGE, "%s and %s: a pair is two pictures or two .json files", p->first,
                            p->second);
    }
    return true;
}

static bool read_options(job *j, int argc, char **argv, alb_error *error)
{
    const char *files[2 * PAIRS_MAX] = {0};
    alb_option options[2 * PAIRS_MAX + 4] = {{.name = "-o", .required = true, .value = &j->output},
                                             {.name = "--mask", .value = &j->mask},
                                             {.name = "--limit-percent", .value = &j->limit_text},
                                             {.name = "--json", .flag = &j->json}};
    for (int i = 0; i < 2 * PAIRS_MAX; i++)
        options[4 + i] = (alb_option){.label = "PAIR", .value = &files[i]};
    if (!alb_options_read(options, 2 * PAIRS_MAX + 4, argc, argv, error) || !pair_up(j, files, error))
        return false;
    bool pictures = false, materials = false;
    for (int i = 0; i < j->pair_count; i++)
        *(j->pairs[i].pictures ? &pictures : &materials) = true;
    if (j->mask && !pictures)
        return alb_fail(error, ALB_USAGE, "--mask is for pictures, and there are none");
    if (j->limit_text && !materials)
        return alb_fail(error, ALB_USAGE,
                        "--limit-percent is for totals: MATERIAL.json TRUTH.json, and there are none");
    return !j->limit_text || alb_option_number(&j->limit_percent, "--limit-percent", j->limit_text, 0, 1000, error);
}

static bool read_mask(alb_image *mask, const char *path, alb_error *error)
{
    int bits = 0;
    if (!alb_image_read(mask, &bits, path, error))
        return false;
    const float full = bits == 8 ? 255 : bits == 16 ? 65535 : 1;
    for (size_t i = 0; i < (size_t)mask->width * (size_t)mask->height * (size_t)mask->channels; i++)
        mask->pixels[i] /= full;
    return true;
}

static bool measure_pictures(pair *p, const char *mask_path, alb_error *error)
{
    alb_image photo = {0}, render = {0}, mask = {0};
    const bool ok =
        alb_compare_read(&photo, &p->how[0], p->first, error) &&
        alb_compare_read(&render, &p->how[1], p->second, error) && (!mask_path || read_mask(&mask, mask_path, error)) &&
        alb_compare_images(&p->comparison, &photo, p->first, &render, p->second, mask_path ? &mask : NULL, error);
    alb_image_free(&photo);
    alb_image_free(&render);
    alb_image_free(&mask);
    return ok;
}

static bool measure(job *j, alb_error *error)
{
    j->provenance.command = "compare";
    size_t used = 0;
    char *options = j->provenance.options;
    if (j->mask)
        used += (size_t)snprintf(options, sizeof j->provenance.options, "--mask %.200s ", shown_name(j->mask));
    if (j->limit_text)
        snprintf(options + used, sizeof j->provenance.options - used, "--limit-percent %g", j->limit_percent);
    for (int i = 0; i < j->pair_count; i++) {
        pair *p = &j->pairs[i];
        if (!alb_provenance_add(&j->provenance, p->first, error) ||
            !alb_provenance_add(&j->provenance, p->second, error))
            return false;
        if (p->pictures) {
            if (!measure_pictures(p, j->mask, error))
                return false;
        } else {
            alb_material material = {0};
            if (!alb_material_read(&material, p->first, error) ||
                !alb_compare_material(&p->check, &material, p->second, error))
                return false;
        }
    }
    return !j->mask || alb_provenance_add(&j->provenance, j->mask, error);
}

static void put(alb_json *json, const job *j)
{
    alb_json_begin(json, &j->provenance);
    alb_json_list(json, "pairs");
    for (int i = 0; i < j->pair_count; i++) {
        const pair *p = &j->pairs[i];
        alb_json_object(json, NULL);
        alb_json_string(json, p->pictures ? "photo" : "material", shown_name(p->first));
        alb_json_string(json, p->pictures ? "render" : "truth", shown_name(p->second));
        if (p->pictures) {
            alb_json_string(json, "photo_values", p->how[0]);
            alb_json_string(json, "render_values", p->how[1]);
            alb_comparison_put(json, &p->comparison);
        } else
            alb_material_check_put(json, &p->check);
        alb_json_end_object(json);
    }
    alb_json_end_list(json);
}

static bool write_page(const job *j, alb_error *error)
{
    alb_page page;
    char path[ALB_PATH_SIZE], stem[16];
    bool ok = alb_path_join(path, j->output, "index.html", error);
    alb_page_begin(&page, "Comparison", "Photograph beside render, measurement beside truth");
    for (int i = 0; ok && i < j->pair_count; i++) {
        const pair *p = &j->pairs[i];
        char heading[512];
        snprintf(stem, sizeof stem, "pair%d", i + 1);
        if (p->pictures)
            snprintf(heading, sizeof heading, "%.200s beside %.200s", shown_name(p->first), shown_name(p->second));
        else
            snprintf(heading, sizeof heading, "%s: %.200s against %.200s", p->check.name, shown_name(p->first),
                     shown_name(p->second));
        alb_page_heading(&page, heading);
        if (p->pictures)
            alb_page_paragraph(&page, "Photo: %s. Render: %s.", p->how[0], p->how[1]);
        ok = p->pictures ? alb_comparison_draw(&page, &p->comparison, j->output, stem, error)
                         : alb_material_check_draw(&page, &p->check, j->output, stem, error);
    }
    if (ok)
        return alb_page_write(&page, path, error);
    alb_page_free(&page);
    return false;
}

static void print_measure(const char *name, const alb_measure *m)
{
    printf("  %-8s %12.6g %12.4g %10.3f %%", name, m->scale, m->rmse, 100 * m->relative_rmse);
    if (isfinite(m->psnr_db))
        printf(" %9.2f %9.5f\n", m->psnr_db, m->ssim);
    else
        printf(" %9s %9.5f\n", "infinite", m->ssim);
}

static void print_pictures(const pair *p)
{
    const alb_comparison *c = &p->comparison;
    printf("%s beside %s: render times %.6g; %ld of %ld pixels compared\n", p->first, p->second, c->scale, c->compared,
           (long)c->photo.width * c->photo.height);
    if (c->bad_photo || c->bad_render)
        printf("  not finite: %ld pixels of the photo, %ld of the render\n", c->bad_photo, c->bad_render);
    printf("  %-8s %12s %12s %12s %9s %9s\n", "channel", "scale alone", "RMSE", "relative", "PSNR (dB)", "SSIM");
    for (int i = 0; i < c->channels; i++)
        print_measure(c->names[i], &c->channel[i]);
    print_measure("all", &c->all);
}

static void print_material(const pair *p)
{
    printf("%s against %s: %s\n", p->first, p->second, p->check.name);
    printf("  %-13s %-8s %11s %10s %9s %11s %7s %13s  %s\n", "side", "channel", "true total", "recovered", "sd",
           "deviation", "in sd", "rms of curve", "form");
    for (int i = 0; i < p->check.count; i++) {
        const alb_profile_check *f = &p->check.profiles[i];
        if (f->measured)
            printf("  %-13s %-8s %11.5f %10.5f %9.5f %+9.2f %% %+7.2f %11.2f %%  %s%s\n", alb_side_names[f->side],
                   f->channel, f->total, f->fitted.total, f->fitted.total_sd, f->deviation_percent, f->deviation_sd,
                   100 * f->curve_rms, alb_form_name(f->fitted.profile.form),
                   f->fitted.identifiable ? "" : " (best guess: not decided)");
        else
            printf("  %-13s %-8s %11.5f %10s\n", alb_side_names[f->side], f->channel, f->total, "not measured");
    }
}

static bool print_result(const job *j, alb_error *error)
{
    if (j->json) {
        alb_json json = {0};
        put(&json, j);
        return alb_json_print(&json, error);
    }
    for (int i = 0; i < j->pair_count; i++)
        (j->pairs[i].pictures ? print_pictures : print_material)(&j->pairs[i]);
    return true;
}

// The total that deviates most; a profile that the material lacks deviates without bound.
static bool check_limit(const job *j, alb_error *error)
{
    const alb_profile_check *worst = NULL;
    double largest = j->limit_percent;
    for (int i = 0; j->limit_text && i < j->pair_count; i++)
        for (int k = 0; k < j->pairs[i].check.count; k++) {
            const alb_profile_check *p = &j->pairs[i].check.profiles[k];
            if (!p->measured)
                return alb_fail(error, ALB_DIFFERS, "%s: %s of %s is not measured", j->pairs[i].first,
                                alb_side_names[p->side], p->channel);
            if (!(fabs(p->deviation_percent) <= largest))
                worst = p, largest = fabs(p->deviation_percent);
        }
    if (worst)
        return alb_fail(error, ALB_DIFFERS,
                        "the total %s of %s deviates by %+.2f %% (%.5f, true %.5f); the limit is %g %%",
                        alb_side_names[worst->side], worst->channel, worst->deviation_percent, worst->fitted.total,
                        worst->total, j->limit_percent);
    return true;
}

static bool run(int argc, char **argv, alb_error *error)
{
    alb_json json = {0};
    char path[ALB_PATH_SIZE];
    job *j = alb_allocate(1, sizeof *j, error);
    bool ok = j && read_options(j, argc, argv, error) && measure(j, error) &&
              alb_file_make_directory(j->output, error) && alb_path_join(path, j->output, "compare.json", error) &&
              write_page(j, error);
    if (ok)
        put(&json, j);
    ok = ok && alb_json_write(&json, path, error) && print_result(j, error) && check_limit(j, error);
    for (int i = 0; j && i < j->pair_count; i++) {
        alb_comparison_free(&j->pairs[i].comparison);
        alb_material_check_free(&j->pairs[i].check);
    }
    free(j);
    return ok;
}

const alb_command alb_compare_command = {
    .name = "compare",
    .summary = "puts a render beside its photograph, a material beside its truth, in numbers and pictures",
    .usage =
        "usage: alabaster compare PAIR ... -o REPORT [--mask MASK] [--limit-percent P] [--json]\n\n"
        "A pair is one of\n"
        "  PHOTO RENDER               two pictures of one size (EXR, PFM, HDR, PNG, TIFF, JPEG); channels R,G,B or Y\n"
        "  MATERIAL.json TRUTH.json   a fitted material and the truth.json of a virtual rig\n"
        "up to 15 of them. Floating point and 16-bit values are taken as proportional to light, 8-bit ones as\n"
        "sRGB. The render is multiplied by one factor, solved by least squares and stated. Pixels that are not\n"
        "finite, or clipped in an integer file, are left out and counted.\n\n"
        "  -o REPORT          folder for index.html, compare.json and the pictures\n"
        "  --mask MASK        compare only where this picture is brighter than half\n"
        "  --limit-percent P  exit with 1 when a total deviates from the truth by more than P percent\n"
        "  --json             print compare.json instead of the table",
    .run = run,
};

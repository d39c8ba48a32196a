// The page of a map: is the sample alike everywhere, and pictures of what differs.
//
// A picture has a square a spot, coloured from the smallest value to the largest (dark to light), with a small tick for
// the median sd beside the scale: where the scale is not much longer than that, the picture shows noise.
#include "base/markup.h"
#include "base/memory.h"
#include "base/page.h"
#include "base/statistics.h"
#include "fit/map.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

enum { MAP_WIDTH = 360, SCALE_HEIGHT = 54 };

// From dark blue over green to yellow, alike in lightness steps (after Smith and van der Walt's viridis, five points).
static void put_colour(alb_text *svg, double share)
{
    static const double points[5][3] = {{68, 1, 84}, {59, 82, 139}, {33, 145, 140}, {94, 201, 98}, {253, 231, 37}};
    const double at = 4 * fmin(fmax(share, 0), 1);
    const int k = at < 4 ? (int)at : 3;
    int rgb[3];
    for (int c = 0; c < 3; c++)
        rgb[c] = (int)lround(points[k][c] + (at - k) * (points[k + 1][c] - points[k][c]));
    alb_text_add(svg, "#%02x%02x%02x", (unsigned)rgb[0], (unsigned)rgb[1], (unsigned)rgb[2]);
}

typedef struct range {
    double least, most, sd; // median sd
} range;

static bool range_of(range *out, const double *values, const double *sd, int count, alb_error *error)
{
    double *known = alb_allocate((size_t)count, sizeof(double), error);
    size_t n = 0;
    *out = (range){INFINITY, -INFINITY, 0};
    for (int i = 0; known && i < count; i++)
        if (isfinite(values[i])) {
            out->least = fmin(out->least, values[i]);
            out->most = fmax(out->most, values[i]);
            known[n++] = sd[i];
        }
    if (known)
        out->sd = alb_median(known, n);
    free(known);
    return known != NULL;
}

static void put_scale(alb_text *svg, const range *r, double top)
{
    const double left = 8, width = MAP_WIDTH - 16;
    for (int k = 0; k < 64; k++) {
        alb_text_add(svg, "<rect x=\"%.2f\" y=\"%.2f\" width=\"%.2f\" height=\"10\" fill=\"", left + k * width / 64,
                     top, width / 64 + 0.3);
        put_colour(svg, k / 63.0);
        alb_text_add(svg, "\"/>\n");
    }
    const double share = r->most > r->least ? fmin(r->sd / (r->most - r->least), 1) : 1;
    alb_text_add(
        svg,
        "<rect x=\"%.2f\" y=\"%.2f\" width=\"%.2f\" height=\"2\" fill=\"#333\"/>\n"
        "<text x=\"%.2f\" y=\"%.2f\" font-size=\"12\" fill=\"#333\">%.4g</text>\n"
        "<text x=\"%.2f\" y=\"%.2f\" font-size=\"12\" fill=\"#333\" text-anchor=\"middle\">bar: one sd, %.2g</text>\n"
        "<text x=\"%.2f\" y=\"%.2f\" font-size=\"12\" fill=\"#333\" text-anchor=\"end\">%.4g</text>\n",
        left, top + 13, share * width, left, top + 30, r->least, left + width / 2, top + 30, r->sd, left + width,
        top + 30, r->most);
}

static bool put_picture(alb_page *page, const alb_map *map, const double *values, const double *sd, const char *caption,
                        alb_error *error)
{
    range r;
    alb_text svg = {0};
    const double cell = (MAP_WIDTH - 16.0) / map->columns, height = cell * map->rows;
    if (!range_of(&r, values, sd, map->columns * map->rows, error))
        return false;
    alb_text_add(&svg,
                 "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 %d %.2f\" role=\"img\" "
                 "font-family=\"system-ui, sans-serif\">\n<rect width=\"100%%\" height=\"100%%\" fill=\"#fff\"/>\n",
                 MAP_WIDTH, height + 16 + SCALE_HEIGHT);
    for (int i = 0; i < map->columns * map->rows; i++) {
        alb_text_add(&svg, "<rect x=\"%.2f\" y=\"%.2f\" width=\"%.2f\" height=\"%.2f\" fill=\"",
                     8 + (i % map->columns) * cell, 8 + (i / map->columns) * cell, cell - 1, cell - 1); // NOLINT: rows
        if (isfinite(values[i]))
            put_colour(&svg, r.most > r.least ? (values[i] - r.least) / (r.most - r.least) : 0.5);
        else
            alb_text_add(&svg, "#e4e4e8");
        alb_text_add(&svg, "\"/>\n");
    }
    if (r.most >= r.least)
        put_scale(&svg, &r, height + 20);
    alb_text_add(&svg, "</svg>\n");
    alb_page_svg(page, svg.bytes ? svg.bytes : "", caption);
    page->html.failed |= svg.failed;
    alb_text_free(&svg);
    return true;
}

static void put_spread(alb_page *page, const char *side, const char *channel, const char *quantity,
                       const alb_spread *spread, double wanted)
{
    alb_page_row(page, "%s|%s|%s|%s|%d|%.5g ± %.2g|%.2g|%.1f / %d|%.3g", side, channel, quantity,
                 spread->tail < wanted ? "differs" : "alike", spread->count, spread->mean, spread->mean_sd,
                 spread->between, spread->chi_square, spread->count > 0 ? spread->count - 1 : 0, spread->tail);
}

static bool put_layer(alb_page *page, const alb_map *map, const alb_material *material, int side, int c,
                      alb_error *error)
{
    const alb_map_layer *layer = &map->layers[side][c];
    const size_t n = (size_t)layer->count;
    char caption[128];
    double *values = alb_allocate(2 * n, sizeof(double), error);
    if (!values)
        return false;
    for (size_t i = 0; i < n; i++) {
        values[i] = layer->spots[i].profile.form != ALB_FORM_NONE ? layer->spots[i].total : (double)NAN;
        values[n + i] = layer->spots[i].total_sd;
    }
    snprintf(caption, sizeof caption, "%s %s: total", alb_side_names[side], material->channel_names[c]);
    bool ok = put_picture(page, map, values, values + n, caption, error);
    snprintf(caption, sizeof caption, "%s %s: half of the light within (mm)", alb_side_names[side],
             material->channel_names[c]);
    ok = ok && put_picture(page, map, layer->half_mm, layer->half_sd_mm, caption, error);
    free(values);
    return ok;
}

bool alb_map_report(const alb_map *map, const alb_material *material, const char *notes, const char *folder,
                    alb_error *error)
{
    char report[ALB_PATH_SIZE], path[ALB_PATH_SIZE];
    alb_page page;
    bool ok = true;
    if (!alb_path_join(report, folder, "report", error) || !alb_file_make_directory(report, error) ||
        !alb_path_join(path, report, "map.html", error))
        return false;
    alb_page_begin(&page, "Map", material->name);
    alb_page_paragraph(&page,
                       map->heterogeneous
                           ? "The sample is not alike everywhere: its %d x %d spots differ by more than their noise."
                           : "The sample is alike everywhere: its %d x %d spots differ by no more than their noise.",
                       map->columns, map->rows);
    alb_page_table(&page, "side|channel|quantity|verdict|spots|mean ± sd|between spots|chi-square / dof|probability");
    for (int side = 0; side < ALB_SIDES; side++)
        for (int c = 0; c < material->channels && map->layers[side][c].spots; c++) {
            const alb_map_layer *layer = &map->layers[side][c];
            put_spread(&page, alb_side_names[side], material->channel_names[c], "total", &layer->total,
                       map->tail_wanted);
            put_spread(&page, alb_side_names[side], material->channel_names[c], "half of the light within (mm)",
                       &layer->half, map->tail_wanted);
        }
    alb_page_end_table(&page);
    alb_page_paragraph(
        &page,
        "The sd between spots is what their own sd do not explain. Probability: of a chi-square as large "
        "where all are alike; a quantity differs below %.3g, 5 %% over all that are tested, so that of "
        "a hundred samples that are alike five at most are called otherwise.",
        map->tail_wanted);
    alb_page_lines(&page, notes);
    alb_page_begin_pictures(&page);
    for (int side = 0; side < ALB_SIDES; side++)
        for (int c = 0; ok && c < material->channels && map->layers[side][c].spots; c++)
            ok = put_layer(&page, map, material, side, c, error);
    alb_page_end_pictures(&page);
    ok = ok && alb_page_write(&page, path, error);
    alb_page_free(&page);
    return ok;
}

// One panel of a plot as SVG: strip, grid, numbers, curves, labels. Curves are clipped by a nested <svg>. Palette:
// Okabe & Ito 2008, distinguishable with any colour vision; past its end lines are dotted and points hollow.
#include "base/markup.h"
#include "base/plot_frame.h"

#include <math.h>
#include <stdio.h>

static const char *const palette[] = {"#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#000000"};
enum { PALETTE = sizeof palette / sizeof *palette };
enum { SAMPLE = 22 }; // length of a legend's line

static const char *colour_of(const alb_panel *panel, size_t c)
{
    return panel->curves[c].colour ? panel->curves[c].colour : palette[c % PALETTE];
}

// Whether the palette was used up before curve c: then lines are dotted and points hollow, so that no two are alike up
// to twice the palette.
static bool second_round(const alb_panel *panel, size_t c) { return !panel->curves[c].colour && c / PALETTE % 2; }

static const char *dashes_of(const alb_panel *panel, size_t c)
{
    if (panel->curves[c].mark == ALB_MARK_DASHES)
        return second_round(panel, c) ? " stroke-dasharray=\"9 3 2 3\"" : " stroke-dasharray=\"6 4\"";
    return second_round(panel, c) ? " stroke-dasharray=\"2 3\"" : "";
}

// Opens or finishes an element in the colour of a curve's points.
static void points_colour(alb_text *svg, const alb_panel *panel, size_t c)
{
    alb_text_add(svg, second_round(panel, c) ? "fill=\"#fff\" stroke=\"" : "stroke=\"none\" fill=\"");
    alb_markup_add(svg, colour_of(panel, c));
}

static void text_at(alb_text *svg, double x, double y, const char *attributes, const char *plain)
{
    alb_text_add(svg, "<text x=\"%.1f\" y=\"%.1f\"%s>", x, y, attributes);
    alb_markup_add(svg, plain);
    alb_text_add(svg, "</text>\n");
}

static void sample(alb_text *svg, const alb_panel *panel, size_t c, double x, double y)
{
    const alb_curve *curve = &panel->curves[c];
    if (curve->mark != ALB_MARK_POINTS) {
        alb_text_add(svg, "<path d=\"M%.1f %.1fh%d\" stroke-width=\"1.8\"%s stroke=\"", x, y, SAMPLE,
                     dashes_of(panel, c));
        alb_markup_add(svg, colour_of(panel, c));
        alb_text_add(svg, "\"/>\n");
    }
    if (curve->mark == ALB_MARK_POINTS || curve->mark == ALB_MARK_LINE_AND_POINTS) {
        alb_text_add(svg, "<circle cx=\"%.1f\" cy=\"%.1f\" r=\"2.6\" ", x + SAMPLE / 2.0, y);
        points_colour(svg, panel, c);
        alb_text_add(svg, "\"/>\n");
    }
}

int alb_plot_strip(alb_text *svg, const alb_panel *panel, const alb_frame *f)
{
    double x = f->left, y = f->strip_top;
    int rows = 0;
    if (panel->title) {
        if (svg)
            text_at(svg, x, y + 14, " font-weight=\"600\" font-size=\"13\"", panel->title);
        x += alb_markup_length(panel->title) * 7.6 + 22;
        rows = 1;
    }
    for (size_t c = 0; c < panel->curve_count; c++) {
        const alb_curve *curve = &panel->curves[c];
        if (!curve->label)
            continue;
        const double width = SAMPLE + 6 + alb_markup_length(curve->label) * ALB_PLOT_CHARACTER_PX;
        if (rows == 0)
            rows = 1;
        else if (x + width > f->right && x > f->left)
            x = f->left, y += ALB_PLOT_TITLE_ROW, rows++;
        if (svg) {
            sample(svg, panel, c, x, y + 10);
            text_at(svg, x + SAMPLE + 6, y + 14, "", curve->label);
        }
        x += width + 18;
    }
    return rows;
}

static void grid_line(alb_text *svg, const alb_frame *f, double at, bool vertical)
{
    if (vertical)
        alb_text_add(svg, "M%.1f %.1fV%.1f", at, f->bottom, f->top);
    else
        alb_text_add(svg, "M%.1f %.1fH%.1f", f->left, at, f->right);
}

static void draw_grid(alb_text *svg, const alb_frame *f)
{
    const char *const looks[] = {"#f1f1f1", "#dcdcdc"};
    for (int major = 0; major < 2; major++) {
        alb_text_add(svg, "<path stroke=\"%s\" d=\"M%.1f %.1f", looks[major], f->left, f->bottom);
        for (int i = 0; i < (major ? f->x.tick_count : f->x.minor_count); i++)
            grid_line(svg, f, alb_axis_at(&f->x, major ? f->x.ticks[i] : f->x.minor[i]), true);
        for (int i = 0; i < (major ? f->y.tick_count : f->y.minor_count); i++)
            grid_line(svg, f, alb_axis_at(&f->y, major ? f->y.ticks[i] : f->y.minor[i]), false);
        alb_text_add(svg, "\"/>\n");
    }
}

static void draw_numbers(alb_text *svg, const alb_frame *f)
{
    char label[ALB_TICK_LABEL];
    alb_text_add(svg, "<g fill=\"#444\" text-anchor=\"middle\">\n");
    for (int i = 0; f->x_numbers && i < f->x.tick_count; i++) {
        alb_axis_label(label, &f->x, i);
        alb_text_add(svg, "<text x=\"%.1f\" y=\"%.1f\">%s</text>\n", alb_axis_at(&f->x, f->x.ticks[i]), f->bottom + 15,
                     label);
    }
    alb_text_add(svg, "</g>\n<g fill=\"#444\" text-anchor=\"end\">\n");
    for (int i = 0; i < f->y.tick_count; i++) {
        alb_axis_label(label, &f->y, i);
        alb_text_add(svg, "<text x=\"%.1f\" y=\"%.1f\">%s</text>\n", f->left - 6, alb_axis_at(&f->y, f->y.ticks[i]) + 4,
                     label);
    }
    alb_text_add(svg, "</g>\n");
}

// The label of an axis, followed by the power of ten that its numbers are to be multiplied with.
static void axis_label(alb_text *svg, const char *place, const char *label, const alb_axis *axis)
{
    if (!label && axis->exponent == 0)
        return;
    alb_text_add(svg, "<text text-anchor=\"middle\" %s>", place);
    alb_markup_add(svg, label);
    if (axis->exponent != 0)
        alb_text_add(svg, "%s\u00d7 10<tspan dy=\"-5\" font-size=\"9\">%s%d</tspan>", label ? "   " : "",
                     axis->exponent < 0 ? "\u2212" : "", axis->exponent < 0 ? -axis->exponent : axis->exponent);
    alb_text_add(svg, "</text>\n");
}

static void draw_axis_labels(alb_text *svg, const alb_panel *panel, const alb_frame *f)
{
    char place[128];
    const double middle_x = (f->left + f->right) / 2, middle_y = (f->top + f->bottom) / 2;
    snprintf(place, sizeof place, "x=\"%.1f\" y=\"%.1f\"", middle_x, f->bottom + ALB_PLOT_TICK_ROW + 14);
    axis_label(svg, place, panel->x_label, &f->x);
    snprintf(place, sizeof place, "transform=\"translate(15 %.1f) rotate(-90)\"", middle_y);
    axis_label(svg, place, panel->y_label, &f->y);
}

// Pixel of point i inside the frame's own nested <svg>.
static void place(double *x, double *y, const alb_frame *f, const alb_curve *curve, size_t i)
{
    *x = alb_axis_at(&f->x, curve->x[i]) - f->left;
    *y = alb_axis_at(&f->y, curve->y[i]) - f->top;
}

static void draw_line(alb_text *svg, const alb_panel *panel, const alb_frame *f, size_t c)
{
    const alb_curve *curve = &panel->curves[c];
    bool pen_down = false;
    alb_text_add(svg, "<path fill=\"none\" stroke-width=\"1.8\" stroke-linejoin=\"round\"%s d=\"", dashes_of(panel, c));
    for (size_t i = 0; i < curve->count; i++) {
        const bool drawn = alb_plot_drawable(panel, curve, i);
        double x, y;
        if (drawn) {
            place(&x, &y, f, curve, i);
            alb_text_add(svg, "%c%.1f %.1f", pen_down ? 'L' : 'M', x, y);
        }
        pen_down = drawn;
    }
    alb_text_add(svg, "\"/>\n");
}

static void draw_bars(alb_text *svg, const alb_panel *panel, const alb_frame *f, const alb_curve *curve)
{
    alb_text_add(svg, "<path stroke-opacity=\"0.6\" d=\"");
    for (size_t i = 0; i < curve->count; i++) {
        if (!alb_plot_drawable(panel, curve, i) || !alb_plot_has_bar(curve, i))
            continue;
        const double low = curve->y[i] - curve->sd[i], high = curve->y[i] + curve->sd[i];
        double x, y;
        place(&x, &y, f, curve, i);
        // A bar that reaches what the axis cannot show runs out of the frame.
        const double bottom = alb_axis_accepts(panel->log_y, low) ? alb_axis_at(&f->y, low) - f->top : 2 * f->bottom;
        const double top = alb_axis_accepts(panel->log_y, high) ? alb_axis_at(&f->y, high) - f->top : -10;
        alb_text_add(svg, "M%.1f %.1fV%.1fm-2 0h4M%.1f %.1fh4", x, bottom, top, x - 2, bottom);
    }
    alb_text_add(svg, "\"/>\n");
}

static void draw_points(alb_text *svg, const alb_panel *panel, const alb_frame *f, const alb_curve *curve)
{
    const double radius = curve->count > 300 ? 1.4 : 2.4;
    for (size_t i = 0; i < curve->count; i++) {
        double x, y;
        if (!alb_plot_drawable(panel, curve, i))
            continue;
        place(&x, &y, f, curve, i);
        alb_text_add(svg, "<circle cx=\"%.1f\" cy=\"%.1f\" r=\"%.1f\"/>\n", x, y, radius);
    }
}

static void draw_curves(alb_text *svg, const alb_panel *panel, const alb_frame *f)
{
    alb_text_add(svg, "<svg x=\"%.1f\" y=\"%.1f\" width=\"%.1f\" height=\"%.1f\" overflow=\"hidden\">\n", f->left,
                 f->top, f->right - f->left, f->bottom - f->top);
    for (size_t c = 0; c < panel->curve_count; c++) {
        const alb_curve *curve = &panel->curves[c];
        alb_text_add(svg, "<g stroke=\"");
        alb_markup_add(svg, colour_of(panel, c));
        alb_text_add(svg, "\">\n");
        if (curve->sd)
            draw_bars(svg, panel, f, curve);
        if (curve->mark != ALB_MARK_POINTS)
            draw_line(svg, panel, f, c);
        alb_text_add(svg, "</g>\n");
        if (curve->mark != ALB_MARK_POINTS && curve->mark != ALB_MARK_LINE_AND_POINTS)
            continue;
        alb_text_add(svg, "<g ");
        points_colour(svg, panel, c);
        alb_text_add(svg, "\">\n");
        draw_points(svg, panel, f, curve);
        alb_text_add(svg, "</g>\n");
    }
    alb_text_add(svg, "</svg>\n");
}

void alb_plot_panel(alb_text *svg, const alb_panel *panel, const alb_frame *f)
{
    const double width = f->right - f->left, height = f->bottom - f->top;
    if (f->y_range.known) {
        draw_grid(svg, f);
        draw_numbers(svg, f);
        draw_curves(svg, panel, f);
    } else
        text_at(svg, f->left + width / 2, f->top + height / 2 + 4, " text-anchor=\"middle\" fill=\"#777\"", "no data");
    draw_axis_labels(svg, panel, f);
    alb_text_add(svg, "<rect x=\"%.1f\" y=\"%.1f\" width=\"%.1f\" height=\"%.1f\" fill=\"none\" stroke=\"#888\"/>\n",
                 f->left, f->top, width, height);
}

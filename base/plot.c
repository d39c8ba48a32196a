// Plots as SVG 1.1 from presentation attributes alone: no style sheet, script, id or font file, so that any number of
// them can stand in one page and each looks the same on its own white ground, on a light page and on a dark one.
//
// Layout of a panel, top to bottom: a strip with title and legend (so that neither covers data), the frame, tick
// labels, axis label. All frames have the same left and right edge. Adjacent panels with the same x label (or none
// above one) and the same kind of x axis share its range. Curves are clipped by a nested <svg>. Palette: Okabe & Ito
// 2008, distinguishable with any colour vision. Stops being useful, not right, at some 10^5 points: each becomes a
// mark.
#include "base/plot.h"

#include "base/axis.h"
#include "base/file.h"
#include "base/markup.h"
#include "base/memory.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const char *const palette[] = {"#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#000000"};
enum { PALETTE = sizeof palette / sizeof *palette };
enum { TITLE_ROW = 20, TICK_ROW = 18, LABEL_ROW = 17, GAP = 10, RIGHT_PAD = 18, SAMPLE = 22 };
static const double character_px = 6.6; // of the 12 px sans-serif text, on the wide side

typedef struct range {
    double minimum, maximum;
    bool known;
} range;

typedef struct frame {
    double left, top, right, bottom, strip_top;
    range x_range, y_range;
    alb_axis x, y;
    bool x_numbers; // tick labels stand below this panel
} frame;

static void include(range *r, double value)
{
    r->minimum = r->known ? fmin(r->minimum, value) : value;
    r->maximum = r->known ? fmax(r->maximum, value) : value;
    r->known = true;
}

static bool drawable(const alb_panel *panel, const alb_curve *curve, size_t i)
{
    return alb_axis_accepts(panel->log_x, curve->x[i]) && alb_axis_accepts(panel->log_y, curve->y[i]);
}

static bool has_bar(const alb_curve *curve, size_t i)
{
    return curve->sd && isfinite(curve->sd[i]) && curve->sd[i] > 0;
}

static const char *colour_of(const alb_panel *panel, size_t c)
{
    return panel->curves[c].colour ? panel->curves[c].colour : palette[c % PALETTE];
}

// A margin of 3 % beyond the extreme values, so that no mark sits on the frame.
static void pad(range *r, bool logarithmic)
{
    if (!r->known)
        return;
    const double margin = 0.03;
    if (logarithmic) {
        const double factor = pow(r->maximum / r->minimum, margin);
        if (isfinite(factor))
            r->minimum /= factor, r->maximum *= factor;
    } else {
        const double width = margin * (r->maximum - r->minimum);
        r->minimum -= width, r->maximum += width;
    }
}

static void find_ranges(frame *f, const alb_panel *panel)
{
    for (size_t c = 0; c < panel->curve_count; c++) {
        const alb_curve *curve = &panel->curves[c];
        for (size_t i = 0; i < curve->count; i++) {
            if (!drawable(panel, curve, i))
                continue;
            include(&f->x_range, curve->x[i]);
            include(&f->y_range, curve->y[i]);
            // A lower end close to 0 would stretch a logarithmic axis by decades that hold nothing.
            for (int sign = panel->log_y ? 1 : -1; sign <= 1 && has_bar(curve, i); sign += 2)
                if (alb_axis_accepts(panel->log_y, curve->y[i] + sign * curve->sd[i]))
                    include(&f->y_range, curve->y[i] + sign * curve->sd[i]);
        }
    }
    pad(&f->y_range, panel->log_y);
    pad(&f->x_range, panel->log_x);
    if (panel->y_minimum < panel->y_maximum && alb_axis_accepts(panel->log_y, panel->y_minimum) &&
        alb_axis_accepts(panel->log_y, panel->y_maximum) && f->y_range.known)
        f->y_range.minimum = panel->y_minimum, f->y_range.maximum = panel->y_maximum;
}

static bool shares_x(const alb_panel *above, const alb_panel *below)
{
    return above->log_x == below->log_x &&
           (!above->x_label || (below->x_label && strcmp(above->x_label, below->x_label) == 0));
}

// Gives every run of panels with a common x axis the union of their ranges.
static void share_ranges(frame *frames, const alb_panel *panels, size_t count)
{
    for (size_t i = 0; i < count; i++) {
        size_t last = i;
        range all = frames[i].x_range;
        for (; last + 1 < count && shares_x(&panels[last], &panels[last + 1]); last++)
            if (frames[last + 1].x_range.known) {
                include(&all, frames[last + 1].x_range.minimum);
                include(&all, frames[last + 1].x_range.maximum);
            }
        for (; i < last; i++) {
            frames[i].x_range = all;
            frames[i].x_numbers = panels[i].x_label != NULL;
        }
        frames[last].x_range = all;
        frames[last].x_numbers = true;
    }
}

static void text_at(alb_text *svg, double x, double y, const char *attributes, const char *plain)
{
    alb_text_add(svg, "<text x=\"%.1f\" y=\"%.1f\"%s>", x, y, attributes);
    alb_markup_add(svg, plain);
    alb_text_add(svg, "</text>\n");
}

static void sample(alb_text *svg, const alb_curve *curve, const char *colour, double x, double y)
{
    if (curve->mark != ALB_MARK_POINTS) {
        alb_text_add(svg, "<path d=\"M%.1f %.1fh%d\" stroke-width=\"1.8\"%s stroke=\"", x, y, SAMPLE,
                     curve->mark == ALB_MARK_DASHES ? " stroke-dasharray=\"6 4\"" : "");
        alb_markup_add(svg, colour);
        alb_text_add(svg, "\"/>\n");
    }
    if (curve->mark == ALB_MARK_POINTS || curve->mark == ALB_MARK_LINE_AND_POINTS) {
        alb_text_add(svg, "<circle cx=\"%.1f\" cy=\"%.1f\" r=\"2.6\" fill=\"", x + SAMPLE / 2.0, y);
        alb_markup_add(svg, colour);
        alb_text_add(svg, "\"/>\n");
    }
}

// Title and legend in reading order, wrapped between the edges; returns the number of rows. svg NULL: only counts.
static int draw_strip(alb_text *svg, const alb_panel *panel, const frame *f)
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
        const double width = SAMPLE + 6 + alb_markup_length(curve->label) * character_px;
        if (rows == 0)
            rows = 1;
        else if (x + width > f->right && x > f->left)
            x = f->left, y += TITLE_ROW, rows++;
        if (svg) {
            sample(svg, curve, colour_of(panel, c), x, y + 10);
            text_at(svg, x + SAMPLE + 6, y + 14, "", curve->label);
        }
        x += width + 18;
    }
    return rows;
}

static void grid_line(alb_text *svg, const frame *f, double at, bool vertical)
{
    if (vertical)
        alb_text_add(svg, "M%.1f %.1fV%.1f", at, f->bottom, f->top);
    else
        alb_text_add(svg, "M%.1f %.1fH%.1f", f->left, at, f->right);
}

static void draw_grid(alb_text *svg, const frame *f)
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

static void draw_numbers(alb_text *svg, const frame *f)
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

static void draw_axis_labels(alb_text *svg, const alb_panel *panel, const frame *f)
{
    char place[128];
    const double middle_x = (f->left + f->right) / 2, middle_y = (f->top + f->bottom) / 2;
    snprintf(place, sizeof place, "x=\"%.1f\" y=\"%.1f\"", middle_x, f->bottom + TICK_ROW + 14);
    axis_label(svg, place, panel->x_label, &f->x);
    snprintf(place, sizeof place, "transform=\"translate(15 %.1f) rotate(-90)\"", middle_y);
    axis_label(svg, place, panel->y_label, &f->y);
}

// Pixel of point i inside the frame's own nested <svg>.
static void place(double *x, double *y, const frame *f, const alb_curve *curve, size_t i)
{
    *x = alb_axis_at(&f->x, curve->x[i]) - f->left;
    *y = alb_axis_at(&f->y, curve->y[i]) - f->top;
}

static void draw_line(alb_text *svg, const alb_panel *panel, const frame *f, const alb_curve *curve)
{
    bool pen_down = false;
    alb_text_add(svg, "<path fill=\"none\" stroke-width=\"1.8\" stroke-linejoin=\"round\"%s d=\"",
                 curve->mark == ALB_MARK_DASHES ? " stroke-dasharray=\"6 4\"" : "");
    for (size_t i = 0; i < curve->count; i++) {
        const bool drawn = drawable(panel, curve, i);
        double x, y;
        if (drawn) {
            place(&x, &y, f, curve, i);
            alb_text_add(svg, "%c%.1f %.1f", pen_down ? 'L' : 'M', x, y);
        }
        pen_down = drawn;
    }
    alb_text_add(svg, "\"/>\n");
}

static void draw_bars(alb_text *svg, const alb_panel *panel, const frame *f, const alb_curve *curve)
{
    alb_text_add(svg, "<path stroke-opacity=\"0.6\" d=\"");
    for (size_t i = 0; i < curve->count; i++) {
        if (!drawable(panel, curve, i) || !has_bar(curve, i))
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

static void draw_points(alb_text *svg, const alb_panel *panel, const frame *f, const alb_curve *curve)
{
    const double radius = curve->count > 300 ? 1.4 : 2.4;
    for (size_t i = 0; i < curve->count; i++) {
        double x, y;
        if (!drawable(panel, curve, i))
            continue;
        place(&x, &y, f, curve, i);
        alb_text_add(svg, "<circle cx=\"%.1f\" cy=\"%.1f\" r=\"%.1f\"/>\n", x, y, radius);
    }
}

static void draw_curves(alb_text *svg, const alb_panel *panel, const frame *f)
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
            draw_line(svg, panel, f, curve);
        alb_text_add(svg, "</g>\n");
        if (curve->mark != ALB_MARK_POINTS && curve->mark != ALB_MARK_LINE_AND_POINTS)
            continue;
        alb_text_add(svg, "<g stroke=\"none\" fill=\"");
        alb_markup_add(svg, colour_of(panel, c));
        alb_text_add(svg, "\">\n");
        draw_points(svg, panel, f, curve);
        alb_text_add(svg, "</g>\n");
    }
    alb_text_add(svg, "</svg>\n");
}

static void draw_panel(alb_text *svg, const alb_panel *panel, const frame *f)
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

// Widest label of the vertical axis, in characters.
static int widest_label(const alb_axis *axis)
{
    int widest = 0;
    for (int i = 0; i < axis->tick_count; i++) {
        char label[ALB_TICK_LABEL];
        const int width = alb_axis_label(label, axis, i);
        widest = width > widest ? width : widest;
    }
    return widest;
}

// The frame within its share of the picture: the strip above, numbers and labels below.
static void place_frame(frame *f, const alb_panel *panel)
{
    f->strip_top = f->top;
    f->top += draw_strip(NULL, panel, f) * TITLE_ROW + 6;
    f->bottom -= (f->x_numbers ? TICK_ROW : 4) + (panel->x_label ? LABEL_ROW : 0) + GAP;
    f->bottom = fmax(f->bottom, f->top + 10);
    if (!f->y_range.known)
        return;
    f->y = alb_axis_make(panel->log_y, f->y_range.minimum, f->y_range.maximum, f->bottom, f->top,
                         (int)((f->bottom - f->top) / 24));
    f->x = alb_axis_make(panel->log_x, f->x_range.minimum, f->x_range.maximum, f->left, f->right,
                         (int)((f->right - f->left) / 70));
}

// Heights by weight; the widest label of all panels sets the one left edge.
static void lay_out(frame *frames, const alb_panel *panels, size_t count, int width, int height)
{
    double weights = 0, top = 4, left = 40;
    for (size_t i = 0; i < count; i++)
        weights += panels[i].height > 0 ? panels[i].height : 1;
    for (size_t i = 0; i < count; i++) {
        frame *f = &frames[i];
        f->top = top;
        f->bottom = top += (panels[i].height > 0 ? panels[i].height : 1) / weights * (height - 8);
        f->left = 70, f->right = width - RIGHT_PAD;
        frame trial = *f;
        place_frame(&trial, &panels[i]);
        left = fmax(left, 34 + widest_label(&trial.y) * character_px);
    }
    for (size_t i = 0; i < count; i++) {
        frames[i].left = left;
        place_frame(&frames[i], &panels[i]);
    }
}

void alb_plot_add(alb_text *svg, const alb_panel *panels, size_t panel_count, int width, int height)
{
    frame *frames = alb_allocate(panel_count, sizeof *frames, NULL);
    if (!frames) {
        svg->failed = true;
        return;
    }
    alb_text_add(
        svg,
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"%d\" height=\"%d\" viewBox=\"0 0 %d %d\" role=\"img\" "
        "font-family=\"Helvetica, Arial, 'Liberation Sans', sans-serif\" font-size=\"12\" fill=\"#222\">\n"
        "<rect width=\"%d\" height=\"%d\" fill=\"#fff\"/>\n",
        width, height, width, height, width, height);
    for (size_t i = 0; i < panel_count; i++)
        find_ranges(&frames[i], &panels[i]);
    share_ranges(frames, panels, panel_count);
    lay_out(frames, panels, panel_count, width, height);
    for (size_t i = 0; i < panel_count; i++) {
        draw_strip(svg, &panels[i], &frames[i]);
        draw_panel(svg, &panels[i], &frames[i]);
    }
    alb_text_add(svg, "</svg>\n");
    free(frames);
}

bool alb_plot_write(const char *path, const alb_panel *panels, size_t panel_count, int width, int height,
                    alb_error *error)
{
    alb_text svg = {0};
    alb_plot_add(&svg, panels, panel_count, width, height);
    const bool written = alb_file_write_text(path, &svg, error);
    alb_text_free(&svg);
    return written;
}

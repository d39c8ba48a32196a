// Plots as SVG 1.1 from presentation attributes alone: no style sheet, script, id or font file, so that any number of
// them can stand in one page and each looks the same on its own white ground, on a light page and on a dark one.
//
// Layout of a panel, top to bottom: a strip with title and legend (so that neither covers data), the frame, tick
// labels, axis label. All frames have the same left and right edge. Adjacent panels with the same x label (or none
// above one) and the same kind of x axis share its range. Stops being useful, not right, at some 10^5 points: each
// becomes a mark.
#include "base/plot.h"

#include "base/axis.h"
#include "base/file.h"
#include "base/memory.h"
#include "base/plot_frame.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { LABEL_ROW = 17, GAP = 10, RIGHT_PAD = 18 };

static void include(alb_range *r, double value)
{
    r->minimum = r->known ? fmin(r->minimum, value) : value;
    r->maximum = r->known ? fmax(r->maximum, value) : value;
    r->known = true;
}

bool alb_plot_drawable(const alb_panel *panel, const alb_curve *curve, size_t i)
{
    return alb_axis_accepts(panel->log_x, curve->x[i]) && alb_axis_accepts(panel->log_y, curve->y[i]);
}

bool alb_plot_has_bar(const alb_curve *curve, size_t i)
{
    return curve->sd && isfinite(curve->sd[i]) && curve->sd[i] > 0;
}

// A margin of 3 % beyond the extreme values, so that no mark sits on the frame.
static void pad(alb_range *r, bool logarithmic)
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

static void find_ranges(alb_frame *f, const alb_panel *panel)
{
    for (size_t c = 0; c < panel->curve_count; c++) {
        const alb_curve *curve = &panel->curves[c];
        for (size_t i = 0; i < curve->count; i++) {
            if (!alb_plot_drawable(panel, curve, i))
                continue;
            include(&f->x_range, curve->x[i]);
            include(&f->y_range, curve->y[i]);
            // A lower end close to 0 would stretch a logarithmic axis by decades that hold nothing.
            for (int sign = panel->log_y ? 1 : -1; sign <= 1 && alb_plot_has_bar(curve, i); sign += 2)
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
static void share_ranges(alb_frame *frames, const alb_panel *panels, size_t count)
{
    for (size_t i = 0; i < count; i++) {
        size_t last = i;
        alb_range all = frames[i].x_range;
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
static void place_frame(alb_frame *f, const alb_panel *panel)
{
    f->strip_top = f->top;
    f->top += alb_plot_strip(NULL, panel, f) * ALB_PLOT_TITLE_ROW + 6;
    f->bottom -= (f->x_numbers ? ALB_PLOT_TICK_ROW : 4) + (panel->x_label ? LABEL_ROW : 0) + GAP;
    f->bottom = fmax(f->bottom, f->top + 10);
    if (!f->y_range.known)
        return;
    f->y = alb_axis_make(panel->log_y, f->y_range.minimum, f->y_range.maximum, f->bottom, f->top,
                         (int)((f->bottom - f->top) / 24));
    f->x = alb_axis_make(panel->log_x, f->x_range.minimum, f->x_range.maximum, f->left, f->right,
                         (int)((f->right - f->left) / 70));
}

// Heights by weight; the widest label of all panels sets the one left edge.
static void lay_out(alb_frame *frames, const alb_panel *panels, size_t count, int width, int height)
{
    double weights = 0, top = 4, left = 40;
    for (size_t i = 0; i < count; i++)
        weights += panels[i].height > 0 ? panels[i].height : 1;
    for (size_t i = 0; i < count; i++) {
        alb_frame *f = &frames[i];
        f->top = top;
        f->bottom = top += (panels[i].height > 0 ? panels[i].height : 1) / weights * (height - 8);
        f->left = 70, f->right = width - RIGHT_PAD;
        alb_frame trial = *f;
        place_frame(&trial, &panels[i]);
        left = fmax(left, 34 + widest_label(&trial.y) * ALB_PLOT_CHARACTER_PX);
    }
    for (size_t i = 0; i < count; i++) {
        frames[i].left = left;
        place_frame(&frames[i], &panels[i]);
    }
}

void alb_plot_add(alb_text *svg, const alb_panel *panels, size_t panel_count, int width, int height)
{
    alb_frame *frames = alb_allocate(panel_count, sizeof *frames, NULL);
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
        alb_plot_strip(svg, &panels[i], &frames[i]);
        alb_plot_panel(svg, &panels[i], &frames[i]);
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

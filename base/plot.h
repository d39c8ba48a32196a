// Line plots as SVG: panels one above the other with a shared look, axes with ticks, legend, error bars.
#pragma once
#include "base/error.h"
#include "base/text.h"
#include <stddef.h>

typedef enum alb_mark { ALB_MARK_LINE, ALB_MARK_DASHES, ALB_MARK_POINTS, ALB_MARK_LINE_AND_POINTS } alb_mark;

typedef struct alb_curve {
    const char *label;        // NULL: not in the legend
    const char *colour;       // any SVG colour; NULL takes the next of the palette
    const double *x, *y, *sd; // sd may be NULL: vertical bars of one sd where given
    size_t count;
    alb_mark mark;
} alb_curve;

typedef struct alb_panel {
    const char *title, *x_label, *y_label; // each may be NULL
    bool log_x, log_y;                     // points that are not positive are left out on a logarithmic axis
    double y_minimum, y_maximum;           // both 0: from the data
    const alb_curve *curves;
    size_t curve_count;
    double height; // share of the picture's height, relative to the other panels
} alb_panel;

// Appends one <svg> element. Points that are not finite are left out; an empty panel says "no data".
void alb_plot_add(alb_text *svg, const alb_panel *panels, size_t panel_count, int width, int height);
// The same as a file.
bool alb_plot_write(const char *path, const alb_panel *panels, size_t panel_count, int width, int height,
                    alb_error *error);

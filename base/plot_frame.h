// What laying out a plot and drawing it share: where each panel's frame stands, in pixels.
#pragma once
#include "base/axis.h"
#include "base/plot.h"

enum { ALB_PLOT_TITLE_ROW = 20, ALB_PLOT_TICK_ROW = 18 };
#define ALB_PLOT_CHARACTER_PX 6.6 // of the 12 px sans-serif text, on the wide side

typedef struct alb_range {
    double minimum, maximum;
    bool known;
} alb_range;

typedef struct alb_frame {
    double left, top, right, bottom, strip_top;
    alb_range x_range, y_range;
    alb_axis x, y;
    bool x_numbers; // tick labels stand below this panel
} alb_frame;

// Whether point i can be shown on the panel's axes, and whether it has a bar.
bool alb_plot_drawable(const alb_panel *panel, const alb_curve *curve, size_t i);
bool alb_plot_has_bar(const alb_curve *curve, size_t i);

// Title and legend in reading order, wrapped between the edges; returns the number of rows. svg NULL: only counts.
int alb_plot_strip(alb_text *svg, const alb_panel *panel, const alb_frame *f);
// All that stands in and around the frame, below the strip.
void alb_plot_panel(alb_text *svg, const alb_panel *panel, const alb_frame *f);

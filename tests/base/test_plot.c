#include "base/axis.h"
#include "base/plot.h"
#include "base/random.h"
#include "check.h"
#include "well_formed.h"
#include <stdio.h>
#include <string.h>

static void ticks_are_round_and_inside(void **state)
{
    (void)state;
    for (uint64_t i = 0; i < 20000; i++) {
        alb_random random = alb_random_at(1, 0, i);
        const double size = pow(10, 600 * alb_random_uniform(&random) - 300);
        const double low = size * (alb_random_uniform(&random) - 0.5);
        const double high = low + size * pow(10, -8 * alb_random_uniform(&random));
        const int wanted = 5 + (int)(12 * alb_random_uniform(&random));
        const alb_axis axis = alb_axis_make(false, low, high, 0, 100, wanted);
        assert_true(axis.tick_count >= 2 && axis.tick_count <= wanted + 1);
        const double step = axis.ticks[1] - axis.ticks[0];
        const double leading = step / pow(10, floor(log10(step) + 1e-6));
        if (fabs(axis.ticks[0]) < 1e6 * step) // else the difference of two ticks is itself rounded
            assert_true(fabs(leading - 1) < 1e-6 || fabs(leading - 2) < 1e-6 || fabs(leading - 5) < 1e-6);
        for (int t = 0; t < axis.tick_count; t++) {
            const double at = alb_axis_at(&axis, axis.ticks[t]);
            assert_true(at > -0.01 && at < 100.01);
            char label[ALB_TICK_LABEL];
            assert_true(alb_axis_label(label, &axis, t) <= 16); // narrow: large and small values get a common factor
            const bool negative = strncmp(label, "\u2212", 3) == 0;
            const double read = strtod(label + (negative ? 3 : 0), NULL) * pow(10, axis.exponent);
            check_near(negative ? -read : read, axis.ticks[t], 1e-3 * step); // the label says the tick's value
        }
    }
}

static void decades_where_the_axis_spans_them(void **state)
{
    (void)state;
    char label[ALB_TICK_LABEL];
    alb_axis axis = alb_axis_make(true, 3e-5, 2.0, 0, 100, 8);
    assert_true(axis.by_decades);
    assert_int_equal(axis.tick_count, 5); // 1e-4 ... 1
    alb_axis_label(label, &axis, 0);
    assert_non_null(strstr(label, "\u22124</tspan>"));
    check_near(alb_axis_at(&axis, sqrt(3e-5 * 2.0)), 50, 1e-9); // the geometric middle
    axis = alb_axis_make(true, 0.3, 0.8, 0, 100, 8);
    assert_false(axis.by_decades);
    assert_true(axis.tick_count >= 3);
    axis = alb_axis_make(true, 1e-300, 1e300, 0, 100, 8);
    assert_true(axis.tick_count >= 4 && axis.tick_count <= 9);
    axis = alb_axis_make(false, 0, 0, 0, 100, 8);
    check_near(alb_axis_at(&axis, 0), 50, 1e-9);
}

static char *drawn(const alb_panel *panels, size_t count)
{
    alb_text svg = {0};
    alb_plot_add(&svg, panels, count, 640, 480);
    assert_false(svg.failed);
    assert_true(well_formed(svg.bytes));
    assert_null(strstr(svg.bytes, "nan"));
    assert_null(strstr(svg.bytes, "inf"));
    return svg.bytes;
}

static void points_and_bars_stand_where_they_should(void **state)
{
    (void)state;
    const double x[] = {0, 5, 10}, y[] = {1, NAN, 3}, sd[] = {0.5, 0.5, 0};
    const alb_curve curve = {.label = "a", .x = x, .y = y, .sd = sd, .count = 3, .mark = ALB_MARK_POINTS};
    const alb_panel panel = {.curves = &curve, .curve_count = 1};
    char *svg = drawn(&panel, 1);
    assert_int_equal(occurrences(svg, "<circle"), 2 + 1); // two points and the legend's
    assert_int_equal(occurrences(svg, "m-2 0h4M"), 1);    // one bar: the other point has no sd
    double x0, y0, x1, y1;
    const char *first = strstr(strstr(svg, "<g stroke=\"none\""), "<circle");
    assert_int_equal(sscanf(first, "<circle cx=\"%lf\" cy=\"%lf\"", &x0, &y0), 2);
    assert_int_equal(sscanf(strstr(first + 1, "<circle"), "<circle cx=\"%lf\" cy=\"%lf\"", &x1, &y1), 2);
    assert_true(x1 > x0 && y1 < y0); // upwards on the page is a smaller y
    free(svg);
}

static void hostile_numbers_leave_no_trace(void **state)
{
    (void)state;
    const double x[] = {NAN, INFINITY, -1, 0, 1e-320, 1e308, 1, 2}, y[] = {1, 1, 1, 1, 1, 1, -5, 1e308};
    const double sd[] = {1, 1, 1, 1, 1, 1, INFINITY, NAN};
    const alb_curve curve = {.x = x, .y = y, .sd = sd, .count = 8, .mark = ALB_MARK_LINE_AND_POINTS};
    for (int kind = 0; kind < 4; kind++) {
        const alb_panel panel = {.log_x = kind & 1, .log_y = kind & 2, .curves = &curve, .curve_count = 1};
        free(drawn(&panel, 1));
    }
    const alb_panel linear = {.curves = &curve, .curve_count = 1};
    char *bars = drawn(&linear, 1);
    assert_int_equal(occurrences(bars, "m-2 0h4M"), 3); // x = -1, 0, 1e-320; the rest have no place or no finite sd
    free(bars);
    const alb_panel both_log = {.log_x = true, .log_y = true, .curves = &curve, .curve_count = 1};
    char *svg = drawn(&both_log, 1);
    assert_non_null(strstr(svg, "no data")); // nothing positive and finite in both
    free(svg);
    const alb_panel empty[2] = {{.title = "t"}, {.y_minimum = 3, .y_maximum = 1}};
    free(drawn(empty, 2));
    free(drawn(NULL, 0));
}

static void bar_below_zero_runs_out_of_a_logarithmic_frame(void **state)
{
    (void)state;
    const double x[] = {1, 2}, y[] = {1e-3, 1}, sd[] = {1, 0};
    const alb_curve curve = {.x = x, .y = y, .sd = sd, .count = 2, .mark = ALB_MARK_POINTS};
    const alb_panel panel = {.log_y = true, .curves = &curve, .curve_count = 1};
    char *svg = drawn(&panel, 1);
    double bar_x, bar_y, bottom;
    assert_int_equal(sscanf(strstr(svg, "stroke-opacity=\"0.6\" d=\"M"), "stroke-opacity=\"0.6\" d=\"M%lf %lfV%lf",
                            &bar_x, &bar_y, &bottom),
                     3);
    assert_true(bar_y > bottom - 1e9 && bar_y > 400);
    free(svg);
}

// Twice the palette: every line of the legend is drawn in its own way.
static void many_curves_stay_distinct(void **state)
{
    (void)state;
    enum { CURVES = 14 };
    const double x[] = {1, 2};
    alb_curve curves[CURVES];
    for (int c = 0; c < CURVES; c++)
        curves[c] =
            (alb_curve){.label = "one", .x = x, .y = x, .count = 2, .mark = c % 2 ? ALB_MARK_DASHES : ALB_MARK_LINE};
    const alb_panel panel = {.curves = curves, .curve_count = CURVES, .height = 1};
    alb_text svg = {0};
    char styles[CURVES][96];
    int found = 0;
    alb_plot_add(&svg, &panel, 1, 600, 400);
    for (const char *at = svg.bytes; (at = strstr(at, "h22\" stroke-width")); at++, found++) {
        assert_true(found < CURVES);
        snprintf(styles[found], sizeof styles[found], "%.*s", (int)strcspn(at, ">"), at);
        for (int before = 0; before < found; before++)
            assert_string_not_equal(styles[before], styles[found]);
    }
    assert_int_equal(found, CURVES);
    alb_text_free(&svg);
}

static void texts_are_escaped(void **state)
{
    (void)state;
    const double x[] = {1, 2};
    const alb_curve curve = {.label = "a<b & \"c\"", .colour = "\"/><script>", .x = x, .y = x, .count = 2};
    const alb_panel panel = {.title = "\xff\xfe\x01<svg>", .x_label = "]]>", .curves = &curve, .curve_count = 1};
    char *svg = drawn(&panel, 1);
    assert_null(strstr(svg, "<script"));
    assert_non_null(strstr(svg, "a&lt;b &amp; &quot;c&quot;"));
    assert_non_null(strstr(svg, "\xef\xbf\xbd\xef\xbf\xbd\xef\xbf\xbd&lt;svg&gt;"));
    free(svg);
}

static void panels_share_an_axis(void **state)
{
    (void)state;
    const double x[] = {0, 10}, wide[] = {-90, 90};
    const alb_curve narrow = {.x = x, .y = x, .count = 2}, other = {.x = wide, .y = wide, .count = 2};
    alb_panel panels[2] = {{.curves = &narrow, .curve_count = 1},
                           {.x_label = "r (mm)", .curves = &other, .curve_count = 1}};
    char *svg = drawn(panels, 2);
    assert_int_equal(occurrences(svg, ">\u221250</text>"),
                     1 + 1); // y of the lower panel and the shared x, numbered once
    double left, right, y;
    const char *line = strstr(svg, "stroke-linejoin");
    assert_int_equal(sscanf(strstr(line, "d=\"M"), "d=\"M%lf %lfL%lf", &left, &y, &right), 3);
    check_below(right - left, 640 * 10.0 / 180); // 10 of 180 units wide, not the whole panel
    free(svg);
    panels[0].x_label = "another";
    svg = drawn(panels, 2);
    assert_non_null(strstr(svg, ">another<"));
    free(svg);
}

static void written_file_is_the_text(void **state)
{
    (void)state;
    alb_error error = {0};
    const double x[] = {1, 2};
    const alb_curve curve = {.x = x, .y = x, .count = 2};
    const alb_panel panel = {.curves = &curve, .curve_count = 1};
    check_ok(alb_plot_write("test_plot.svg", &panel, 1, 640, 480, &error), &error);
    check_fails(alb_plot_write("/nowhere/at/all.svg", &panel, 1, 640, 480, &error), &error, ALB_ACCESS, "all.svg");
    char *svg = drawn(&panel, 1), read[65536] = "";
    FILE *file = fopen("test_plot.svg", "r");
    assert_non_null(file);
    read[fread(read, 1, sizeof read - 1, file)] = '\0';
    fclose(file);
    assert_string_equal(read, svg);
    free(svg);
    remove("test_plot.svg");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(ticks_are_round_and_inside),
        cmocka_unit_test(decades_where_the_axis_spans_them),
        cmocka_unit_test(points_and_bars_stand_where_they_should),
        cmocka_unit_test(hostile_numbers_leave_no_trace),
        cmocka_unit_test(bar_below_zero_runs_out_of_a_logarithmic_frame),
        cmocka_unit_test(many_curves_stay_distinct),
        cmocka_unit_test(texts_are_escaped),
        cmocka_unit_test(panels_share_an_axis),
        cmocka_unit_test(written_file_is_the_text),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

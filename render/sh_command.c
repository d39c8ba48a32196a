// alabaster sh-table: matrices of angular scaling for other programs.
#include "base/command.h"
#include "base/memory.h"
#include "base/text.h"
#include "render/sh_scale.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { RATIOS_MAX = 1000 };

static const char usage[] =
    "usage: alabaster sh-table --map cone|midrange|sphere --k LIST [--alpha DEG] [--order N] [--in-order L]\n"
    "                          [--measure visibility|energy|light|occlusion|regressed] [--format csv|c|glsl]\n"
    "\n"
    "Prints the matrices of spherical-harmonics scaling (docs/sh.md): the function as a receiver sees it from the one\n"
    "that a sample point on the same axis (z) saw. Real orthonormal harmonics, order N = bands 0 to N - 1.\n"
    "  --map       cone: k is the receiver's distance over the sample's, from the object's centre; half-angle --alpha "
    "(45).\n"
    "              midrange: k is the receiver's distance from the environment's centre over its radius, -1 < k < 1.\n"
    "              sphere: as cone, by tangents to spheres; occlusion only.\n"
    "  --k         K[,K...], or FROM:TO:COUNT, equal ratios for cone and sphere, equal steps for midrange.\n"
    "  --order     of what comes out, 1 to 8 (4); --in-order: of what goes in, as --order where not given.\n"
    "  --measure   visibility (the default; occlusion for sphere) and energy: as in the paper. light: energy / k^2, "
    "what a\n"
    "              lamp does. occlusion: of 1 - visibility, fades away from afar. regressed: the same, fitted to "
    "clusters\n"
    "              of spheres, order 4.\n"
    "  --format    csv (the default): k,m,l_out,l_in,value, a row per entry with m >= 0; -m has the values of m.\n"
    "              c, glsl: constant tables and a function that applies one of them.";

static bool read_ratio(double *out, const char *text, size_t length, alb_error *error)
{
    char number[64], *end;
    if (length == 0 || length >= sizeof number)
        return alb_fail(error, ALB_USAGE, "--k %.60s: expected numbers, as 0.5,1,2 or 0.25:8:40", text);
    memcpy(number, text, length);
    number[length] = '\0';
    *out = strtod(number, &end);
    return (*end == '\0' && isfinite(*out)) ||
           alb_fail(error, ALB_USAGE, "--k %.60s: '%s' is not a number", text, number);
}

static bool read_range(double *ratios, int *count, const char *text, bool midrange, alb_error *error)
{
    double bounds[3];
    const char *at = text;
    for (int i = 0; i < 3; i++) {
        const size_t length = strcspn(at, ":");
        if (!read_ratio(&bounds[i], at, length, error))
            return false;
        if ((i == 2) != (at[length] == '\0'))
            return alb_fail(error, ALB_USAGE, "--k %.60s: expected FROM:TO:COUNT", text);
        at += length + 1;
    }
    if (!(bounds[2] >= 2 && bounds[2] <= RATIOS_MAX) || bounds[2] != floor(bounds[2]))
        return alb_fail(error, ALB_USAGE, "--k %.60s: expected a count from 2 to %d", text, RATIOS_MAX);
    if (!(bounds[1] > bounds[0]) || (!midrange && !(bounds[0] > 0)))
        return alb_fail(error, ALB_USAGE, "--k %.60s: expected FROM below TO%s", text,
                        midrange ? "" : ", both above 0");
    *count = (int)bounds[2];
    for (int i = 0; i < *count; i++) {
        const double t = (double)i / (*count - 1);
        ratios[i] = midrange ? bounds[0] + t * (bounds[1] - bounds[0]) : bounds[0] * pow(bounds[1] / bounds[0], t);
    }
    return true;
}

static bool read_ratios(double *ratios, int *count, const char *text, bool midrange, alb_error *error)
{
    if (strchr(text, ':'))
        return read_range(ratios, count, text, midrange, error);
    for (*count = 0;; text++) {
        const size_t length = strcspn(text, ",");
        if (*count == RATIOS_MAX)
            return alb_fail(error, ALB_USAGE, "--k: more than %d numbers", RATIOS_MAX);
        if (!read_ratio(&ratios[(*count)++], text, length, error))
            return false;
        text += length;
        if (!*text)
            return true;
    }
}

static bool find_name(int *out, const char *option, const char *name, const char *const *names, int count,
                      alb_error *error)
{
    for (*out = 0; *out < count; ++*out)
        if (!strcmp(names[*out], name))
            return true;
    return alb_fail(error, ALB_USAGE, "%s %.40s: 'alabaster help sh-table' lists what there is", option, name);
}

static bool read_order(int *out, const char *option, const char *text, alb_error *error)
{
    double number;
    if (!text)
        return true;
    if (!alb_option_number(&number, option, text, 1, ALB_SH_ORDER_MAX, error))
        return false;
    *out = (int)number;
    return number == *out || alb_fail(error, ALB_USAGE, "%s %s: expected a whole number", option, text);
}

static void put_float(alb_text *text, double value)
{
    char number[40];
    snprintf(number, sizeof number, "%.9g", value);
    alb_text_add(text, "%s%s", number, strpbrk(number, ".e") ? "" : ".0"); // GLSL ES takes no whole number for a float
}

static void put_csv(alb_text *text, const alb_sh_scaling *s, double k)
{
    const double *value = s->value;
    for (int m = 0; m < s->order_out && m < s->order_in; m++)
        for (int l = m; l < s->order_out; l++)
            for (int j = m; j < s->order_in; j++)
                alb_text_add(text, "%.17g,%d,%d,%d,%.17g\n", k, m, l, j, *value++);
}

// What C and GLSL share: the ratios, then the values, a row per ratio, blocks m = 0, 1, ... of rows l_out, columns
// l_in.
static void put_source(alb_text *text, const alb_sh_law *law, const double *ratios, const alb_sh_scaling *all,
                       int count, bool glsl)
{
    const int values = alb_sh_scaling_count(law->order_out, law->order_in);
    const int out = law->order_out, in = law->order_in;
    alb_text_add(text, "// alabaster sh-table: %s of the %s map", alb_sh_law_names[law->kind],
                 alb_sh_map_names[law->map]);
    if (law->map == ALB_SH_MAP_CONE)
        alb_text_add(text, ", alpha %.9g degrees", law->alpha_deg);
    alb_text_add(text, ". Rows: k; columns: blocks m = 0, 1, ... of l_out by l_in, from l = m.\n");
    alb_text_add(text, glsl ? "const float sh_scaling_k[%d] = float[%d](" : "static const float sh_scaling_k[%d] = {",
                 count, count);
    for (int i = 0; i < count; i++) {
        alb_text_add(text, "%s", i ? ", " : "");
        put_float(text, ratios[i]);
    }
    alb_text_add(text,
                 glsl ? ");\nconst float sh_scaling[%d] = float[%d](" : "};\nstatic const float sh_scaling[%d] = {",
                 count * values, count * values);
    for (int i = 0; i < count * values; i++) {
        alb_text_add(text, "%s%s", i ? "," : "", i % 8 ? " " : "\n    ");
        const double value = all[i / values].value[i % values];
        put_float(text, fabs(value) < 1e-13 ? 0 : value); // what rounding has left of a zero
    }
    alb_text_add(text, glsl ? ");\n" : "};\n");
    alb_text_add(text, "// to[%d] = matrix `row` times from[%d]; harmonic (l, m) at l (l + 1) + m.\n", out * out,
                 in * in);
    alb_text_add(text,
                 glsl ? "void sh_scale(out float to[%d], int row, float from[%d])\n{\n"
                      : "static inline void sh_scale(float to[%d], int row, const float from[%d])\n{\n",
                 out * out, in * in);
    alb_text_add(text,
                 "    int at = row * %d;\n"
                 "    for (int i = 0; i < %d; i++)\n        to[i] = 0.0%s;\n"
                 "    for (int m = 0; m < %d; m++)\n        for (int l = m; l < %d; l++)\n"
                 "            for (int j = m; j < %d; j++, at++) {\n"
                 "                to[l * (l + 1) + m] += sh_scaling[at] * from[j * (j + 1) + m];\n"
                 "                if (m > 0)\n"
                 "                    to[l * (l + 1) - m] += sh_scaling[at] * from[j * (j + 1) - m];\n"
                 "            }\n}\n",
                 values, out * out, glsl ? "" : "f", out < in ? out : in, out, in);
}

static bool make(alb_text *text, const alb_sh_law *law, const double *ratios, int count, int format, alb_error *error)
{
    alb_sh_scaling *all = alb_allocate((size_t)count, sizeof *all, error);
    bool ok = all != NULL;
    for (int i = 0; i < count && ok; i++)
        ok = alb_sh_law_at(&all[i], law, ratios[i], error);
    if (ok && format == 0) {
        alb_text_add(text, "k,m,l_out,l_in,value\n");
        for (int i = 0; i < count; i++)
            put_csv(text, &all[i], ratios[i]);
    } else if (ok) {
        put_source(text, law, ratios, all, count, format == 2);
    }
    free(all);
    return ok;
}

static bool run(int argc, char **argv, alb_error *error)
{
    static const char *const formats[] = {"csv", "c", "glsl"};
    const char *map = NULL, *k = NULL, *alpha = NULL, *order = NULL, *in_order = NULL, *measure = NULL, *format = NULL;
    const alb_option options[] = {{"--map", NULL, true, &map, NULL},
                                  {"--k", NULL, true, &k, NULL},
                                  {"--alpha", NULL, false, &alpha, NULL},
                                  {"--order", NULL, false, &order, NULL},
                                  {"--in-order", NULL, false, &in_order, NULL},
                                  {"--measure", NULL, false, &measure, NULL},
                                  {"--format", NULL, false, &format, NULL}};
    alb_sh_law law = {.alpha_deg = 45, .order_out = 4};
    double ratios[RATIOS_MAX];
    int count = 0, kind, map_kind, shape;
    if (!alb_options_read(options, sizeof options / sizeof options[0], argc, argv, error) ||
        !find_name(&map_kind, "--map", map, alb_sh_map_names, ALB_SH_MAP_CUSTOM, error) ||
        !find_name(&shape, "--format", format ? format : "csv", formats, 3, error))
        return false;
    law.map = (alb_sh_map_kind)map_kind;
    const char *usual = law.map == ALB_SH_MAP_SPHERE ? "occlusion" : "visibility";
    if (!find_name(&kind, "--measure", measure ? measure : usual, alb_sh_law_names, ALB_SH_LAWS, error) ||
        !read_order(&law.order_out, "--order", order, error))
        return false;
    law.kind = (alb_sh_law_kind)kind, law.order_in = law.order_out;
    if (alpha && law.map != ALB_SH_MAP_CONE)
        return alb_fail(error, ALB_USAGE, "--alpha goes with --map cone");
    if (!read_order(&law.order_in, "--in-order", in_order, error) ||
        (alpha && !alb_option_number(&law.alpha_deg, "--alpha", alpha, 10, 80, error)) ||
        !read_ratios(ratios, &count, k, law.map == ALB_SH_MAP_MIDRANGE, error))
        return false;
    alb_text text = {0};
    bool ok = make(&text, &law, ratios, count, shape, error);
    if (ok && text.failed)
        ok = alb_fail(error, ALB_NO_MEMORY, "out of memory for the table");
    if (ok)
        fwrite(text.bytes, 1, text.size, stdout);
    alb_text_free(&text);
    return ok;
}

const alb_command alb_sh_table_command = {"sh-table", "matrices of spherical-harmonics scaling, as CSV, C or GLSL",
                                          usage, run};

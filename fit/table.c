// Readings from a table of a profile.
//
// Without a column of sd the noise is taken as a constant share of the value, from the scatter of each value about the
// straight line (in r) through its two neighbours: for neighbours at shares w and 1 - w the residual has the variance
// s^2 (v^2 + w^2 v1^2 + (1 - w)^2 v2^2). s is 1.4826 times the median of the whitened residuals, so that a few outliers
// do not make it. Stops being true where the points are so sparse that the curvature of the profile shows between
// neighbours: s is then too large, the fit too lenient. At least 1e-6 of the value (tables are rounded).
// A reading stands for the annulus that reaches half way to its neighbours.
#include "fit/table.h"
#include "base/file.h"
#include "base/memory.h"
#include "base/statistics.h"
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { ROWS_MAX = 100000 };

typedef struct cursor {
    const char *name, *at;
    int line, column; // column: which cell, from 1
} cursor;

static bool bad(alb_error *error, const cursor *c, const char *what)
{
    int length = (int)strcspn(c->at, ",\r\n");
    return alb_fail(error, ALB_BAD_DATA, "%s:%d: column %d: %s, found '%.*s'", c->name, c->line, c->column, what,
                    length < 40 ? length : 40, c->at);
}

// A number in plain decimal notation, nothing else around it.
static bool read_number(double *out, cursor *c, bool last, alb_error *error)
{
    const size_t length = strcspn(c->at, ",\r\n");
    char *end;
    if (length == 0 || strspn(c->at, "+-.0123456789eE") < length)
        return bad(error, c, "a number is wanted");
    *out = strtod(c->at, &end);
    if (end != c->at + length || !isfinite(*out))
        return bad(error, c, "a finite number is wanted");
    if (fabs(*out) > 1e60 || (*out != 0 && fabs(*out) < 1e-60))
        return bad(error, c, "a number from 1e-60 to 1e60 is wanted: beyond, squares are lost");
    c->at = end;
    if (last ? *c->at == ',' : *c->at != ',') {
        c->column++;
        return bad(error, c, last ? "the line should end here" : "another cell is wanted");
    }
    if (!last) {
        c->at++;
        c->column++;
    }
    return true;
}

// A line ends with LF or CR LF, the last one also with the file.
static bool end_line(cursor *c, alb_error *error)
{
    c->at += *c->at == '\r';
    if (*c->at && *c->at != '\n')
        return alb_fail(error, ALB_BAD_DATA, "%s:%d: the line ends in CR alone; LF or CR LF is wanted", c->name,
                        c->line);
    c->at += *c->at == '\n';
    c->line++;
    c->column = 1;
    return true;
}

static bool read_header(bool *with_sd, cursor *c, alb_error *error)
{
    static const char plain[] = "r_mm,value_per_mm2", with[] = "r_mm,value_per_mm2,sd_per_mm2";
    const size_t length = strcspn(c->at, "\r\n");
    *with_sd = length == sizeof with - 1 && strncmp(c->at, with, length) == 0;
    if (!*with_sd && (length != sizeof plain - 1 || strncmp(c->at, plain, length) != 0))
        return alb_fail(error, ALB_BAD_DATA, "%s:1: the header should be '%s' or '%s', found '%.*s'", c->name, plain,
                        with, (int)(length < 60 ? length : 60), c->at);
    c->at += length;
    return end_line(c, error);
}

static int count_lines(const char *text)
{
    int count = 0;
    for (; *text && count <= ROWS_MAX; count++) {
        text += strcspn(text, "\n");
        text += *text == '\n';
    }
    return count;
}

static bool read_rows(alb_readings *readings, cursor *c, bool with_sd, alb_error *error)
{
    for (int i = 0; i < readings->count; i++) {
        cursor at = *c;
        if (!read_number(&readings->r_mm[i], c, false, error))
            return false;
        if (readings->r_mm[i] < 0 || (i && readings->r_mm[i] <= readings->r_mm[i - 1]))
            return bad(error, &at, "distances must be positive and rise from line to line");
        if (!read_number(&readings->value[i], c, !with_sd, error))
            return false;
        at = *c;
        if (with_sd && !read_number(&readings->sd[i], c, true, error))
            return false;
        if (with_sd && !(readings->sd[i] > 0))
            return bad(error, &at, "the sd must be positive");
        if (!end_line(c, error))
            return false;
    }
    return true;
}

static bool estimate_sd(alb_readings *readings, alb_error *error)
{
    const int n = readings->count;
    double *scatter = alb_allocate((size_t)n, sizeof(double), error), top = 0;
    if (!scatter)
        return false;
    size_t count = 0;
    for (int i = 1; i + 1 < n; i++) {
        const double *r = readings->r_mm + i, *v = readings->value + i;
        const double w = (r[1] - r[0]) / (r[1] - r[-1]);
        const double size = sqrt(v[0] * v[0] + w * w * v[-1] * v[-1] + (1 - w) * (1 - w) * v[1] * v[1]);
        if (size > 0)
            scatter[count++] = fabs(v[0] - w * v[-1] - (1 - w) * v[1]) / size;
    }
    const double relative = count ? fmax(1.4826 * alb_median(scatter, count), 1e-6) : 1;
    free(scatter);
    for (int i = 0; i < n; i++)
        top = fmax(top, fabs(readings->value[i]));
    for (int i = 0; i < n; i++)
        readings->sd[i] = fmax(relative * fabs(readings->value[i]), 1e-9 * relative * top);
    return true;
}

static void complete(alb_readings *readings)
{
    const int n = readings->count;
    const double *r = readings->r_mm;
    for (int i = 0; i < n; i++) {
        const double before = i ? r[i] - r[i - 1] : n > 1 ? r[1] - r[0] : r[0];
        const double after = i + 1 < n ? r[i + 1] - r[i] : before;
        const double low = i || r[0] > 0 ? fmax(r[i] - before / 2, 0) : 0, high = r[i] + after / 2;
        readings->area_mm2[i] = M_PI * (high * high - low * low);
        readings->sample_r_mm[i][0] = r[i];
        readings->sample_share[i][0] = 1;
        readings->sample_value[i][0] = readings->value[i];
        readings->outer_mm = readings->complete_mm = r[i];
    }
}

bool alb_table_parse(alb_readings *readings, const char *name, const char *bytes, alb_error *error)
{
    bool ok = false, with_sd, signal = false;
    cursor c = {name, bytes, 1, 1};
    *readings = (alb_readings){0};
    if (!read_header(&with_sd, &c, error))
        return false;
    const int count = count_lines(c.at);
    if (count == 0)
        return alb_fail(error, ALB_BAD_DATA, "%s: no line after the header", name);
    if (count > ROWS_MAX)
        return alb_fail(error, ALB_BAD_DATA, "%s: more than %d lines", name, ROWS_MAX);
    if (!alb_readings_create(readings, count, error) || !read_rows(readings, &c, with_sd, error) ||
        (!with_sd && !estimate_sd(readings, error)))
        goto done;
    for (int i = 0; i < count; i++)
        signal |= readings->value[i] > 0;
    if (!signal) {
        alb_fail(error, ALB_BAD_DATA, "%s: no value is positive", name);
        goto done;
    }
    complete(readings);
    ok = true;
done:
    if (!ok)
        alb_readings_free(readings);
    return ok;
}

bool alb_table_read(alb_readings *readings, const char *path, alb_error *error)
{
    char *bytes = NULL;
    size_t size = 0;
    *readings = (alb_readings){0};
    if (!alb_file_read(&bytes, &size, path, error))
        return false;
    bool ok = strlen(bytes) == size;
    if (!ok)
        alb_fail(error, ALB_BAD_DATA, "%s: not a text: a zero byte at %zu", path, strlen(bytes));
    ok = ok && alb_table_parse(readings, path, bytes, error);
    free(bytes);
    return ok;
}

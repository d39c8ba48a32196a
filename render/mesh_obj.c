// Wavefront OBJ: v, f, usemtl; what does not concern geometry is passed over by name; anything else is an error.
// Indices count from 1, negative ones back from the last vertex. A backslash at the end of a line continues it.
#include "render/mesh.h"
#include <ctype.h>
#include <errno.h>
#include <stdlib.h>
#include <string.h>

typedef struct reader {
    alb_mesh *mesh;
    const char *name;
    size_t line;
    uint16_t group;
    bool has_group;
    alb_error *error;
} reader;

static const char *const passed_over[] = {"vt",         "vn",        "vp",  "g",     "o",        "s",
                                          "mg",         "mtllib",    "l",   "p",     "usemap",   "maplib",
                                          "shadow_obj", "trace_obj", "lod", "bevel", "c_interp", "d_interp"};

static bool fail(const reader *in, const char *what, const char *found)
{
    return alb_fail(in->error, ALB_BAD_DATA, "%s:%zu: %s: '%.40s'", in->name, in->line, what, found);
}

static char *skip_spaces(char *at)
{
    while (*at == ' ' || *at == '\t' || *at == '\r')
        at++;
    return at;
}

static bool read_vertex(reader *in, char *at)
{
    double value[3];
    for (int k = 0; k < 3; k++) {
        char *end;
        at = skip_spaces(at);
        value[k] = strtod(at, &end);
        if (end == at || (*end && !isspace((unsigned char)*end)))
            return fail(in, "a vertex needs three numbers, found", at);
        if (!isfinite(value[k]) || fabs(value[k]) > 1e15)
            return fail(in, "a coordinate is not a usable number", at);
        at = end;
    }
    return alb_mesh_add_vertex(in->mesh, (alb_vector){value[0], value[1], value[2]}, in->error);
}

// One corner "i", "i/t", "i//n" or "i/t/n"; only i is kept.
static bool read_corner(uint32_t *corner, reader *in, char **at)
{
    char *end;
    errno = 0;
    const long index = strtol(*at, &end, 10);
    const long count = (long)in->mesh->vertex_count;
    if (end == *at)
        return fail(in, "a face needs vertex indices, found", *at);
    if (errno || index == 0 || index > count || index < -count)
        return fail(in, "a face refers to a vertex that is not there", *at);
    while (*end == '/' || *end == '-' || isdigit((unsigned char)*end))
        end++;
    if (*end && !isspace((unsigned char)*end))
        return fail(in, "a face corner is not of the form i/t/n", *at);
    *corner = (uint32_t)(index > 0 ? index - 1 : count + index);
    *at = skip_spaces(end);
    return true;
}

static bool read_face(reader *in, char *at)
{
    uint32_t first = 0, previous = 0;
    int corners = 0;
    for (at = skip_spaces(at); *at; corners++) {
        uint32_t corner = 0;
        if (!read_corner(&corner, in, &at))
            return false;
        if (corners == 0)
            first = corner;
        else if (corners >= 2 && !alb_mesh_add_face(in->mesh, first, previous, corner, in->group, in->error))
            return false;
        previous = corner;
    }
    return corners >= 3 || fail(in, "a face needs three corners or more",
                                corners == 2 ? "two"
                                : corners    ? "one"
                                             : "none");
}

static bool read_group(reader *in, char *at)
{
    at = skip_spaces(at);
    for (size_t n = strlen(at); n && isspace((unsigned char)at[n - 1]); n--)
        at[n - 1] = 0;
    in->has_group = true;
    return alb_mesh_add_group(&in->group, in->mesh, at, in->error);
}

static bool read_line(reader *in, char *at)
{
    at = skip_spaces(at);
    if (!*at || *at == '#')
        return true;
    char *comment = strchr(at, '#');
    if (comment)
        *comment = 0;
    const size_t length = strcspn(at, " \t\r");
    char *rest = at + length;
    if (length == 1 && *at == 'v')
        return read_vertex(in, rest);
    if (length == 1 && *at == 'f') {
        if (!in->has_group && !read_group(in, rest + strlen(rest)))
            return false;
        return read_face(in, rest);
    }
    if (length == 6 && !strncmp(at, "usemtl", 6))
        return read_group(in, rest);
    for (size_t i = 0; i < sizeof passed_over / sizeof *passed_over; i++)
        if (strlen(passed_over[i]) == length && !strncmp(at, passed_over[i], length))
            return true;
    return fail(in, "not a statement of an OBJ file", at);
}

bool alb_mesh_parse_obj(alb_mesh *mesh, const char *name, const char *bytes, size_t size, alb_error *error)
{
    bool ok = false;
    alb_mesh read = {0};
    reader in = {.mesh = &read, .name = name, .error = error};
    if (memchr(bytes, 0, size))
        return alb_fail(error, ALB_BAD_DATA, "%s: neither a PLY nor an OBJ file: it holds zero bytes", name);
    char *text = malloc(size + 1);
    if (!text)
        return alb_fail(error, ALB_NO_MEMORY, "out of memory for %s", name);
    memcpy(text, bytes, size);
    text[size] = 0;
    for (char *at = text, *next; at; at = next) {
        next = strchr(at, '\n');
        in.line++;
        while (next && next > at && (next[-1] == '\\' || (next - at > 1 && next[-1] == '\r' && next[-2] == '\\'))) {
            next[0] = ' ';
            next[-1] = ' ';
            if (next - at > 1 && next[-2] == '\\')
                next[-2] = ' ';
            next = strchr(next, '\n');
            in.line++;
        }
        if (next)
            *next++ = 0;
        if (!read_line(&in, at))
            goto done;
    }
    if (!read.face_count) {
        alb_fail(error, ALB_BAD_DATA, "%s: holds no face (%zu vertices, %zu faces without area)", name,
                 read.vertex_count, read.dropped);
        goto done;
    }
    *mesh = read;
    read = (alb_mesh){0};
    ok = true;
done:
    free(text);
    alb_mesh_free(&read);
    return ok;
}

bool alb_mesh_read(alb_mesh *mesh, const char *path, alb_error *error)
{
    char *bytes = NULL;
    size_t size = 0;
    if (!alb_file_read(&bytes, &size, path, error))
        return false;
    const bool is_ply = size >= 4 && !memcmp(bytes, "ply", 3) && (bytes[3] == '\n' || bytes[3] == '\r');
    const bool ok = is_ply ? alb_mesh_parse_ply(mesh, path, bytes, size, error)
                           : alb_mesh_parse_obj(mesh, path, bytes, size, error);
    free(bytes);
    return ok;
}

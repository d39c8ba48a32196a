// The header of PLY: lines of text, up to end_header. Every element has at least one property and every value takes at
// least one byte, so that no count can exceed the file's size: this is checked before anything is made of it.
#include "render/mesh_ply.h"
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const char *const type_names[2][ALB_PLY_NO_TYPE] = {
    {"char", "uchar", "short", "ushort", "int", "uint", "float", "double"},
    {"int8", "uint8", "int16", "uint16", "int32", "uint32", "float32", "float64"}};

static alb_ply_type type_of(const char *name)
{
    for (int set = 0; set < 2; set++)
        for (int i = 0; i < ALB_PLY_NO_TYPE; i++)
            if (!strcmp(name, type_names[set][i]))
                return (alb_ply_type)i;
    return ALB_PLY_NO_TYPE;
}

static bool fail(alb_ply *in, const char *what, const char *found)
{
    return alb_fail(in->error, ALB_BAD_DATA, "%s: %s '%.60s'", in->name, what, found);
}

static bool header_line(char line[256], alb_ply *in)
{
    size_t n = 0;
    while (in->at < in->end && *in->at != '\n' && *in->at != '\r') {
        if (n == 255)
            return fail(in, "header line is too long:", (line[60] = 0, line));
        line[n++] = *in->at++;
    }
    line[n] = 0;
    if (in->at == in->end)
        return alb_fail(in->error, ALB_BAD_DATA, "%s: the header does not end with end_header", in->name);
    if (*in->at == '\r' && in->at + 1 < in->end && in->at[1] == '\n')
        in->at++;
    in->at++;
    return true;
}

static bool header_element(alb_ply *in, const char *line)
{
    char name[64], count_text[64];
    if (sscanf(line, "element %63s %63s", name, count_text) != 2)
        return fail(in, "not an element declaration:", line);
    char *end;
    errno = 0;
    const long long count = strtoll(count_text, &end, 10);
    if (*end || errno || count < 0)
        return fail(in, "not a count of elements:", line);
    if (in->element_count == ALB_PLY_ELEMENTS_MAX)
        return fail(in, "too many elements:", line);
    in->elements[in->element_count++] = (alb_ply_element){
        .is_vertex = !strcmp(name, "vertex"), .is_face = !strcmp(name, "face"), .count = (size_t)count};
    return true;
}

static bool header_property(alb_ply *in, const char *line)
{
    char a[64], b[64], name[64];
    alb_ply_property read = {.count_type = ALB_PLY_NO_TYPE};
    if (sscanf(line, "property list %63s %63s %63s", a, b, name) == 3) {
        read.count_type = type_of(a);
        read.type = type_of(b);
        if (read.count_type >= ALB_PLY_FLOAT32)
            return fail(in, "a list counts by an integer type:", line);
        read.role = !strcmp(name, "vertex_indices") || !strcmp(name, "vertex_index") ? ALB_PLY_INDICES : ALB_PLY_OTHER;
    } else if (sscanf(line, "property %63s %63s", a, name) == 2) {
        read.type = type_of(a);
        read.role = !strcmp(name, "x")   ? ALB_PLY_X
                    : !strcmp(name, "y") ? ALB_PLY_Y
                    : !strcmp(name, "z") ? ALB_PLY_Z
                                         : ALB_PLY_OTHER;
    } else
        return fail(in, "not a property declaration:", line);
    if (read.type == ALB_PLY_NO_TYPE)
        return fail(in, "unknown type:", line);
    if (!in->element_count)
        return fail(in, "a property before any element:", line);
    alb_ply_element *last = &in->elements[in->element_count - 1];
    if (last->property_count == ALB_PLY_PROPERTIES_MAX)
        return fail(in, "too many properties:", line);
    last->properties[last->property_count++] = read;
    return true;
}

static bool check_elements(alb_ply *in)
{
    int roles[ALB_PLY_INDICES + 1] = {0};
    bool vertices_seen = false;
    for (int i = 0; i < in->element_count; i++) {
        const alb_ply_element *of = &in->elements[i];
        if (of->count && !of->property_count)
            return alb_fail(in->error, ALB_BAD_DATA, "%s: an element without properties", in->name);
        if (of->count > (size_t)(in->end - in->at))
            return alb_fail(in->error, ALB_BAD_DATA,
                            "%s: the header promises %zu elements, the file has %zu bytes left", in->name, of->count,
                            (size_t)(in->end - in->at));
        if (of->is_face && !vertices_seen)
            return alb_fail(in->error, ALB_BAD_DATA, "%s: faces come before the vertices", in->name);
        vertices_seen |= of->is_vertex;
        for (int p = 0; p < of->property_count; p++)
            if ((of->is_face && of->properties[p].role == ALB_PLY_INDICES) ||
                (of->is_vertex && of->properties[p].role < ALB_PLY_INDICES))
                roles[of->properties[p].role]++;
    }
    if (roles[ALB_PLY_X] != 1 || roles[ALB_PLY_Y] != 1 || roles[ALB_PLY_Z] != 1 || roles[ALB_PLY_INDICES] != 1)
        return alb_fail(in->error, ALB_BAD_DATA, "%s: needs vertex x, y, z and face vertex_indices, once each",
                        in->name);
    return true;
}

bool alb_ply_read_header(alb_ply *in)
{
    char line[256];
    bool has_format = false;
    if (!header_line(line, in))
        return false;
    while (true) {
        if (!header_line(line, in))
            return false;
        if (!strcmp(line, "end_header"))
            break;
        if (!strncmp(line, "comment", 7) || !strncmp(line, "obj_info", 8))
            continue;
        if (!strncmp(line, "format ", 7)) {
            has_format = true;
            if (!strcmp(line + 7, "ascii 1.0"))
                in->format = ALB_PLY_ASCII;
            else if (!strcmp(line + 7, "binary_little_endian 1.0"))
                in->format = ALB_PLY_LITTLE;
            else if (!strcmp(line + 7, "binary_big_endian 1.0"))
                in->format = ALB_PLY_BIG;
            else
                return fail(in, "unknown format:", line);
        } else if (!strncmp(line, "element ", 8)) {
            if (!header_element(in, line))
                return false;
        } else if (!strncmp(line, "property ", 9)) {
            if (!header_property(in, line))
                return false;
        } else
            return fail(in, "not a header statement:", line);
    }
    if (!has_format)
        return alb_fail(in->error, ALB_BAD_DATA, "%s: the header has no format", in->name);
    return check_elements(in);
}

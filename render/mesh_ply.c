// PLY (Turk 1994): a header that declares elements of typed properties, then the values as text or binary of either
// byte order. Kept: vertex x, y, z and the faces' index list; every other property is stepped over by its declared
// type. Every element has at least one property and every value takes at least one byte, so that no count can exceed
// the file's size: this is checked before anything is made of it.
#include "render/mesh.h"
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { PROPERTIES_MAX = 64, ELEMENTS_MAX = 16 };
typedef enum ply_type { INT8, UINT8, INT16, UINT16, INT32, UINT32, FLOAT32, FLOAT64, NO_TYPE } ply_type;
static const char *const type_names[2][NO_TYPE] = {
    {"char", "uchar", "short", "ushort", "int", "uint", "float", "double"},
    {"int8", "uint8", "int16", "uint16", "int32", "uint32", "float32", "float64"}};
static const size_t type_sizes[NO_TYPE] = {1, 1, 2, 2, 4, 4, 4, 8};

typedef enum role { OTHER, X, Y, Z, INDICES } role;
typedef struct property {
    ply_type type, count_type; // count_type NO_TYPE: a scalar
    role role;
} property;
typedef struct element {
    bool is_vertex, is_face;
    size_t count;
    property properties[PROPERTIES_MAX];
    int property_count;
} element;
typedef struct reader {
    const char *name, *at, *end;
    enum { ASCII, LITTLE, BIG } format;
    element elements[ELEMENTS_MAX];
    int element_count;
    alb_mesh *mesh;
    alb_error *error;
} reader;

static ply_type type_of(const char *name)
{
    for (int set = 0; set < 2; set++)
        for (int i = 0; i < NO_TYPE; i++)
            if (!strcmp(name, type_names[set][i]))
                return (ply_type)i;
    return NO_TYPE;
}

static bool fail(reader *in, const char *what, const char *found)
{
    return alb_fail(in->error, ALB_BAD_DATA, "%s: %s '%.60s'", in->name, what, found);
}

static bool header_line(char line[256], reader *in)
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

static bool header_element(reader *in, const char *line)
{
    char name[64], count_text[64];
    if (sscanf(line, "element %63s %63s", name, count_text) != 2)
        return fail(in, "not an element declaration:", line);
    char *end;
    errno = 0;
    const long long count = strtoll(count_text, &end, 10);
    if (*end || errno || count < 0)
        return fail(in, "not a count of elements:", line);
    if (in->element_count == ELEMENTS_MAX)
        return fail(in, "too many elements:", line);
    in->elements[in->element_count++] =
        (element){.is_vertex = !strcmp(name, "vertex"), .is_face = !strcmp(name, "face"), .count = (size_t)count};
    return true;
}

static bool header_property(reader *in, const char *line)
{
    char a[64], b[64], name[64];
    property read = {.count_type = NO_TYPE};
    if (sscanf(line, "property list %63s %63s %63s", a, b, name) == 3) {
        read.count_type = type_of(a);
        read.type = type_of(b);
        if (read.count_type >= FLOAT32)
            return fail(in, "a list counts by an integer type:", line);
        read.role = !strcmp(name, "vertex_indices") || !strcmp(name, "vertex_index") ? INDICES : OTHER;
    } else if (sscanf(line, "property %63s %63s", a, name) == 2) {
        read.type = type_of(a);
        read.role = !strcmp(name, "x") ? X : !strcmp(name, "y") ? Y : !strcmp(name, "z") ? Z : OTHER;
    } else
        return fail(in, "not a property declaration:", line);
    if (read.type == NO_TYPE)
        return fail(in, "unknown type:", line);
    if (!in->element_count)
        return fail(in, "a property before any element:", line);
    element *last = &in->elements[in->element_count - 1];
    if (last->property_count == PROPERTIES_MAX)
        return fail(in, "too many properties:", line);
    last->properties[last->property_count++] = read;
    return true;
}

static bool read_header(reader *in)
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
                in->format = ASCII;
            else if (!strcmp(line + 7, "binary_little_endian 1.0"))
                in->format = LITTLE;
            else if (!strcmp(line + 7, "binary_big_endian 1.0"))
                in->format = BIG;
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
    return has_format || alb_fail(in->error, ALB_BAD_DATA, "%s: the header has no format", in->name);
}

static double decode(const unsigned char *bytes, ply_type type)
{
    uint64_t bits = 0;
    for (size_t i = 0; i < type_sizes[type]; i++)
        bits |= (uint64_t)bytes[i] << (8 * i);
    if (type == FLOAT32) {
        const uint32_t half = (uint32_t)bits;
        float value;
        memcpy(&value, &half, sizeof value);
        return (double)value;
    }
    if (type == FLOAT64) {
        double value;
        memcpy(&value, &bits, sizeof value);
        return value;
    }
    switch (type) {
    case INT8:
        return (int8_t)bits;
    case INT16:
        return (int16_t)bits;
    case INT32:
        return (int32_t)bits;
    default:
        return (double)bits;
    }
}

static bool read_value(double *value, reader *in, ply_type type)
{
    if (in->format == ASCII) {
        char *after;
        *value = strtod(in->at, &after); // the text ends with a NUL
        if (after == in->at || after > in->end)
            return false;
        in->at = after;
        return true;
    }
    const size_t size = type_sizes[type];
    if ((size_t)(in->end - in->at) < size)
        return false;
    unsigned char bytes[8];
    for (size_t i = 0; i < size; i++)
        bytes[in->format == BIG ? size - 1 - i : i] = (unsigned char)in->at[i];
    in->at += size;
    *value = decode(bytes, type);
    return true;
}

static bool ended(reader *in, size_t i, const element *of)
{
    return alb_fail(in->error, ALB_BAD_DATA, "%s: ends or is damaged in %s %zu of %zu", in->name,
                    of->is_vertex ? "vertex"
                    : of->is_face ? "face"
                                  : "element",
                    i, of->count);
}

static bool read_face_list(reader *in, const property *list, size_t corners, const element *of, size_t i)
{
    uint32_t first = 0, previous = 0;
    if (corners < 3)
        return alb_fail(in->error, ALB_BAD_DATA, "%s: face %zu has %zu corners", in->name, i, corners);
    for (size_t k = 0; k < corners; k++) {
        double value;
        if (!read_value(&value, in, list->type))
            return ended(in, i, of);
        if (!(value >= 0 && value < (double)in->mesh->vertex_count) || value != floor(value))
            return alb_fail(in->error, ALB_BAD_DATA, "%s: face %zu refers to vertex %g of %zu", in->name, i, value,
                            in->mesh->vertex_count);
        const uint32_t corner = (uint32_t)value;
        if (k == 0)
            first = corner;
        else if (k >= 2 && !alb_mesh_add_face(in->mesh, first, previous, corner, 0, in->error))
            return false;
        previous = corner;
    }
    return true;
}

static bool read_item(reader *in, const element *of, size_t i)
{
    double position[Z + 1] = {0};
    for (int p = 0; p < of->property_count; p++) {
        const property *read = &of->properties[p];
        double value;
        if (!read_value(&value, in, read->count_type == NO_TYPE ? read->type : read->count_type))
            return ended(in, i, of);
        if (read->count_type == NO_TYPE) {
            if (read->role != OTHER)
                position[read->role] = value;
            continue;
        }
        if (!(value >= 0 && value <= (double)(in->end - in->at)) || value != floor(value))
            return alb_fail(in->error, ALB_BAD_DATA, "%s: a list of %g items in element %zu does not fit the file",
                            in->name, value, i);
        if (of->is_face && read->role == INDICES) {
            if (!read_face_list(in, read, (size_t)value, of, i))
                return false;
            continue;
        }
        for (size_t k = 0, count = (size_t)value; k < count; k++)
            if (!read_value(&value, in, read->type))
                return ended(in, i, of);
    }
    if (!of->is_vertex)
        return true;
    for (int k = X; k <= Z; k++)
        if (!isfinite(position[k]) || fabs(position[k]) > 1e15)
            return alb_fail(in->error, ALB_BAD_DATA, "%s: a coordinate of vertex %zu is not a usable number", in->name,
                            i);
    return alb_mesh_add_vertex(in->mesh, (alb_vector){position[X], position[Y], position[Z]}, in->error);
}

static bool check_elements(reader *in)
{
    int roles[INDICES + 1] = {0};
    bool vertices_seen = false;
    for (int i = 0; i < in->element_count; i++) {
        const element *of = &in->elements[i];
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
            if ((of->is_face && of->properties[p].role == INDICES) ||
                (of->is_vertex && of->properties[p].role < INDICES))
                roles[of->properties[p].role]++;
    }
    if (roles[X] != 1 || roles[Y] != 1 || roles[Z] != 1 || roles[INDICES] != 1)
        return alb_fail(in->error, ALB_BAD_DATA, "%s: needs vertex x, y, z and face vertex_indices, once each",
                        in->name);
    return true;
}

bool alb_mesh_parse_ply(alb_mesh *mesh, const char *name, const char *bytes, size_t size, alb_error *error)
{
    alb_mesh read = {0};
    reader in = {.name = name, .at = bytes, .end = bytes + size, .mesh = &read, .error = error};
    uint16_t group;
    if (!read_header(&in) || !check_elements(&in) || !alb_mesh_add_group(&group, &read, "", error))
        goto failed;
    for (int e = 0; e < in.element_count; e++)
        for (size_t i = 0; i < in.elements[e].count; i++)
            if (!read_item(&in, &in.elements[e], i))
                goto failed;
    if (!read.face_count) {
        alb_fail(error, ALB_BAD_DATA, "%s: holds no face with an area", name);
        goto failed;
    }
    *mesh = read;
    return true;
failed:
    alb_mesh_free(&read);
    return false;
}

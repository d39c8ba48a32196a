// PLY (Turk 1994): a header that declares elements of typed properties, then the values as text or binary of either
// byte order. Kept: vertex x, y, z and the faces' index list; every other property is stepped over by its declared
// type. The header: mesh_ply_header.c.
#include "render/mesh_ply.h"
#include <stdlib.h>
#include <string.h>

static const size_t type_sizes[ALB_PLY_NO_TYPE] = {1, 1, 2, 2, 4, 4, 4, 8};

static double decode(const unsigned char *bytes, alb_ply_type type)
{
    uint64_t bits = 0;
    for (size_t i = 0; i < type_sizes[type]; i++)
        bits |= (uint64_t)bytes[i] << (8 * i);
    if (type == ALB_PLY_FLOAT32) {
        const uint32_t half = (uint32_t)bits;
        float value;
        memcpy(&value, &half, sizeof value);
        return (double)value;
    }
    if (type == ALB_PLY_FLOAT64) {
        double value;
        memcpy(&value, &bits, sizeof value);
        return value;
    }
    switch (type) {
    case ALB_PLY_INT8:
        return (int8_t)bits;
    case ALB_PLY_INT16:
        return (int16_t)bits;
    case ALB_PLY_INT32:
        return (int32_t)bits;
    default:
        return (double)bits;
    }
}

static bool read_value(double *value, alb_ply *in, alb_ply_type type)
{
    if (in->format == ALB_PLY_ASCII) {
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
        bytes[in->format == ALB_PLY_BIG ? size - 1 - i : i] = (unsigned char)in->at[i];
    in->at += size;
    *value = decode(bytes, type);
    return true;
}

static bool ended(alb_ply *in, size_t i, const alb_ply_element *of)
{
    return alb_fail(in->error, ALB_BAD_DATA, "%s: ends or is damaged in %s %zu of %zu", in->name,
                    of->is_vertex ? "vertex"
                    : of->is_face ? "face"
                                  : "element",
                    i, of->count);
}

static bool read_face_list(alb_ply *in, const alb_ply_property *list, size_t corners, const alb_ply_element *of,
                           size_t i)
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

static bool read_item(alb_ply *in, const alb_ply_element *of, size_t i)
{
    double position[ALB_PLY_Z + 1] = {0};
    for (int p = 0; p < of->property_count; p++) {
        const alb_ply_property *read = &of->properties[p];
        double value;
        if (!read_value(&value, in, read->count_type == ALB_PLY_NO_TYPE ? read->type : read->count_type))
            return ended(in, i, of);
        if (read->count_type == ALB_PLY_NO_TYPE) {
            if (read->role != ALB_PLY_OTHER)
                position[read->role] = value;
            continue;
        }
        if (!(value >= 0 && value <= (double)(in->end - in->at)) || value != floor(value))
            return alb_fail(in->error, ALB_BAD_DATA, "%s: a list of %g items in element %zu does not fit the file",
                            in->name, value, i);
        if (of->is_face && read->role == ALB_PLY_INDICES) {
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
    for (int k = ALB_PLY_X; k <= ALB_PLY_Z; k++)
        if (!isfinite(position[k]) || fabs(position[k]) > 1e15)
            return alb_fail(in->error, ALB_BAD_DATA, "%s: a coordinate of vertex %zu is not a usable number", in->name,
                            i);
    return alb_mesh_add_vertex(in->mesh, (alb_vector){position[ALB_PLY_X], position[ALB_PLY_Y], position[ALB_PLY_Z]},
                               in->error);
}

bool alb_mesh_parse_ply(alb_mesh *mesh, const char *name, const char *bytes, size_t size, alb_error *error)
{
    alb_mesh read = {0};
    alb_ply in = {.name = name, .at = bytes, .end = bytes + size, .mesh = &read, .error = error};
    uint16_t group;
    if (!alb_ply_read_header(&in) || !alb_mesh_add_group(&group, &read, "", error))
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

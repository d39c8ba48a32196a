// A PLY file under way, and what its header declares.
#pragma once
#include "render/mesh.h"

enum { ALB_PLY_PROPERTIES_MAX = 64, ALB_PLY_ELEMENTS_MAX = 16 };

typedef enum alb_ply_type {
    ALB_PLY_INT8,
    ALB_PLY_UINT8,
    ALB_PLY_INT16,
    ALB_PLY_UINT16,
    ALB_PLY_INT32,
    ALB_PLY_UINT32,
    ALB_PLY_FLOAT32,
    ALB_PLY_FLOAT64,
    ALB_PLY_NO_TYPE
} alb_ply_type;

// What is kept of a value: a coordinate of a vertex, or a face's list of vertices.
typedef enum alb_ply_role { ALB_PLY_OTHER, ALB_PLY_X, ALB_PLY_Y, ALB_PLY_Z, ALB_PLY_INDICES } alb_ply_role;

typedef struct alb_ply_property {
    alb_ply_type type, count_type; // count_type ALB_PLY_NO_TYPE: a scalar
    alb_ply_role role;
} alb_ply_property;

typedef struct alb_ply_element {
    bool is_vertex, is_face;
    size_t count;
    alb_ply_property properties[ALB_PLY_PROPERTIES_MAX];
    int property_count;
} alb_ply_element;

// Everything is borrowed but the numbers.
typedef struct alb_ply {
    const char *name, *at, *end; // of the file, for messages; its bytes from where it is read
    enum { ALB_PLY_ASCII, ALB_PLY_LITTLE, ALB_PLY_BIG } format;
    alb_ply_element elements[ALB_PLY_ELEMENTS_MAX];
    int element_count;
    alb_mesh *mesh;
    alb_error *error;
} alb_ply;

// Reads the header and leaves `at` behind it. ALB_BAD_DATA where a statement is not PLY's, where vertices or their
// faces are not declared, vertices first, or where a count is more than the rest of the file can hold.
bool alb_ply_read_header(alb_ply *in);

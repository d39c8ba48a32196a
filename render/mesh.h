// Triangle meshes: read from OBJ and PLY, welded, subdivided, written as PLY. All zero is empty.
#pragma once
#include "base/file.h"
#include "base/vector.h"
#include <stdint.h>

enum { ALB_GROUP_NAME = 64, ALB_GROUPS_MAX = 1024, ALB_FACES_MAX = 1 << 24 };

typedef struct alb_mesh {
    alb_vector *vertices;
    size_t vertex_count, vertex_capacity;
    uint32_t (*faces)[3]; // counter-clockwise seen from the front; the front is the side that receives and sends light
    uint16_t *groups;     // of each face: index into group_names
    size_t face_count, face_capacity;
    char (*group_names)[ALB_GROUP_NAME]; // usemtl names; "" for faces without one
    size_t group_count;
    size_t dropped; // faces left out because they have no area or stand there twice
    size_t turned;  // faces turned over to face the way their neighbours do
} alb_mesh;

void alb_mesh_free(alb_mesh *mesh);
// Building by hand. Face indices are the caller's responsibility; a face without area is dropped and counted.
bool alb_mesh_add_vertex(alb_mesh *mesh, alb_vector vertex, alb_error *error);
bool alb_mesh_add_face(alb_mesh *mesh, uint32_t a, uint32_t b, uint32_t c, uint16_t group, alb_error *error);
// Index of the group of this name, added where it is new. ALB_BAD_DATA for a name too long or too many groups.
bool alb_mesh_add_group(uint16_t *group, alb_mesh *mesh, const char *name, alb_error *error);
// Adds the faces of `other`, its vertices moved to scale * v + offset. Groups are not carried: all faces get `group`.
bool alb_mesh_append(alb_mesh *mesh, const alb_mesh *other, double scale, alb_vector offset, alb_error *error);

// Merges vertices of one position; then drops faces that stand there twice with the same orientation.
bool alb_mesh_weld(alb_mesh *mesh, alb_error *error);
// What a whole scene needs before light is traced in it, counted in `dropped` and `turned`: drops faces that stand
// there twice with the same orientation, by position whoever owns their vertices; then turns over faces that face
// against most of the area they are joined to, edge to edge. A mesh that is turned inside out as a whole is left as it
// is (a room looks like that), and so is one that has no two sides. Vertices stay.
bool alb_mesh_repair(alb_mesh *mesh, alb_error *error);
// Halves every edge longer than `longest_mm` until none is left. The rule looks at the edge alone, so faces that share
// an edge stay joined. Refuses more than ALB_FACES_MAX faces before it allocates them.
bool alb_mesh_subdivide(alb_mesh *mesh, double longest_mm, alb_error *error);

// Reads a file, told apart by content: PLY (ascii, binary little and big endian) begins with "ply", anything else is
// OBJ. Polygons become fans about their first corner (right for convex ones). ALB_BAD_DATA names the file, the line or
// element, and what was found.
bool alb_mesh_read(alb_mesh *mesh, const char *path, alb_error *error);
// The two formats from memory; `name` is for messages. `bytes` must be followed by a NUL.
bool alb_mesh_parse_obj(alb_mesh *mesh, const char *name, const char *bytes, size_t size, alb_error *error);
bool alb_mesh_parse_ply(alb_mesh *mesh, const char *name, const char *bytes, size_t size, alb_error *error);
// Binary little-endian PLY with double x, y, z and float red, green, blue on each face (radiosity); `comment` has no
// line break.
bool alb_mesh_write_ply(const alb_mesh *mesh, const float (*face_rgb)[3], const char *comment, const char *path,
                        alb_error *error);

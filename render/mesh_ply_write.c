// PLY as render writes it: binary, little endian, positions in double precision (in single a vertex 1 km
// from the origin would stand 0.03 mm off), and a colour a face.
#include "render/mesh.h"
#include <string.h>

static void add_little(alb_text *text, const void *value, size_t size)
{
    unsigned char bytes[8];
    memcpy(bytes, value, size);
#if __BYTE_ORDER__ == __ORDER_BIG_ENDIAN__
    for (size_t i = 0; i < size / 2; i++) {
        const unsigned char byte = bytes[i];
        bytes[i] = bytes[size - 1 - i];
        bytes[size - 1 - i] = byte;
    }
#endif
    alb_text_add_bytes(text, bytes, size);
}

bool alb_mesh_write_ply(const alb_mesh *mesh, const float (*face_rgb)[3], const char *comment, const char *path,
                        alb_error *error)
{
    alb_text text = {0};
    alb_text_add(&text, "ply\nformat binary_little_endian 1.0\ncomment %s\nelement vertex %zu\n", comment,
                 mesh->vertex_count);
    alb_text_add(&text, "property double x\nproperty double y\nproperty double z\nelement face %zu\n",
                 mesh->face_count);
    alb_text_add(&text, "property list uchar int vertex_indices\nproperty float red\nproperty float green\n"
                        "property float blue\nend_header\n");
    for (size_t i = 0; i < mesh->vertex_count; i++) {
        const double position[3] = {mesh->vertices[i].x, mesh->vertices[i].y, mesh->vertices[i].z};
        for (int k = 0; k < 3; k++)
            add_little(&text, &position[k], sizeof position[k]);
    }
    for (size_t i = 0; i < mesh->face_count; i++) {
        const unsigned char three = 3;
        add_little(&text, &three, 1);
        for (int k = 0; k < 3; k++)
            add_little(&text, &mesh->faces[i][k], sizeof mesh->faces[i][k]);
        for (int c = 0; c < 3; c++)
            add_little(&text, &face_rgb[i][c], sizeof face_rgb[i][c]);
    }
    const bool ok = alb_file_write_text(path, &text, error);
    alb_text_free(&text);
    return ok;
}

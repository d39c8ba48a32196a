// OBJ and PLY: render/mesh*.c.
#include "fuzz.h"
#include "render/mesh.h"

#include <math.h>

bool fuzz_accepts(const uint8_t *bytes, size_t size, alb_error *error)
{
    alb_mesh mesh = {0};
    const bool accepted = alb_mesh_read(&mesh, fuzz_file(bytes, size), error);
    for (size_t i = 0; accepted && i < mesh.face_count; i++)
        for (int k = 0; k < 3; k++) {
            fuzz_law(mesh.faces[i][k] < mesh.vertex_count, "a face refers to vertices");
            const alb_vector v = mesh.vertices[mesh.faces[i][k]];
            fuzz_law(isfinite(v.x) && isfinite(v.y) && isfinite(v.z), "a vertex is finite");
        }
    for (size_t i = 0; accepted && i < mesh.face_count; i++)
        fuzz_law(mesh.groups[i] < mesh.group_count, "a face has a group");
    alb_mesh_free(&mesh);
    return accepted;
}

// A face belongs to the object that owns its first corner: objects share no vertices. It sends its exitance over pi.
#include "render/shadow_cut.h"
#include "base/memory.h"

static bool add_vertices(alb_mesh *out, const alb_mesh *all, size_t first, size_t count, alb_error *error)
{
    bool ok = true;
    for (size_t v = 0; ok && v < count; v++)
        ok = alb_mesh_add_vertex(out, all->vertices[first + v], error);
    return ok;
}

static bool add_face(alb_mesh *out, float (*radiance)[3], const alb_scene *scene, size_t face, size_t first,
                     alb_error *error)
{
    const uint32_t *v = scene->mesh.faces[face], from = (uint32_t)first;
    const double *exitance = scene->surfaces[scene->mesh.groups[face]].exitance;
    for (int c = 0; c < 3 && radiance; c++)
        radiance[out->face_count][c] = (float)(exitance[c] / M_PI);
    return alb_mesh_add_face(out, v[0] - from, v[1] - from, v[2] - from, 0, error);
}

bool alb_shadow_cut(alb_mesh *out, float (**radiance)[3], const alb_scene *scene, const bool *chosen, alb_error *error)
{
    const alb_mesh *all = &scene->mesh;
    bool ok = (!radiance || (*radiance = alb_allocate(all->face_count, sizeof **radiance, error))) &&
              add_vertices(out, all, 0, all->vertex_count, error);
    for (size_t o = 0; ok && o < scene->object_count; o++)
        for (size_t f = 0; ok && chosen[o] && f < all->face_count; f++)
            if (alb_object_owns(&scene->objects[o], all->faces[f][0]))
                ok = add_face(out, radiance ? *radiance : NULL, scene, f, 0, error);
    return ok;
}

bool alb_shadow_cut_one(alb_mesh *out, float (**radiance)[3], const alb_scene *scene, const alb_object *object,
                        alb_error *error)
{
    const alb_mesh *all = &scene->mesh;
    bool ok = (!radiance || (*radiance = alb_allocate(all->face_count, sizeof **radiance, error))) &&
              add_vertices(out, all, object->first_vertex, object->vertex_count, error);
    for (size_t f = 0; ok && f < all->face_count; f++)
        if (alb_object_owns(object, all->faces[f][0]))
            ok = add_face(out, radiance ? *radiance : NULL, scene, f, object->first_vertex, error);
    return ok;
}

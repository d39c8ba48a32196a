// "objects" of SCENE.json: meshes and shapes, placed, cut to size and joined to one mesh of the scene's materials.
#include "base/memory.h"
#include "render/scene_reader.h"
#include "render/shape.h"
#include <string.h>

static bool surface_named(uint16_t *index, alb_scene_reader *in, alb_node node, const char *key)
{
    const char *name;
    if (!alb_node_text(&name, node, key, in->error))
        return false;
    for (size_t i = 0; i < in->scene->surface_count; i++)
        if (!strcmp(in->scene->surfaces[i].name, name)) {
            *index = (uint16_t)i;
            return true;
        }
    return alb_node_fail(in->error, node, key, "there is no material '%.80s'", name);
}

// The mesh's groups become indices of the scene's materials.
static bool assign_materials(alb_mesh *mesh, alb_scene_reader *in, alb_node object)
{
    uint16_t map[ALB_GROUPS_MAX] = {0};
    alb_node by_name;
    if (alb_node_has(object, "materials")) {
        if (!alb_node_object(&by_name, object, "materials", in->error))
            return false;
        for (size_t g = 0; g < mesh->group_count; g++) {
            if (!alb_node_has(by_name, mesh->group_names[g]))
                return alb_node_fail(in->error, object, "materials", "the mesh's material '%.80s' is not listed",
                                     mesh->group_names[g]);
            if (!surface_named(&map[g], in, by_name, mesh->group_names[g]))
                return false;
        }
    } else {
        if (!surface_named(&map[0], in, object, "material"))
            return false;
        for (size_t g = 1; g < mesh->group_count; g++)
            map[g] = map[0];
    }
    for (size_t f = 0; f < mesh->face_count; f++)
        mesh->groups[f] = map[mesh->groups[f]];
    return true;
}

static bool read_mesh(alb_mesh *mesh, double *scale, alb_vector *offset, alb_scene_reader *in, alb_node node)
{
    char path[ALB_PATH_SIZE];
    if (!alb_node_allow(node, "mesh mm_per_unit material materials translate_mm subdivide_mm shadow rigid",
                        in->error) ||
        (alb_node_has(node, "mm_per_unit") && !alb_node_number(scale, node, "mm_per_unit", 1e-6, 1e6, in->error)) ||
        (alb_node_has(node, "translate_mm") && !alb_scene_vector(offset, node, "translate_mm", in->error)) ||
        !alb_scene_input(path, in, node, "mesh"))
        return false;
    return alb_mesh_read(mesh, path, in->error) && alb_mesh_weld(mesh, in->error);
}

static bool read_box(alb_mesh *mesh, alb_scene_reader *in, alb_node node)
{
    double size[3], cells[3];
    alb_box box = {.grading = 1};
    if (!alb_node_allow(node, "shape size_mm centre_mm cells grading inward material subdivide_mm shadow rigid",
                        in->error) ||
        !alb_node_numbers(size, 3, node, "size_mm", 1e-6, ALB_SCENE_LONGEST_MM, in->error) ||
        !alb_scene_vector(&box.centre_mm, node, "centre_mm", in->error) ||
        !alb_node_numbers(cells, 3, node, "cells", 1, 4096, in->error) ||
        (alb_node_has(node, "grading") && !alb_node_number(&box.grading, node, "grading", 1, 1e4, in->error)) ||
        (alb_node_has(node, "inward") && !alb_node_boolean(&box.inward, node, "inward", in->error)))
        return false;
    box.size_mm = (alb_vector){size[0], size[1], size[2]};
    for (int k = 0; k < 3; k++) {
        if (cells[k] != floor(cells[k]))
            return alb_node_fail(in->error, node, "cells", "%g is not a whole number", cells[k]);
        box.cells[k] = (int)cells[k];
    }
    return alb_shape_box(mesh, &box, in->error);
}

static bool read_sphere(alb_mesh *mesh, alb_scene_reader *in, alb_node node)
{
    alb_sphere sphere = {0};
    long subdivisions;
    if (!alb_node_allow(node, "shape radius_mm centre_mm subdivisions inward material shadow rigid", in->error) ||
        !alb_node_number(&sphere.radius_mm, node, "radius_mm", 1e-6, ALB_SCENE_LONGEST_MM, in->error) ||
        !alb_scene_vector(&sphere.centre_mm, node, "centre_mm", in->error) ||
        !alb_node_integer(&subdivisions, node, "subdivisions", 0, 8, in->error) ||
        (alb_node_has(node, "inward") && !alb_node_boolean(&sphere.inward, node, "inward", in->error)))
        return false;
    sphere.subdivisions = (int)subdivisions;
    return alb_shape_sphere(mesh, &sphere, in->error);
}

static bool read_shape(alb_mesh *mesh, alb_scene_reader *in, alb_node node)
{
    static const char *const shapes[] = {"box", "sphere"};
    int shape;
    if (!alb_node_choice(&shape, node, "shape", shapes, 2, in->error))
        return false;
    return shape == 0 ? read_box(mesh, in, node) : read_sphere(mesh, in, node);
}

// Where the object's vertices come to lie, and what it does to light.
static bool note_object(alb_object *object, const alb_mesh *placed, alb_scene_reader *in, alb_node node)
{
    static const char *const roles[] = {"casts", "receives"};
    int role = 0;
    if (alb_node_has(node, "shadow") && !alb_node_choice(&role, node, "shadow", roles, 2, in->error))
        return false;
    *object = (alb_object){in->scene->mesh.vertex_count, placed->vertex_count, role == 1, false};
    return !alb_node_has(node, "rigid") || alb_node_boolean(&object->rigid, node, "rigid", in->error);
}

static bool read_object(alb_scene_reader *in, alb_node node)
{
    double scale = 1, longest_mm = 0;
    alb_vector offset = {0};
    alb_mesh mesh = {0}, placed = {0};
    bool ok = alb_node_has(node, "mesh") ? read_mesh(&mesh, &scale, &offset, in, node) : read_shape(&mesh, in, node);
    ok = ok && assign_materials(&mesh, in, node) && alb_mesh_append(&placed, &mesh, scale, offset, in->error);
    if (ok && alb_node_has(node, "subdivide_mm"))
        ok = alb_node_number(&longest_mm, node, "subdivide_mm", 1e-6, ALB_SCENE_LONGEST_MM, in->error) &&
             alb_mesh_subdivide(&placed, longest_mm, in->error);
    ok = ok && note_object(&in->scene->objects[in->scene->object_count], &placed, in, node) &&
         alb_mesh_append(&in->scene->mesh, &placed, 1, (alb_vector){0}, in->error);
    in->scene->object_count += ok;
    alb_mesh_free(&mesh);
    alb_mesh_free(&placed);
    return ok;
}

bool alb_scene_read_objects(alb_scene_reader *in, alb_node root)
{
    alb_node list, node;
    size_t count;
    if (!alb_node_list(&list, &count, root, "objects", in->error))
        return false;
    if (!count || count > ALB_OBJECTS_MAX)
        return alb_node_fail(in->error, root, "objects", "%zu objects; 1 to %d are needed", count, ALB_OBJECTS_MAX);
    if (!(in->scene->objects = alb_allocate(count, sizeof *in->scene->objects, in->error)))
        return false;
    for (size_t i = 0; i < count; i++)
        if (!alb_node_item_object(&node, list, i, in->error) || !read_object(in, node))
            return false;
    return alb_mesh_repair(&in->scene->mesh, in->error);
}

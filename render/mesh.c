// The container of triangles: growing, welding by exact position, and subdivision by halving long edges.
//
// A face has no area when |ab x ac| <= 1e-10 of its longest edge squared: below that the normal is rounding noise.
#include "render/mesh.h"
#include "base/memory.h"
#include "render/mesh_orient.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

void alb_mesh_free(alb_mesh *mesh)
{
    free(mesh->vertices);
    free(mesh->faces);
    free(mesh->groups);
    free(mesh->group_names);
    *mesh = (alb_mesh){0};
}

static bool grow(void **array, size_t item, size_t capacity, alb_error *error)
{
    void *grown = realloc(*array, capacity * item);
    if (!grown)
        return alb_fail(error, ALB_NO_MEMORY, "out of memory for a mesh of %zu items", capacity);
    *array = grown;
    return true;
}

bool alb_mesh_add_vertex(alb_mesh *mesh, alb_vector vertex, alb_error *error)
{
    if (mesh->vertex_count == mesh->vertex_capacity) {
        const size_t capacity = mesh->vertex_capacity ? 2 * mesh->vertex_capacity : 256;
        if (capacity > UINT32_MAX / 2)
            return alb_fail(error, ALB_BAD_DATA, "a mesh of more than %u vertices", UINT32_MAX / 2);
        if (!grow((void **)&mesh->vertices, sizeof *mesh->vertices, capacity, error))
            return false;
        mesh->vertex_capacity = capacity;
    }
    mesh->vertices[mesh->vertex_count++] = vertex;
    return true;
}

static bool has_area(const alb_mesh *mesh, uint32_t a, uint32_t b, uint32_t c)
{
    const alb_vector ab = alb_sub(mesh->vertices[b], mesh->vertices[a]),
                     ac = alb_sub(mesh->vertices[c], mesh->vertices[a]);
    const alb_vector bc = alb_sub(ac, ab);
    const double longest2 = fmax(alb_dot(ab, ab), fmax(alb_dot(ac, ac), alb_dot(bc, bc)));
    return alb_length(alb_cross(ab, ac)) > 1e-10 * longest2;
}

bool alb_mesh_add_face(alb_mesh *mesh, uint32_t a, uint32_t b, uint32_t c, uint16_t group, alb_error *error)
{
    if (!has_area(mesh, a, b, c)) {
        mesh->dropped++;
        return true;
    }
    if (mesh->face_count == mesh->face_capacity) {
        const size_t capacity = mesh->face_capacity ? 2 * mesh->face_capacity : 256;
        if (capacity > ALB_FACES_MAX)
            return alb_fail(error, ALB_BAD_DATA, "a mesh of more than %d triangles", ALB_FACES_MAX);
        if (!grow((void **)&mesh->faces, sizeof *mesh->faces, capacity, error) ||
            !grow((void **)&mesh->groups, sizeof *mesh->groups, capacity, error))
            return false;
        mesh->face_capacity = capacity;
    }
    mesh->faces[mesh->face_count][0] = a;
    mesh->faces[mesh->face_count][1] = b;
    mesh->faces[mesh->face_count][2] = c;
    mesh->groups[mesh->face_count++] = group;
    return true;
}

bool alb_mesh_add_group(uint16_t *group, alb_mesh *mesh, const char *name, alb_error *error)
{
    for (size_t i = 0; i < mesh->group_count; i++)
        if (!strcmp(mesh->group_names[i], name)) {
            *group = (uint16_t)i;
            return true;
        }
    if (strlen(name) >= ALB_GROUP_NAME)
        return alb_fail(error, ALB_BAD_DATA, "material name '%.80s' is longer than %d bytes", name, ALB_GROUP_NAME - 1);
    if (mesh->group_count == ALB_GROUPS_MAX)
        return alb_fail(error, ALB_BAD_DATA, "more than %d material names", ALB_GROUPS_MAX);
    if (!grow((void **)&mesh->group_names, sizeof *mesh->group_names, mesh->group_count + 1, error))
        return false;
    snprintf(mesh->group_names[mesh->group_count], ALB_GROUP_NAME, "%s", name);
    *group = (uint16_t)mesh->group_count++;
    return true;
}

bool alb_mesh_append(alb_mesh *mesh, const alb_mesh *other, double scale, alb_vector offset, alb_error *error)
{
    const uint32_t first = (uint32_t)mesh->vertex_count;
    for (size_t i = 0; i < other->vertex_count; i++)
        if (!alb_mesh_add_vertex(mesh, alb_add(alb_times(scale, other->vertices[i]), offset), error))
            return false;
    for (size_t i = 0; i < other->face_count; i++) {
        const uint32_t *face = other->faces[i];
        if (!alb_mesh_add_face(mesh, first + face[0], first + face[1], first + face[2], other->groups[i], error))
            return false;
    }
    mesh->dropped += other->dropped;
    return true;
}

// An open-addressed table from up to three 64-bit words to an index. Never full: twice as many slots as keys.
typedef struct hash_table {
    struct {
        uint64_t key[3];
        uint32_t value; // index + 1; 0 is free
    } * slots;
    size_t mask;
} hash_table;

static bool table_create(hash_table *table, size_t keys, alb_error *error)
{
    size_t slots = 16;
    while (slots < 2 * keys)
        slots *= 2;
    table->mask = slots - 1;
    table->slots = alb_allocate(slots, sizeof *table->slots, error);
    return table->slots != NULL;
}

// The value of the key, or `value` where the key is new and now taken.
static uint32_t table_find_or_add(hash_table *table, const uint64_t key[3], uint32_t value)
{
    uint64_t hash = 0;
    for (int i = 0; i < 3; i++) {
        hash = (hash ^ key[i]) * 0x9E3779B97F4A7C15u;
        hash ^= hash >> 29;
    }
    size_t slot = (size_t)hash & table->mask;
    while (table->slots[slot].value) {
        if (!memcmp(table->slots[slot].key, key, sizeof table->slots[slot].key))
            return table->slots[slot].value - 1;
        slot = (slot + 1) & table->mask;
    }
    memcpy(table->slots[slot].key, key, sizeof table->slots[slot].key);
    table->slots[slot].value = value + 1;
    return value;
}

// merged[vertex]: the number of its position. Returns how many there are.
static size_t number_positions(uint32_t *merged, const alb_mesh *mesh, hash_table *table)
{
    size_t count = 0;
    for (size_t i = 0; i < mesh->vertex_count; i++) {
        // + 0.0 makes one of the two zeros
        const double position[3] = {mesh->vertices[i].x + 0.0, mesh->vertices[i].y + 0.0, mesh->vertices[i].z + 0.0};
        uint64_t key[3];
        memcpy(key, position, sizeof key);
        merged[i] = table_find_or_add(table, key, (uint32_t)count);
        count += merged[i] == count;
    }
    return count;
}

// Drops faces that stand there twice; those that stay get merged corners where `weld` says so.
static void merge_faces(alb_mesh *mesh, hash_table *table, const uint32_t *merged, bool weld)
{
    size_t kept = 0;
    for (size_t i = 0; i < mesh->face_count; i++) {
        uint32_t face[3];
        for (int k = 0; k < 3; k++)
            face[k] = merged[mesh->faces[i][k]];
        // the rotation that begins with the smallest index names the face and its orientation
        const int first = face[0] <= face[1] && face[0] <= face[2] ? 0 : face[1] <= face[2] ? 1 : 2;
        const uint64_t key[3] = {face[first], face[(first + 1) % 3], face[(first + 2) % 3]};
        if (table_find_or_add(table, key, (uint32_t)kept) != kept) {
            mesh->dropped++;
            continue;
        }
        memmove(mesh->faces[kept], weld ? face : mesh->faces[i], sizeof face);
        mesh->groups[kept++] = mesh->groups[i];
    }
    mesh->face_count = kept;
}

static bool merge(alb_mesh *mesh, bool weld, alb_error *error)
{
    bool ok = false;
    hash_table vertices = {0}, faces = {0};
    uint32_t *merged = alb_allocate(mesh->vertex_count, sizeof *merged, error);
    if (!merged || !table_create(&vertices, mesh->vertex_count, error) ||
        !table_create(&faces, mesh->face_count, error))
        goto done;
    const size_t positions = number_positions(merged, mesh, &vertices);
    merge_faces(mesh, &faces, merged, weld);
    for (size_t i = 0, kept = 0; weld && kept < positions; i++) // the first of each position stays, in their order
        if (merged[i] == kept)
            mesh->vertices[kept++] = mesh->vertices[i];
    mesh->vertex_count = weld ? positions : mesh->vertex_count;
    ok = true;
done:
    free(merged);
    free(vertices.slots);
    free(faces.slots);
    return ok;
}

bool alb_mesh_weld(alb_mesh *mesh, alb_error *error) { return merge(mesh, true, error); }

bool alb_mesh_repair(alb_mesh *mesh, alb_error *error)
{
    return merge(mesh, false, error) && alb_mesh_orient(mesh, error);
}

// The vertex in the middle of the edge, made once however many faces share it.
static bool middle_of(uint32_t *middle, alb_mesh *mesh, hash_table *edges, uint32_t a, uint32_t b, alb_error *error)
{
    const uint64_t key[3] = {a < b ? a : b, a < b ? b : a, 0};
    const uint32_t next = (uint32_t)mesh->vertex_count;
    *middle = table_find_or_add(edges, key, next);
    if (*middle != next)
        return true;
    return alb_mesh_add_vertex(mesh, alb_times(0.5, alb_add(mesh->vertices[a], mesh->vertices[b])), error);
}

// Splits face i of `from` into `mesh`; long edges are halved. The corners are turned so that one long edge lies at ab,
// or two at ab and bc.
static bool split_face(alb_mesh *mesh, hash_table *edges, const uint32_t face[3], const bool is_long[3], uint16_t group,
                       alb_error *error)
{
    const int count = is_long[0] + is_long[1] + is_long[2];
    int turn = 0;
    if (count == 1)
        turn = is_long[0] ? 0 : is_long[1] ? 1 : 2;
    else if (count == 2)
        turn = !is_long[2] ? 0 : !is_long[0] ? 1 : 2;
    const uint32_t a = face[turn], b = face[(turn + 1) % 3], c = face[(turn + 2) % 3];
    uint32_t ab = 0, bc = 0, ca = 0;
    if ((count >= 1 && !middle_of(&ab, mesh, edges, a, b, error)) ||
        (count >= 2 && !middle_of(&bc, mesh, edges, b, c, error)) ||
        (count == 3 && !middle_of(&ca, mesh, edges, c, a, error)))
        return false;
    const uint32_t parts[4][4][3] = {{{a, b, c}},
                                     {{a, ab, c}, {ab, b, c}},
                                     {{ab, b, bc}, {a, ab, bc}, {a, bc, c}},
                                     {{a, ab, ca}, {ab, b, bc}, {ca, bc, c}, {ab, bc, ca}}};
    for (int i = 0; i <= count; i++)
        if (!alb_mesh_add_face(mesh, parts[count][i][0], parts[count][i][1], parts[count][i][2], group, error))
            return false;
    return true;
}

// One round: every long edge is halved once. *halved counts them.
static bool subdivide_once(alb_mesh *mesh, size_t *halved, double longest_mm, alb_error *error)
{
    bool ok = false;
    hash_table edges = {0};
    uint32_t(*faces)[3] = mesh->faces;
    uint16_t *groups = mesh->groups;
    const size_t count = mesh->face_count;
    mesh->faces = NULL, mesh->groups = NULL;
    mesh->face_count = mesh->face_capacity = 0;
    *halved = 0;
    if (!table_create(&edges, 3 * count, error))
        goto done;
    for (size_t i = 0; i < count; i++) {
        bool is_long[3];
        for (int k = 0; k < 3; k++) {
            const alb_vector edge = alb_sub(mesh->vertices[faces[i][(k + 1) % 3]], mesh->vertices[faces[i][k]]);
            is_long[k] = alb_length(edge) > longest_mm;
            *halved += is_long[k];
        }
        if (!split_face(mesh, &edges, faces[i], is_long, groups[i], error))
            goto done;
    }
    ok = true;
done:
    free(edges.slots);
    free(faces);
    free(groups);
    return ok;
}

bool alb_mesh_subdivide(alb_mesh *mesh, double longest_mm, alb_error *error)
{
    double least = 0; // triangles that come of it: by area, or for slivers by length
    for (size_t i = 0; i < mesh->face_count; i++) {
        const alb_vector a = mesh->vertices[mesh->faces[i][0]];
        const alb_vector ab = alb_sub(mesh->vertices[mesh->faces[i][1]], a);
        const alb_vector ac = alb_sub(mesh->vertices[mesh->faces[i][2]], a);
        const double length = fmax(alb_length(ab), fmax(alb_length(ac), alb_length(alb_sub(ac, ab))));
        least += fmax(0.5 * alb_length(alb_cross(ab, ac)) / (longest_mm * longest_mm), length / longest_mm);
    }
    if (least > ALB_FACES_MAX / 4)
        return alb_fail(error, ALB_BAD_DATA, "edges of %g mm would make more than %d triangles; choose longer ones",
                        longest_mm, ALB_FACES_MAX / 4);
    for (size_t halved = 1; halved;)
        if (!subdivide_once(mesh, &halved, longest_mm, error))
            return false;
    return true;
}

// What a scene looks like does not depend on where it stands.
#include "check.h"
#include "render/shadow_emitter.h"
#include "render/shape.h"

// A ball of 3 mm that is 10 km away and the same vertices brought to the origin, which is exact: the pieces of the
// light, whatever samples they are sorted into, lie in the same places as seen from the ball's centre.
static void a_light_far_from_the_origin_stays_in_its_place(void **state)
{
    (void)state;
    alb_error error = {0};
    alb_mesh mesh = {0};
    alb_shadow_emitter *emitters = calloc(2, sizeof *emitters);
    float white[80][3];
    double sums[2] = {0};
    const alb_sphere ball = {.radius_mm = 3, .subdivisions = 1, .centre_mm = {1e7, -1e7, 1e7}};
    for (int f = 0; f < 80; f++)
        white[f][0] = white[f][1] = white[f][2] = 1;
    check_ok(alb_shape_sphere(&mesh, &ball, &error), &error);
    assert_int_equal(mesh.face_count, 80);
    for (int k = 0; k < 2; k++) {
        const alb_shadow_sphere sphere = {.centre_mm = k ? (alb_vector){0} : ball.centre_mm, .radius_mm = 3};
        for (size_t v = 0; k && v < mesh.vertex_count; v++)
            mesh.vertices[v] = alb_sub(mesh.vertices[v], ball.centre_mm);
        check_ok(alb_shadow_emitter_create(&emitters[k], &mesh, (const float(*)[3])white, &error), &error);
        check_ok(alb_shadow_emitter_place(&emitters[k], mesh.vertices, &sphere, &error), &error);
        for (size_t m = 0; m < emitters[k].many_count; m++)
            for (int axis = 0; axis < 3; axis++)
                sums[k] += (double)emitters[k].many[m].size * pow((double)emitters[k].many[m].at[axis], 2);
        for (size_t group = 0; group < emitters[k].group_count; group++) // a ball hides nothing of itself
            assert_false(emitters[k].hidden[group]);
        alb_shadow_emitter_free(&emitters[k]);
    }
    // single precision of numbers up to one, and means of other pieces on a curved surface
    check_relative(sums[0], sums[1], 1e-4);
    alb_mesh_free(&mesh);
    free(emitters);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_light_far_from_the_origin_stays_in_its_place),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

// Environments: which way a map is held, and how bright a sky all lights make.
#include "check.h"
#include "render/light.h"

// A map of radiance 2 + (x, y, z) of the direction that a pixel's middle stands for, by the definition of latitude and
// longitude: +y up, the middle of the picture is -z, its right half +x.
static void make_map(alb_image *map)
{
    alb_error error = {0};
    check_ok(alb_image_create(map, 128, 64, "R,G,B", &error), &error);
    for (int row = 0; row < map->height; row++)
        for (int column = 0; column < map->width; column++) {
            const double latitude = M_PI * (0.5 - (row + 0.5) / map->height),
                         longitude = 2 * M_PI * ((column + 0.5) / map->width - 0.5);
            float *pixel = alb_image_at(map, column, row);
            pixel[0] = (float)(2 + cos(latitude) * sin(longitude));
            pixel[1] = (float)(2 + sin(latitude));
            pixel[2] = (float)(2 - cos(latitude) * cos(longitude));
        }
}

static void a_map_is_held_with_y_up_and_z_behind(void **state)
{
    (void)state;
    alb_light light = {.kind = ALB_LIGHT_ENVIRONMENT, .radiance = {9, 9, 9}};
    make_map(&light.map);
    for (int k = 0; k < 200; k++) {
        const double y = 1 - (2 * k + 1.0) / 200, side = sqrt(1 - y * y);
        const alb_vector to = {side * cos(3.7 * k), y, side * sin(3.7 * k)};
        double radiance[3];
        alb_light_sky(radiance, &light, to);
        // between pixels 1/20 apart a line misses 1/8 of that squared, either way; none lies within a pixel of a pole
        check_near(radiance[0], 2 + to.x, 7e-4);
        check_near(radiance[1], 2 + to.y, 7e-4);
        check_near(radiance[2], 2 + to.z, 7e-4);
    }
    alb_light_free(&light);
}

// Light of an environment of radiance L on a patch that sees nothing else is pi L: an even sky's radiosity is that of
// the mean.
static void an_even_sky_is_as_bright_as_all_environments(void **state)
{
    (void)state;
    double sky[3];
    alb_light lights[3] = {{.kind = ALB_LIGHT_ENVIRONMENT, .radiance = {1, 0.5, 0}},
                           {.kind = ALB_LIGHT_POINT, .flux = {7, 7, 7}, .radiance = {7, 7, 7}},
                           {.kind = ALB_LIGHT_ENVIRONMENT}};
    alb_lights_sky(sky, lights, 0);
    assert_true(sky[0] == 0 && sky[1] == 0 && sky[2] == 0);
    alb_lights_sky(sky, lights, 2);
    for (int c = 0; c < 3; c++)
        check_near(sky[c], M_PI * lights[0].radiance[c], 1e-12);
    make_map(&lights[2].map);
    alb_lights_sky(sky, lights, 3);
    for (int c = 0; c < 3; c++) // 256 directions, whose mean is zero but for their 1/256
        check_near(sky[c], M_PI * (2 + lights[0].radiance[c]), M_PI / 256);
    alb_light_free(&lights[2]);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_map_is_held_with_y_up_and_z_behind),
        cmocka_unit_test(an_even_sky_is_as_bright_as_all_environments),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

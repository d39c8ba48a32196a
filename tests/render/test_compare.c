#include "base/random.h"
#include "check.h"
#include "render/compare.h"
#include "well_formed.h"

#include <unistd.h>

static alb_image filled(int width, int height, const char *names, float value)
{
    alb_error error = {0};
    alb_image image = {0};
    check_ok(alb_image_create(&image, width, height, names, &error), &error);
    for (int i = 0; i < width * height * image.channels; i++)
        image.pixels[i] = value;
    return image;
}

static alb_image random_image(int width, int height, const char *names, uint64_t seed)
{
    alb_image image = filled(width, height, names, 0);
    for (int i = 0; i < width * height * image.channels; i++) {
        alb_random random = alb_random_at(seed, 0, (uint64_t)i);
        image.pixels[i] = (float)(0.1 + alb_random_uniform(&random));
    }
    return image;
}

static alb_comparison compared(const alb_image *photo, const alb_image *render, const alb_image *mask)
{
    alb_error error = {0};
    alb_comparison c = {0};
    check_ok(alb_compare_images(&c, photo, "photo", render, "render", mask, &error), &error);
    return c;
}

static void free_all(alb_image *a, alb_image *b, alb_comparison *c)
{
    alb_image_free(a);
    alb_image_free(b);
    alb_comparison_free(c);
    assert_null(c->used);
}

static void identical_pictures_are_identical(void **state)
{
    (void)state;
    alb_image a = random_image(40, 30, "R,G,B", 1);
    alb_comparison c = compared(&a, &a, NULL);
    check_near(c.scale, 1, 0); // sum p p / sum p p, the same bits twice
    for (int k = 0; k < 3; k++) {
        check_near(c.channel[k].rmse, 0, 0);
        assert_true(isinf(c.channel[k].psnr_db) && c.channel[k].psnr_db > 0);
        check_near(c.channel[k].ssim, 1, 1e-6); // single precision inside OpenCV
    }
    assert_int_equal(c.compared, 1200);
    alb_image none = {0};
    free_all(&a, &none, &c);
}

static void scale_is_recovered_also_per_channel(void **state)
{
    (void)state;
    const double casts[] = {2.5, 3.0, 0.125};
    alb_image render = random_image(40, 30, "R,G,B,ignored", 2), photo = filled(40, 30, "variance.R,B,G,R", NAN);
    for (int i = 0; i < 1200; i++)
        for (int k = 0; k < 3; k++)
            photo.pixels[i * 4 + 3 - k] = (float)casts[k] * render.pixels[i * 4 + k];
    alb_comparison c = compared(&photo, &render, NULL);
    for (int k = 0; k < 3; k++)
        check_relative(c.channel[k].scale, casts[k], 1e-7); // one rounding to float
    double top = 0, bottom = 0; // the common scale, weighted by the render's energy in each channel
    for (int k = 0; k < 3; k++)
        for (int i = 0; i < 1200; i++) {
            const double r = (double)render.pixels[i * 4 + k];
            top += casts[k] * r * r, bottom += r * r;
        }
    check_relative(c.scale, top / bottom, 1e-7);
    free_all(&photo, &render, &c);
}

// Photo 1, render 1 +- d on a chessboard: s = 1/(1 + d^2), mean square left = d^2/(1 + d^2).
static void known_difference_by_hand(void **state)
{
    (void)state;
    alb_image photo = filled(16, 16, "Y", 1), render = filled(16, 16, "Y", 1);
    for (int y = 0; y < 16; y++)
        for (int x = 0; x < 16; x++)
            *alb_image_at(&render, x, y) = (x + y) % 2 ? 1.25f : 0.75f;
    alb_comparison c = compared(&photo, &render, NULL);
    check_near(c.scale, 16.0 / 17, 1e-12);
    check_near(c.peak, 1, 0);
    check_near(c.all.rmse, 0.24253562503633297, 1e-7);          // sqrt(1/17)
    check_near(c.all.relative_rmse, 0.24253562503633297, 1e-7); // the photo's rms is 1
    check_near(c.all.psnr_db, 12.304489213782739, 1e-5);        // 10 log10 17
    free_all(&photo, &render, &c);
}

static void peak_is_the_percentile_of_compared_values(void **state)
{
    (void)state;
    alb_image photo = filled(100, 20, "Y", NAN);
    for (int i = 0; i < 1000; i++)
        photo.pixels[2 * i] = (float)(1 + (i * 7) % 1000); // 1 ... 1000, each once
    alb_comparison c = compared(&photo, &photo, NULL);
    check_near(c.peak, 999, 0); // 999 of the 1000 are at or below
    alb_image none = {0};
    free_all(&photo, &none, &c);
}

// OpenCV's own constants and window are trusted; that a constant offset costs what the formula says is not.
static void ssim_of_two_flat_pictures(void **state)
{
    (void)state;
    alb_image photo = filled(32, 32, "R,G,B", 1), render = filled(32, 32, "R,G,B", 1);
    for (int i = 0; i < 32 * 32; i++)
        render.pixels[3 * i] = 3; // s = (3 + 1 + 1) / (9 + 1 + 1) = 5/11: R 15/11, G and B 5/11, peak 1
    alb_comparison c = compared(&photo, &render, NULL);
    const double c1 = 0.01 * 0.01, r = 15.0 / 11, g = 5.0 / 11; // luminance term only: (2 a b + c1)/(a^2 + b^2 + c1)
    check_near(c.channel[0].ssim, (2 * r + c1) / (1 + r * r + c1), 1e-4); // float variances of flat fields, not quite 0
    check_near(c.channel[1].ssim, (2 * g + c1) / (1 + g * g + c1), 1e-4);
    check_near(c.all.ssim, (c.channel[0].ssim + 2 * c.channel[1].ssim) / 3, 1e-12);
    free_all(&photo, &render, &c);
}

static void masks_and_bad_pixels_are_left_out_and_counted(void **state)
{
    (void)state;
    alb_image photo = random_image(64, 64, "R,G,B", 3), render = random_image(64, 64, "R,G,B", 3);
    alb_image mask = filled(64, 64, "Y", 0);
    for (int y = 0; y < 32; y++)
        for (int x = 0; x < 64; x++)
            *alb_image_at(&mask, x, y) = 1;
    for (int x = 0; x < 64; x++)
        alb_image_at(&photo, x, 50)[1] = 1e6f; // outside the mask: must not matter
    alb_image_at(&photo, 1, 1)[0] = NAN;
    alb_image_at(&photo, 2, 1)[2] = INFINITY;
    alb_image_at(&render, 3, 1)[1] = NAN;
    alb_image_at(&render, 1, 1)[1] = NAN; // counted once, as the photo's
    alb_comparison c = compared(&photo, &render, &mask);
    assert_int_equal(c.outside_mask, 64 * 32);
    assert_int_equal(c.bad_photo, 2);
    assert_int_equal(c.bad_render, 1);
    assert_int_equal(c.compared, 64 * 32 - 3);
    check_near(c.scale, 1, 0);
    check_near(c.all.rmse, 0, 0);
    check_below(c.peak, 1.2);
    assert_true(c.spot_y < 32);
    alb_image_free(&mask);
    free_all(&photo, &render, &c);
}

// A picture inside a large masked surround has the SSIM it has alone, but for windows that reach over its edge.
static void ssim_is_not_flattered_by_a_mask(void **state)
{
    (void)state;
    alb_image a = random_image(60, 60, "Y", 4), b = random_image(60, 60, "Y", 5);
    alb_image big_a = filled(240, 240, "Y", NAN), big_b = filled(240, 240, "Y", 7);
    for (int y = 0; y < 60; y++)
        for (int x = 0; x < 60; x++) {
            *alb_image_at(&big_a, x + 90, y + 90) = *alb_image_at(&a, x, y);
            *alb_image_at(&big_b, x + 90, y + 90) = *alb_image_at(&b, x, y);
        }
    alb_comparison alone = compared(&a, &b, NULL), inside = compared(&big_a, &big_b, NULL);
    check_near(inside.scale, alone.scale, 1e-12);
    check_near(inside.all.rmse, alone.all.rmse, 1e-12);
    check_below(alone.all.ssim, 0.5);
    check_near(inside.all.ssim, alone.all.ssim,
               0.2); // windows of 11 pixels: a fifth of 60 is edge; flattered it would be 0.97
    free_all(&a, &b, &alone);
    free_all(&big_a, &big_b, &inside);
}

static void spot_is_found_despite_a_hot_pixel(void **state)
{
    (void)state;
    alb_image photo = filled(80, 60, "R,G,B", 0);
    for (int y = 0; y < 60; y++)
        for (int x = 0; x < 80; x++)
            for (int k = 0; k < 3; k++)
                alb_image_at(&photo, x, y)[k] = (float)exp(-0.05 * ((x - 23) * (x - 23) + (y - 41) * (y - 41)));
    alb_image_at(&photo, 70, 5)[0] = 5;
    alb_comparison c = compared(&photo, &photo, NULL);
    assert_int_equal(c.spot_x, 23);
    assert_int_equal(c.spot_y, 41);
    alb_image none = {0};
    free_all(&photo, &none, &c);
}

static void what_cannot_be_compared_is_refused(void **state)
{
    (void)state;
    alb_error error = {0};
    alb_comparison c = {0};
    alb_image one = filled(8, 8, "R,G,B", 1), small = filled(8, 7, "R,G,B", 1), grey = filled(8, 8, "Y", 1);
    alb_image zero = filled(8, 8, "R,G,B", 0), bad = filled(8, 8, "R,G,B", NAN), negative = filled(8, 8, "R,G,B", -1);
    check_fails(alb_compare_images(&c, &one, "p", &small, "r.exr", NULL, &error), &error, ALB_BAD_DATA, "r.exr: 8 x 7");
    check_fails(alb_compare_images(&c, &one, "p", &one, "r", &small, &error), &error, ALB_BAD_DATA, "mask has 8 x 7");
    check_fails(alb_compare_images(&c, &one, "p", &grey, "r", NULL, &error), &error, ALB_BAD_DATA, "R, G, B");
    check_fails(alb_compare_images(&c, &one, "p", &zero, "r", NULL, &error), &error, ALB_BAD_DATA, "zero in all 64");
    check_fails(alb_compare_images(&c, &zero, "p", &one, "r", NULL, &error), &error, ALB_BAD_DATA, "p: dark");
    check_fails(alb_compare_images(&c, &one, "p", &bad, "r", NULL, &error), &error, ALB_BAD_DATA, "64 in the render");
    check_fails(alb_compare_images(&c, &bad, "p", &one, "r", NULL, &error), &error, ALB_BAD_DATA, "64 not finite");
    check_fails(alb_compare_images(&c, &one, "p", &one, "r", &zero, &error), &error, ALB_BAD_DATA, "64 outside");
    check_fails(alb_compare_images(&c, &one, "p", &negative, "r", NULL, &error), &error, ALB_BAD_DATA, "factor");
    assert_null(c.used);
    alb_image *all[] = {&one, &small, &grey, &zero, &bad, &negative};
    for (int i = 0; i < 6; i++)
        alb_image_free(all[i]);
}

static void eight_bits_are_decoded_and_clipped_ones_dropped(void **state)
{
    (void)state;
    alb_error error = {0};
    alb_image image = filled(3, 1, "Y", 0), read = {0};
    const char *how = NULL;
    image.pixels[0] = 0.2140411f; // display value 0.5
    image.pixels[1] = 0.001f;     // on the straight part: 12.92 * 0.001
    image.pixels[2] = 2;
    check_ok(alb_image_write_png(&image, 1, "test_compare.png", &error), &error);
    check_ok(alb_compare_read(&read, &how, "test_compare.png", &error), &error);
    check_near((double)read.pixels[0], 0.2140411,
               0.5 / 255 * 1.1); // half a step times the slope of the curve there, 1.0
    check_near((double)read.pixels[1], 0.001, 0.5 / 255 / 12.92 * 1.01);
    assert_true(isnan(read.pixels[2]));
    assert_non_null(strstr(how, "sRGB"));
    alb_image_free(&read);
    image.pixels[0] = 1000, image.pixels[1] = 2000, image.pixels[2] = 65535;
    check_ok(alb_image_write_png16(&image, "test_compare.png", &error), &error);
    check_ok(alb_compare_read(&read, &how, "test_compare.png", &error), &error);
    check_near((double)(read.pixels[1] / read.pixels[0]), 2, 1e-6);
    assert_true(isnan(read.pixels[2]));
    alb_image_free(&read);
    alb_image_free(&image);
    remove("test_compare.png");
}

static void pictures_show_the_sign_of_the_difference(void **state)
{
    (void)state;
    alb_error error = {0};
    alb_image photo = filled(32, 32, "R,G,B", 1), render = filled(32, 32, "R,G,B", 1), picture = {0};
    alb_page page;
    for (int y = 0; y < 32; y++)
        for (int k = 0; k < 3; k++) {
            alb_image_at(&photo, 4, y)[k] = 1.5f;   // photo brighter: red
            alb_image_at(&render, 20, y)[k] = 1.5f; // render brighter: blue
            alb_image_at(&photo, 30, y)[k] = NAN;   // grey
        }
    alb_comparison c = compared(&photo, &render, NULL);
    alb_page_begin(&page, "t", NULL);
    check_ok(alb_comparison_draw(&page, &c, ".", "test_compare", &error), &error);
    check_ok(alb_page_write(&page, "test_compare.html", &error), &error);
    int bits;
    check_ok(alb_image_read(&picture, &bits, "test_compare_difference.png", &error), &error);
    const float *red = alb_image_at(&picture, 4, 9), *blue = alb_image_at(&picture, 20, 9);
    const float *grey = alb_image_at(&picture, 30, 9), *top = alb_image_at(&picture, picture.width - 1, 0);
    assert_true(red[0] > red[2] + 50 && blue[2] > blue[0] + 50 && top[0] > top[2] + 50);
    assert_true(grey[0] == grey[1] && grey[1] == grey[2] && grey[0] < 200);
    alb_image_free(&picture);
    const char *const files[] = {"photo.png",      "render.png",     "photo_log.png",
                                 "render_log.png", "difference.png", "scanlines.svg"};
    for (int i = 0; i < 6; i++) {
        char name[64];
        snprintf(name, sizeof name, "test_compare_%s", files[i]);
        assert_int_equal(remove(name), 0);
    }
    remove("test_compare.html");
    free_all(&photo, &render, &c);
}

static void write_text(const char *path, const char *text)
{
    alb_error error = {0};
    check_ok(alb_file_write(path, text, strlen(text), &error), &error);
}

// S = 0.1 e^(-r/2) in reflection of G: the total 2 pi 0.1 4 is written out, not asked of the material.
static alb_material exponential_material(void)
{
    alb_material m = {.name = "test", .channels = 3, .channel_names = {"R", "G", "B"}};
    m.fitted[ALB_REFLECTION][1] = (alb_fitted){.profile = {ALB_FORM_EXPONENTIAL, {0.1, 0.5}},
                                               .total = 2.5132741228718345,
                                               .total_sd = 0.03,
                                               .identifiable = true};
    return m;
}

static void material_against_truth_by_hand(void **state)
{
    (void)state;
    alb_error error = {0};
    alb_material_check check = {0};
    const alb_material material = exponential_material();
    // The truth lies 10 % above and below the fit's mean over the rings about 1 and 2 mm (0.4940 to 1.3690, 1.4574 to
    // 2.4574 mm, integrated elsewhere); 0.25 mm is inside the beam, 3 mm is too noisy.
    write_text(
        "test_truth.json",
        "{\"format\":1,\"channels\":{\"G\":{\"reflection\":{\"total\":2.5,\"total_sd\":0.04,"
        "\"r_mm\":[0.25,1,2,3,4],\"value_per_mm2\":[9,0.06721896251954622,0.03345044132594171,9,9],"
        "\"sd_per_mm2\":[0,0,0,1,0]},\"transmission\":{\"total\":0.1,\"total_sd\":0,\"r_mm\":[],\"value_per_mm2\":[],"
        "\"sd_per_mm2\":[]}}}}");
    check_ok(alb_compare_material(&check, &material, "test_truth.json", &error), &error);
    assert_int_equal(check.count, 2);
    const alb_profile_check *p = &check.profiles[0];
    assert_true(p->measured);
    check_near(p->deviation_percent, 0.530964914873, 1e-9); // 100 (0.8 pi - 2.5) / 2.5
    check_near(p->deviation_sd, 0.26548245744, 1e-9);       // (0.8 pi - 2.5) / 0.05
    assert_int_equal(p->bins, 2);
    check_near(p->from_mm, 1, 0);
    check_near(p->to_mm, 2, 0);
    check_near(p->curve_rms, 0.10151389516, 1e-9); // sqrt(((1/1.1 - 1)^2 + (1/0.9 - 1)^2) / 2)
    assert_false(check.profiles[1].measured);
    alb_page page;
    alb_page_begin(&page, "t", NULL);
    check_ok(alb_material_check_draw(&page, &check, ".", "test_truth", &error), &error);
    assert_non_null(strstr(page.html.bytes, "not measured"));
    assert_non_null(strstr(page.html.bytes, "+0.53 %"));
    alb_page_free(&page);
    alb_material_check_free(&check);
    remove("test_truth_profiles.svg");
    remove("test_truth.json");
}

static void hostile_truths_are_refused(void **state)
{
    (void)state;
    alb_error error = {0};
    alb_material_check check = {0};
    const alb_material material = exponential_material();
    const struct {
        const char *text, *part;
    } cases[] = {
        {"", "test_truth.json"},
        {"{}", "format"},
        {"{\"format\":1,\"channels\":{}}", "no channel"},
        {"{\"format\":1,\"channels\":{\"a\":{},\"b\":{},\"c\":{},\"d\":{}}}", "4 channels"},
        {"{\"format\":1,\"channels\":{\"G\":{\"sideways\":{}}}}", "sideways"},
        {"{\"format\":1,\"channels\":{\"G\":{\"reflection\":{\"total\":-1}}}}", "total"},
        {"{\"format\":1,\"channels\":{\"G\":{\"reflection\":{\"total\":1,\"total_sd\":0,\"r_mm\":[1,2],\"value_per_"
         "mm2\":[1],"
         "\"sd_per_mm2\":[0]}}}}",
         "equally many"},
        {"{\"format\":1,\"channels\":{\"G\":{\"reflection\":{\"total\":1,\"total_sd\":0,\"r_mm\":[2,1],\"value_per_"
         "mm2\":[1,1],"
         "\"sd_per_mm2\":[0,0]}}}}",
         "ascend"},
        {"{\"format\":1,\"channels\":{\"B\":{\"reflection\":{\"total\":1,\"total_sd\":0,\"r_mm\":[1],\"value_per_mm2\":"
         "[1],"
         "\"sd_per_mm2\":[0]}}}}",
         "no channel"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        write_text("test_truth.json", cases[i].text);
        check_fails(alb_compare_material(&check, &material, "test_truth.json", &error), &error, ALB_BAD_DATA,
                    cases[i].part);
    }
    remove("test_truth.json");
    check_fails(alb_compare_material(&check, &material, "test_truth.json", &error), &error, ALB_ACCESS,
                "test_truth.json");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(identical_pictures_are_identical),
        cmocka_unit_test(scale_is_recovered_also_per_channel),
        cmocka_unit_test(known_difference_by_hand),
        cmocka_unit_test(peak_is_the_percentile_of_compared_values),
        cmocka_unit_test(ssim_of_two_flat_pictures),
        cmocka_unit_test(masks_and_bad_pixels_are_left_out_and_counted),
        cmocka_unit_test(ssim_is_not_flattered_by_a_mask),
        cmocka_unit_test(spot_is_found_despite_a_hot_pixel),
        cmocka_unit_test(what_cannot_be_compared_is_refused),
        cmocka_unit_test(eight_bits_are_decoded_and_clipped_ones_dropped),
        cmocka_unit_test(pictures_show_the_sign_of_the_difference),
        cmocka_unit_test(material_against_truth_by_hand),
        cmocka_unit_test(hostile_truths_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

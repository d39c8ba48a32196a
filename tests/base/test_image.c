// Images and files: round trips to the bit, OpenEXR's conformance and damaged files, atomic writing.
#include "base/exr.h"
#include "base/file.h"
#include "base/image.h"
#include "base/random.h"
#include "check.h"
#include <dirent.h>
#include <sys/stat.h>
#include <unistd.h>

static void exr_round_trip_is_exact(void **state)
{
    (void)state;
    alb_error error = {0};
    alb_image a, b;
    check_ok(alb_image_create(&a, 37, 41, "R,G,B,variance.R", &error), &error);
    for (int i = 0; i < 37 * 41 * 4; i++)
        a.pixels[i] = i % 97 == 0 ? NAN : ldexpf((float)(i * 7919 % 1009), i % 200 - 100);
    check_ok(alb_exr_write(&a, "made by a test", "round.exr", &error), &error);
    check_ok(alb_exr_read(&b, "round.exr", &error), &error);
    assert_int_equal(b.channels, 4);
    for (int c = 0; c < 4; c++)
        assert_string_equal(a.name[c], b.name[c]);
    assert_memory_equal(a.pixels, b.pixels, sizeof(float) * 37 * 41 * 4);
    char first[ALB_HASH_SIZE], second[ALB_HASH_SIZE];
    check_ok(alb_hash_file(first, "round.exr", &error), &error);
    check_ok(alb_exr_write(&a, "made by a test", "round2.exr", &error), &error);
    check_ok(alb_hash_file(second, "round2.exr", &error), &error);
    assert_string_equal(first, second);
    alb_image_free(&a);
    alb_image_free(&b);
}

// Noise does not compress: some block comes out exactly as long as it went in, which OpenEXRCore 3.1 alone writes
// wrongly, in a few of these images.
static void noise_survives(void **state)
{
    (void)state;
    for (int k = 0; k < 400; k++) {
        const int width = 8 + 39 * (k % 10), height = 1 + k / 10;
        alb_error error = {0};
        alb_image a, b;
        check_ok(alb_image_create(&a, width, height, "R,G,B,variance.R", &error), &error);
        for (int i = 0; i < width * height * 4; i++) {
            alb_random random = alb_random_at((uint64_t)height, (uint64_t)(3 * (k % 10)), (uint64_t)i);
            a.pixels[i] = (float)alb_random_uniform(&random);
        }
        check_ok(alb_exr_write(&a, NULL, "noise.exr", &error), &error);
        check_ok(alb_exr_read(&b, "noise.exr", &error), &error);
        assert_memory_equal(a.pixels, b.pixels, sizeof(float) * (size_t)(width * height * 4));
        alb_image_free(&a);
        alb_image_free(&b);
    }
}

static void png16_round_trip_is_exact(void **state)
{
    (void)state;
    alb_error error = {0};
    alb_image a, b;
    int bits = -1;
    check_ok(alb_image_create(&a, 16, 9, "R,G,B", &error), &error);
    for (int i = 0; i < 16 * 9 * 3; i++)
        a.pixels[i] = (float)(i * 151 % 65536);
    check_ok(alb_image_write_png16(&a, "round.png", &error), &error);
    check_ok(alb_image_read(&b, &bits, "round.png", &error), &error);
    assert_int_equal(bits, 16);
    assert_memory_equal(a.pixels, b.pixels, sizeof(float) * 16 * 9 * 3);
    alb_image_free(&a);
    alb_image_free(&b);
}

// The data's README: uffizi_crop.pfm holds the exact values of every one of the files beside it.
static void exr_conformance(void **state)
{
    (void)state;
    const char *folder = ALB_SHARED_DATA "/exr_conformance/crop";
    DIR *entries = opendir(folder);
    if (!entries) {
        print_message("skipped: %s is not here\n", folder);
        skip();
    }
    alb_error error = {0};
    alb_image truth;
    check_ok(alb_image_read(&truth, NULL, ALB_SHARED_DATA "/exr_conformance/crop/uffizi_crop.pfm", &error), &error);
    int count = 0;
    for (struct dirent *entry; (entry = readdir(entries));) {
        char path[4096];
        alb_image image;
        if (!strstr(entry->d_name, ".exr"))
            continue;
        snprintf(path, sizeof path, "%s/%s", folder, entry->d_name);
        check_ok(alb_exr_read(&image, path, &error), &error);
        assert_int_equal(image.width, 64);
        assert_memory_equal(image.pixels, truth.pixels, sizeof(float) * 64 * 48 * 3);
        alb_image_free(&image);
        count++;
    }
    closedir(entries);
    alb_image_free(&truth);
    assert_int_equal(count, 10);
}

static void check_damaged(const char *folder, int expected)
{
    DIR *entries = opendir(folder);
    if (!entries) {
        print_message("skipped: %s is not here\n", folder);
        skip();
    }
    int count = 0;
    for (struct dirent *entry; (entry = readdir(entries));) {
        char path[4096];
        alb_error error = {0};
        alb_image image;
        if (entry->d_name[0] == '.')
            continue;
        snprintf(path, sizeof path, "%s/%s", folder, entry->d_name);
        const bool valid = strstr(entry->d_name, "valid") || strstr(entry->d_name, "bitflips");
        if (alb_image_read(&image, NULL, path, &error))
            assert_true(image.width > 0 && image.pixels);
        else {
            assert_true(error.status == ALB_BAD_DATA || error.status == ALB_NO_MEMORY);
            assert_null(image.pixels);
            assert_non_null(strstr(error.text, entry->d_name));
            assert_false(valid && strstr(entry->d_name, "valid"));
        }
        alb_image_free(&image);
        count++;
    }
    closedir(entries);
    assert_int_equal(count, expected);
}

static void damaged_exr(void **state)
{
    (void)state;
    check_damaged(ALB_SHARED_DATA "/bad_input/exr", 86);
}
static void damaged_pictures(void **state)
{
    (void)state;
    check_damaged(ALB_SHARED_DATA "/bad_input/image", 13);
}
static void damaged_pfm(void **state)
{
    (void)state;
    check_damaged(ALB_SHARED_DATA "/bad_input/pfm", 4);
}

static void truncated_exr_is_an_error(void **state)
{
    (void)state;
    alb_error error = {0};
    alb_image image;
    char *bytes;
    size_t size;
    check_ok(alb_image_create(&image, 64, 64, "R,G,B", &error), &error);
    for (int i = 0; i < 64 * 64 * 3; i++)
        image.pixels[i] = (float)(i % 211);
    check_ok(alb_exr_write(&image, NULL, "whole.exr", &error), &error);
    alb_image_free(&image);
    check_ok(alb_file_read(&bytes, &size, "whole.exr", &error), &error);
    for (size_t cut = 0; cut < size; cut += 97) {
        check_ok(alb_file_write("cut.exr", bytes, cut, &error), &error);
        assert_false(alb_image_read(&image, NULL, "cut.exr", &error));
        assert_int_equal(error.status, ALB_BAD_DATA);
        error = (alb_error){0};
    }
    free(bytes);
}

static void a_failed_write_keeps_the_old_file(void **state)
{
    (void)state;
    alb_error error = {0};
    mkdir("keep", 0777);
    check_ok(alb_file_write("keep/a", "old", 3, &error), &error);
    check_fails(alb_file_write("nowhere/a", "new", 3, &error), &error, ALB_ACCESS, "nowhere/a");
    check_fails(alb_file_write("keep", "new", 3, &error), &error, ALB_ACCESS, "keep");
    char *bytes;
    size_t size;
    check_ok(alb_file_read(&bytes, &size, "keep/a", &error), &error);
    assert_string_equal(bytes, "old");
    free(bytes);
    int files = 0;
    DIR *entries = opendir("keep");
    for (struct dirent *entry; (entry = readdir(entries));)
        files += entry->d_name[0] != '.';
    closedir(entries);
    assert_int_equal(files, 1); // no temporary file stays behind
}

static void known_hash(void **state)
{
    (void)state;
    alb_error error = {0};
    char hex[ALB_HASH_SIZE];
    check_ok(alb_hash_bytes(hex, "abc", 3, &error), &error); // FIPS 180-4, example
    assert_string_equal(hex, "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(exr_round_trip_is_exact),
        cmocka_unit_test(png16_round_trip_is_exact),
        cmocka_unit_test(exr_conformance),
        cmocka_unit_test(damaged_exr),
        cmocka_unit_test(damaged_pictures),
        cmocka_unit_test(damaged_pfm),
        cmocka_unit_test(truncated_exr_is_an_error),
        cmocka_unit_test(a_failed_write_keeps_the_old_file),
        cmocka_unit_test(known_hash),
        cmocka_unit_test(noise_survives),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

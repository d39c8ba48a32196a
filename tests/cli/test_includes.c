// The house's rule of includes, read from the sources: base <- capture <- calibrate <- fit <- render. A folder includes
// its own headers, base/*.h, and of a stage to its left only that stage's door; each third-party library is included by
// one file.
#include "check.h"

#include <dirent.h>

static const char *const stages[] = {"base", "capture", "calibrate", "fit", "render"};
static const char *const doors[] = {NULL, "capture/session.h", "calibrate/calibration.h", "fit/material.h",
                                    "render/scene.h"};
enum { STAGES = 5 };

static const struct {
    const char *prefix, *file;
} libraries[] = {
    {"opencv2/", "base/vision.cpp"}, {"openexr", "base/exr.c"},   {"OpenEXR/", "base/exr.c"},
    {"jansson", "base/record.c"},    {"openssl/", "base/file.c"}, {"ceres/", "fit/solve.cpp"},
    {"embree", "render/tracer.c"},   {"glog/", "fit/solve.cpp"},
};

static const char system_headers[] =
    " assert.h ctype.h dirent.h errno.h fcntl.h float.h ftw.h inttypes.h limits.h locale.h math.h omp.h pthread.h "
    "signal.h "
    "stdarg.h stdatomic.h stdbool.h stddef.h stdint.h stdio.h stdlib.h string.h strings.h sys/file.h sys/mman.h "
    "sys/stat.h sys/types.h time.h unistd.h xmmintrin.h pmmintrin.h ";

static int includes_seen, violations;

static void violation(const char *file, const char *included, const char *why)
{
    print_error("%s includes %s: %s\n", file, included, why);
    violations++;
}

static int stage_of(const char *path)
{
    for (int i = 0; i < STAGES; i++)
        if (strncmp(path, stages[i], strlen(stages[i])) == 0 && path[strlen(stages[i])] == '/')
            return i;
    return -1;
}

static void check_own(const char *file, const char *included)
{
    const int from = strchr(file, '/') ? stage_of(file) : STAGES, to = stage_of(included);
    if (to < 0)
        violation(file, included, "headers are named from the top: \"stage/name.h\"");
    else if (to > from)
        violation(file, included, "that stage stands to the right");
    else if (to != from && to != 0 && strcmp(included, doors[to]) != 0)
        violation(file, included, "only the stage's door may be included");
}

static void check_system(const char *file, const char *included)
{
    char padded[128];
    for (size_t i = 0; i < sizeof libraries / sizeof *libraries; i++)
        if (strncmp(included, libraries[i].prefix, strlen(libraries[i].prefix)) == 0) {
            if (strcmp(file, libraries[i].file) != 0)
                violation(file, included, libraries[i].file);
            return;
        }
    snprintf(padded, sizeof padded, " %.100s ", included);
    const size_t size = strlen(file);
    const bool plus_plus = size > 4 && strcmp(file + size - 4, ".cpp") == 0 && !strpbrk(included, "./");
    if (!plus_plus && !strstr(system_headers, padded))
        violation(file, included, "neither the C library nor a library with a file of its own");
}

static void check_file(const char *file)
{
    char path[1024], line[1024], included[128];
    snprintf(path, sizeof path, "%s/%s", ALB_SOURCE_FOLDER, file);
    FILE *stream = fopen(path, "r");
    assert_non_null(stream);
    while (fgets(line, sizeof line, stream)) {
        if (sscanf(line, " # include \"%127[^\"]\"", included) == 1)
            includes_seen++, check_own(file, included);
        else if (sscanf(line, " # include <%127[^>]>", included) == 1)
            includes_seen++, check_system(file, included);
    }
    fclose(stream);
}

static int is_source(const struct dirent *entry)
{
    const char *dot = strrchr(entry->d_name, '.');
    return dot && (strcmp(dot, ".c") == 0 || strcmp(dot, ".h") == 0 || strcmp(dot, ".cpp") == 0);
}

static void stages_form_a_chain(void **state)
{
    (void)state;
    check_file("alabaster.c");
    for (int i = 0; i < STAGES; i++) {
        char folder[1024];
        struct dirent **entries;
        snprintf(folder, sizeof folder, "%s/%s", ALB_SOURCE_FOLDER, stages[i]);
        const int count = scandir(folder, &entries, is_source, alphasort);
        assert_true(count > 0);
        for (int k = 0; k < count; k++) {
            char file[512];
            snprintf(file, sizeof file, "%s/%.400s", stages[i], entries[k]->d_name);
            check_file(file);
            free(entries[k]);
        }
        free(entries);
    }
    assert_true(includes_seen > 100);
    assert_int_equal(violations, 0);
}

// The rule itself must be able to fail.
static void wrong_includes_are_seen(void **state)
{
    (void)state;
    const char *const wrong[][2] = {{"base/page.c", "fit/material.h"},
                                    {"fit/solve.cpp", "calibrate/merge.h"},
                                    {"render/scene.c", "mesh.h"},
                                    {"capture/plan.c", "calibrate/calibration.h"},
                                    {"render/scene.c", "fit/observe.h"}};
    for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++)
        check_own(wrong[i][0], wrong[i][1]);
    assert_int_equal(violations, 5);
    check_system("fit/choose.c", "ceres/ceres.h");
    check_system("fit/choose.c", "vector");
    assert_int_equal(violations, 7);
    check_own("fit/choose.c", "calibrate/calibration.h");
    check_own("alabaster.c", "base/command.h");
    check_system("fit/solve.cpp", "vector");
    assert_int_equal(violations, 7);
    violations = 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(wrong_includes_are_seen),
        cmocka_unit_test(stages_form_a_chain),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

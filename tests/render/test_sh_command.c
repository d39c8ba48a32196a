// alabaster sh-table: what it prints is the library's matrix, its C compiles and scales, wrong input is refused in a
// line.
#include "program.h"
#include "render/sh_scale.h"

static void csv_rows(void **state)
{
    (void)state;
    alb_error error = {0};
    assert_int_equal(run("sh-table --map cone --alpha 30 --order 3 --in-order 5 --measure occlusion --k 0.5:8:4"), 0);
    const alb_sh_law law = {ALB_SH_LAW_OCCLUSION, ALB_SH_MAP_CONE, 30, 3, 5};
    const char *line = output;
    assert_memory_equal(line, "k,m,l_out,l_in,value\n", 21);
    for (int i = 0; i < 4; i++) {
        alb_sh_scaling m;
        const double k = 0.5 * pow(16, i / 3.);
        check_ok(alb_sh_law_at(&m, &law, k, &error), &error);
        for (int am = 0; am < 3; am++)
            for (int l = am; l < 3; l++)
                for (int j = am; j < 5; j++) {
                    double numbers[5];
                    line = strchr(line, '\n') + 1;
                    assert_int_equal(sscanf(line, "%lf,%lf,%lf,%lf,%lf", &numbers[0], &numbers[1], &numbers[2],
                                            &numbers[3], &numbers[4]),
                                     5);
                    check_near(numbers[0], k, 0);
                    assert_true(numbers[1] == am && numbers[2] == l && numbers[3] == j);
                    check_near(numbers[4], m.value[alb_sh_scaling_index(3, 5, am, l, j)], 0);
                }
    }
    assert_string_equal(strchr(line, '\n'), "\n");
}

// Compiled, the C scales as the library does; single precision.
static void c_compiles_and_scales(void **state)
{
    (void)state;
    alb_error error = {0};
    if (shell("cc --version >/dev/null 2>&1"))
        skip();
    assert_int_equal(run("sh-table --map midrange --order 4 --in-order 6 --measure energy --k=-0.5,0.25,0 --format c"),
                     0);
    save_text("sh_table.h", output);
    save_text("sh_table.c",
              "#include \"sh_table.h\"\n#include <math.h>\n#include <stdio.h>\nint main(void)\n{\n"
              "    float in[36], out[16];\n    for (int i = 0; i < 36; i++)\n        in[i] = sinf((float)i);\n"
              "    for (int r = 0; r < 3; r++) {\n        sh_scale(out, r, in);\n"
              "        for (int i = 0; i < 16; i++)\n            printf(\"%.9g\\n\", out[i]);\n    }\n}\n");
    assert_int_equal(shell("cc -std=c99 -Wall -Wextra -Werror sh_table.c -o sh_table_program -lm && ./sh_table_program "
                           ">sh_table.txt"),
                     0);
    char *text = slurp("sh_table.txt"), *at = text;
    const double ratios[] = {-0.5, 0.25, 0};
    for (int r = 0; r < 3; r++) {
        alb_sh_scaling m;
        double in[36], out[16];
        for (int i = 0; i < 36; i++)
            in[i] = sin(i);
        check_ok(alb_sh_scaling_midrange(&m, ratios[r], ALB_SH_ENERGY, 4, 6, &error), &error);
        alb_sh_scaling_apply(out, &m, in);
        for (int i = 0; i < 16; i++)
            check_near(strtod(at, &at), out[i], 3e-6);
    }
    free(text);
    remove("sh_table.h"), remove("sh_table.c"), remove("sh_table_program"), remove("sh_table.txt");
}

// The same numbers, each with a point or an exponent: GLSL ES takes no whole number for a float.
static void glsl_numbers(void **state)
{
    (void)state;
    assert_int_equal(run("sh-table --map cone --order 2 --k 1,2 --format c"), 0);
    char *c = strdup(output);
    assert_int_equal(run("sh-table --map cone --order 2 --k 1,2 --format glsl"), 0);
    const char *of_c = strchr(strstr(c, "sh_scaling["), '{') + 1,
               *of_glsl = strchr(strstr(output, "sh_scaling["), '(') + 1;
    const size_t length = strcspn(of_c, "}");
    assert_int_equal(strcspn(of_glsl, ")"), length);
    assert_memory_equal(of_c, of_glsl, length);
    assert_non_null(strstr(output, "const float sh_scaling_k[2] = float[2](1.0, 2.0);"));
    assert_non_null(strstr(output, "void sh_scale(out float to[4], int row, float from[4])"));
    free(c);
}

static void wrong_input(void **state)
{
    (void)state;
    static const struct {
        const char *arguments, *says;
    } cases[] = {{"", "--map is missing"},
                 {"--map cone", "--k is missing"},
                 {"--map donut --k 1", "--map donut"},
                 {"--map cone --k abc", "'abc' is not a number"},
                 {"--map cone --k 1,,2", "expected numbers"},
                 {"--map cone --k inf", "not a number"},
                 {"--map cone --k -1", "k = -1"},
                 {"--map cone --k 1:2", "FROM:TO:COUNT"},
                 {"--map cone --k 1:2:3:4", "FROM:TO:COUNT"},
                 {"--map cone --k 2:1:5", "FROM below TO"},
                 {"--map cone --k 0:1:5", "above 0"},
                 {"--map cone --k 1:2:1e9", "count from 2 to 1000"},
                 {"--map cone --k 1 --alpha 85", "10 to 80"},
                 {"--map midrange --k 0.5 --alpha 45", "--alpha goes with --map cone"},
                 {"--map midrange --k 1", "inside the sphere"},
                 {"--map midrange --k 0.5 --measure light", "visibility or energy"},
                 {"--map sphere --k 2 --measure energy", "occlusion"},
                 {"--map cone --k 2 --measure power", "--measure power"},
                 {"--map cone --k 2 --order 9", "1 to 8"},
                 {"--map cone --k 2 --order 2.5", "whole number"},
                 {"--map cone --k 2 --in-order 0", "1 to 8"},
                 {"--map cone --k 2 --order 3 --measure regressed", "order 4"},
                 {"--map cone --k 2 --format xml", "--format xml"},
                 {"--map cone --k 2 extra", "unexpected argument"}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        char arguments[200];
        snprintf(arguments, sizeof arguments, "sh-table %s", cases[i].arguments);
        const int code = run(arguments);
        if (code != 2 || !strstr(complaint, cases[i].says) || strchr(complaint, '\n')[1] || output[0])
            fail_msg("%s: exit code %d, said '%s'", arguments, code, complaint);
    }
    assert_int_equal(run("sh-table --help"), 0);
    assert_non_null(strstr(output, "k,m,l_out,l_in,value"));
}

static int tear_down(void **state)
{
    (void)state;
    forget_runs();
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(csv_rows),
        cmocka_unit_test(c_compiles_and_scales),
        cmocka_unit_test(glsl_numbers),
        cmocka_unit_test(wrong_input),
    };
    return cmocka_run_group_tests(tests, NULL, tear_down);
}

// Ctrl-C at any moment of a rendering: each file is the earlier one or the new one, byte for byte, and nothing else is
// left.
#include "base/file.h"
#include "base/progress.h"
#include "base/random.h"
#include "check.h"
#include <dirent.h>
#include <fcntl.h>
#include <signal.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

enum { FILES = 3, VERSIONS = 2, TRIALS = 16 };
static const char *const names[FILES] = {"picture.exr", "picture.png", "mesh.ply"};

static void save_scene(const char *path, double flux)
{
    FILE *file = fopen(path, "w");
    assert_non_null(file);
    fprintf(file,
            "{\"format\":1,\"objects\":[{\"mesh\":\"ball.obj\",\"material\":\"wall\"}],\"materials\":{\"wall\":"
            "{\"reflectance\":[0.5,0.6,0.7]}},\"lights\":[{\"kind\":\"point\",\"position_mm\":[9,9,9],\"flux\":"
            "[%g,1,1]}],\"camera\":{\"position_mm\":[5,5,5],\"look_at_mm\":[0,0,0],\"up\":[0,0,1],"
            "\"vertical_field_deg\":30,\"width\":400,\"height\":300},\"rays_per_patch\":256,\"memory_mb\":1}",
            flux);
    fclose(file);
}

// A ball of 2 (RINGS - 1) SIDES faces.
static void save_mesh(const char *path)
{
    enum { RINGS = 16, SIDES = 32 };
    FILE *file = fopen(path, "w");
    assert_non_null(file);
    fprintf(file, "v 0 0 1\nv 0 0 -1\n");
    for (int i = 1; i < RINGS; i++)
        for (int k = 0; k < SIDES; k++) {
            const double tilt = M_PI * i / RINGS, turn = 2 * M_PI * k / SIDES;
            fprintf(file, "v %.6f %.6f %.6f\n", sin(tilt) * cos(turn), sin(tilt) * sin(turn), cos(tilt));
        }
    for (int k = 0; k < SIDES; k++) {
        const int next = (k + 1) % SIDES, last = 3 + (RINGS - 2) * SIDES;
        fprintf(file, "f 1 %d %d\nf 2 %d %d\n", 3 + k, 3 + next, last + next, last + k);
        for (int i = 0; i + 2 < RINGS; i++) {
            const int ring = 3 + i * SIDES;
            fprintf(file, "f %d %d %d %d\n", ring + k, ring + SIDES + k, ring + SIDES + next, ring + next);
        }
    }
    fclose(file);
}

static pid_t start(int version)
{
    const pid_t child = fork();
    assert_true(child >= 0);
    if (child)
        return child;
    const int nowhere = open("/dev/null", O_WRONLY);
    dup2(nowhere, STDOUT_FILENO);
    dup2(nowhere, STDERR_FILENO);
    setenv("TMPDIR", "interrupt/temporary", 1);
    execl(ALB_PROGRAM, "alabaster", "render", version ? "interrupt/1.json" : "interrupt/0.json", "-o",
          "interrupt/out/picture.exr", "--mesh", "interrupt/out/mesh.ply", (char *)NULL);
    _exit(127);
}

static int entries(const char *path)
{
    int count = 0;
    DIR *folder = opendir(path);
    assert_non_null(folder);
    while (readdir(folder))
        count++;
    closedir(folder);
    return count - 2; // . and ..
}

static void hash(char out[FILES][ALB_HASH_SIZE])
{
    for (int i = 0; i < FILES; i++) {
        alb_error error = {0};
        char path[64];
        snprintf(path, sizeof path, "interrupt/out/%s", names[i]);
        check_ok(alb_hash_file(out[i], path, &error), &error);
    }
}

// Any moment; each second time one at which a file is under way.
static void wait_for_moment(int trial, double seconds)
{
    alb_random random = alb_random_at(61, 0, (uint64_t)trial);
    const double moment = seconds * alb_random_uniform(&random), start_s = alb_clock_s();
    if (trial / 2 % 2)
        usleep((useconds_t)(1e6 * moment));
    while (trial / 2 % 2 == 0 && entries("interrupt/out") == FILES && alb_clock_s() - start_s < 20 * seconds)
        usleep(200);
}

static void every_file_is_old_or_new(void **state)
{
    (void)state;
    char whole[VERSIONS][FILES][ALB_HASH_SIZE], found[FILES][ALB_HASH_SIZE];
    int status, interrupted = 0;
    double seconds = 0;
    assert_int_equal(system("rm -rf interrupt"), 0);
    mkdir("interrupt", 0777), mkdir("interrupt/out", 0777), mkdir("interrupt/temporary", 0777);
    save_mesh("interrupt/ball.obj");
    save_scene("interrupt/0.json", 1);
    save_scene("interrupt/1.json", 2);
    for (int version = 0; version < VERSIONS; version++) {
        const double start_s = alb_clock_s();
        assert_int_equal(waitpid(start(version), &status, 0) > 0 && WIFEXITED(status) && WEXITSTATUS(status) == 0, 1);
        seconds = alb_clock_s() - start_s;
        hash(whole[version]);
    }
    for (int i = 0; i < FILES; i++)
        assert_string_not_equal(whole[0][i], whole[1][i]);
    for (int trial = 0; trial < TRIALS; trial++) {
        const pid_t child = start(trial % VERSIONS);
        wait_for_moment(trial, seconds);
        kill(child, SIGINT);
        assert_true(waitpid(child, &status, 0) == child);
        assert_true((WIFSIGNALED(status) && WTERMSIG(status) == SIGINT) ||
                    (WIFEXITED(status) && WEXITSTATUS(status) == 0)); // too late
        interrupted += WIFSIGNALED(status);
        hash(found);
        for (int i = 0; i < FILES; i++)
            assert_true(!strcmp(found[i], whole[0][i]) || !strcmp(found[i], whole[1][i]));
        assert_int_equal(entries("interrupt/out"), FILES);
        assert_int_equal(entries("interrupt/temporary"), 0);
    }
    assert_true(interrupted >= TRIALS / 4);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(every_file_is_old_or_new)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}

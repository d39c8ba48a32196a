// Absorption and scattering from the images of both sides, against photons. More slabs, more trials and the figures of
// docs/transport_images.svg: tests/bench/bench_transport_images.c.
#include "base/statistics.h"
#include "check.h"
#include "slab_rings.h"
#include <string.h>

enum { TRIALS = 16, MARBLE = 0, MILK = 1, ISOTROPIC = 2, WAX = 2, SLABS = 3 };
static const double noise = 0.01, scale_sd = 0.02;
static slab_rings slabs[SLABS];

static int prepare(void **state)
{
    (void)state;
    static const alb_slab made[SLABS] = {
        {0.0041, 2.62, 0, 1.5, 7.6}, {0.0014, 0.70, 0, 1.33, 17.2}, {0.012, 3, 0.5, 1.45, 5}};
    static const long photons[SLABS] = {1200000, 1200000, 500000};
    alb_error error = {0};
    for (int i = 0; i < SLABS; i++)
        check_ok(slab_rings_create(&slabs[i], &made[i], photons[i], &error), &error);
    return 0;
}

static int drop(void **state)
{
    (void)state;
    for (int i = 0; i < SLABS; i++)
        slab_rings_free(&slabs[i]);
    return 0;
}

static double truth(const slab_rings *rings, int parameter)
{
    return parameter == ALB_JOINT_ABSORPTION ? rings->slab.absorption_per_mm
                                             : rings->slab.scattering_per_mm * (1 - rings->slab.anisotropy);
}

static double found(const alb_joint *joint, int parameter)
{
    return parameter == ALB_JOINT_ABSORPTION ? joint->absorption_per_mm : joint->reduced_scattering_per_mm;
}

static void fit(alb_joint *joint, const slab_rings *rings, double scale, uint64_t trial, bool one_side)
{
    alb_error error = {0};
    check_ok(slab_rings_fit(joint, rings, noise, scale, scale_sd, trial, one_side, &error), &error);
}

// The mean over the trials is off by the photons' own noise, which is within the sd (4 of them); about that mean the
// estimates scatter as the noise of the photographs alone lets them: within the bound, which has the photons' noise
// too.
static void recovers_what_scattered_the_photons(void **state)
{
    (void)state;
    for (int s = 0; s < ISOTROPIC; s++) {
        static alb_joint joints[TRIALS];
        bool ok[TRIALS];
#pragma omp parallel for schedule(dynamic)
        for (int t = 0; t < TRIALS; t++) {
            alb_random random = alb_random_at(5, (uint64_t)s, (uint64_t)t);
            ok[t] = slab_rings_fit(&joints[t], &slabs[s], noise, exp(scale_sd * alb_random_normal(&random)), scale_sd,
                                   (uint64_t)t, false, NULL);
        }
        double chi_square = 0;
        for (int parameter = 0; parameter < ALB_JOINT_ANISOTROPY; parameter++) {
            double sum = 0, squares = 0;
            for (int t = 0; t < TRIALS; t++) {
                assert_true(ok[t]);
                const double off = log(found(&joints[t], parameter) / truth(&slabs[s], parameter));
                sum += off / TRIALS, squares += off * off / TRIALS;
            }
            const double bound = joints[0].relative_bound[parameter];
            print_message("slab %d, %s: bias %+.2f %%, rmse %.2f %%, bound %.2f %%\n", s,
                          parameter ? "scattering" : "absorption", 100 * sum, 100 * sqrt(squares), 100 * bound);
            check_below(fabs(sum), 4 * bound);
            // chi-square of TRIALS - 1 degrees of freedom: 1e-4 tail
            assert_true(alb_chi_square_tail((squares - sum * sum) * TRIALS / (bound * bound), TRIALS - 1) > 1e-4);
        }
        for (int t = 0; t < TRIALS; t++)
            chi_square += joints[t].chi_square / joints[t].degrees_of_freedom / TRIALS;
        check_near(chi_square, 1, 0.4); // what the photons' noise adds or takes is the same in all trials
    }
}

// Both images brighter by 1 %: the scale takes it up, and the interval covers the truth. Known to 1e-4, the same images
// give another absorption, further off than the sd that is then said.
static void scale_error(void **state)
{
    (void)state;
    const slab_rings *rings = &slabs[MARBLE];
    alb_joint as_is, brighter, trusting, trusted;
    alb_error error = {0};
    fit(&as_is, rings, 1, 3, false);
    fit(&brighter, rings, 1.01, 3, false);
    check_near(brighter.scale / as_is.scale, 1.01, 0.002); // the prior, 2 %, draws a little
    for (int p = 0; p < ALB_JOINT_ANISOTROPY; p++)
        check_below(fabs(log(found(&brighter, p) / truth(rings, p))), 4 * brighter.relative_sd[p]);
    check_ok(slab_rings_fit(&trusted, rings, noise, 1, 1e-4, 3, false, &error), &error);
    check_ok(slab_rings_fit(&trusting, rings, noise, 1.01, 1e-4, 3, false, &error), &error);
    check_below(trusting.relative_bound[0], brighter.relative_bound[0]);
    const double moved = fabs(log(trusting.absorption_per_mm / trusted.absorption_per_mm));
    check_below(2 * trusting.relative_bound[0], moved);
    check_below(10 * fabs(log(brighter.absorption_per_mm / as_is.absorption_per_mm)), moved);
}

static void reflection_alone_knows_less(void **state)
{
    (void)state;
    for (int s = 0; s < ISOTROPIC; s++) {
        alb_joint both, one;
        fit(&both, &slabs[s], 1, 1, false);
        fit(&one, &slabs[s], 1, 1, true);
        assert_int_equal(one.used[ALB_TRANSMISSION], 0);
        check_below(both.relative_bound[0], one.relative_bound[0]);
        for (int p = 0; p < ALB_JOINT_ANISOTROPY; p++)
            check_below(fabs(log(found(&one, p) / truth(&slabs[s], p))), 4 * one.relative_sd[p]);
    }
}

// Forward scattering taken for isotropic is noticed; left open, it is found. 4 sd.
static void anisotropy_is_found(void **state)
{
    (void)state;
    const slab_rings *rings = &slabs[WAX];
    alb_readings readings[ALB_SIDES] = {{0}};
    alb_error error = {0};
    alb_joint held, open;
    check_ok(slab_rings_photograph(readings, rings, noise, 1, 0, &error), &error);
    const alb_joint_side both[ALB_SIDES] = {{&readings[0], &rings->forward[0]}, {&readings[1], &rings->forward[1]}};
    alb_joint_known known = {rings->slab.thickness_mm, rings->slab.refractive_index, 0, 0, scale_sd, 0};
    check_ok(alb_joint_fit(&held, both, &known, &error), &error);
    known.anisotropy_sd = 0.5;
    check_ok(alb_joint_fit(&open, both, &known, &error), &error);
    print_message("g %.3f +- %.3f, chi-square %.1f / %d; held at 0: %.1f\n", open.anisotropy,
                  open.relative_sd[ALB_JOINT_ANISOTROPY], open.chi_square, open.degrees_of_freedom, held.chi_square);
    check_near(open.anisotropy, 0.5, 4 * open.relative_sd[ALB_JOINT_ANISOTROPY]);
    check_below(open.relative_sd[ALB_JOINT_ANISOTROPY], 0.2);
    for (int p = 0; p < ALB_JOINT_ANISOTROPY; p++)
        check_below(fabs(log(found(&open, p) / truth(rings, p))), 4 * open.relative_sd[p]);
    assert_true(alb_chi_square_tail(open.chi_square, open.degrees_of_freedom) > 1e-4);
    assert_true(alb_chi_square_tail(held.chi_square - open.chi_square, 1) < 1e-6);
    alb_readings_free(&readings[0]);
    alb_readings_free(&readings[1]);
}

// Readings that scatter by 10 % more than their sd say: seen as such, and the sd that are said hold (4 of them).
static void scatter_beyond_the_noise_widens(void **state)
{
    (void)state;
    const slab_rings *rings = &slabs[WAX];
    const alb_joint_known known = {rings->slab.thickness_mm, rings->slab.refractive_index, 0.5, 0, scale_sd, 0};
    const double scatter = 0.1;
    alb_error error = {0};
    for (uint64_t trial = 0; trial < 4; trial++) {
        alb_readings readings[ALB_SIDES] = {{0}};
        alb_random random = alb_random_at(78, 0, trial);
        alb_joint joint;
        check_ok(slab_rings_photograph(readings, rings, 0.003, 1, trial, &error), &error);
        for (int side = 0; side < ALB_SIDES; side++)
            for (int k = 0; k < readings[side].count; k++)
                readings[side].value[k] *= 1 + scatter * alb_random_normal(&random);
        const alb_joint_side both[ALB_SIDES] = {{&readings[0], &rings->forward[0]}, {&readings[1], &rings->forward[1]}};
        check_ok(alb_joint_fit(&joint, both, &known, &error), &error);
        assert_string_equal(joint.undecided, "");
        // chi-square's own scatter, 4 sd
        check_near(joint.discrepancy_relative, scatter, 4 * scatter / sqrt(2 * joint.degrees_of_freedom));
        for (int p = 0; p < ALB_JOINT_ANISOTROPY; p++) {
            check_below(fabs(log(found(&joint, p) / truth(rings, p))), 4 * joint.relative_sd[p]);
            check_below(joint.relative_sd[p], 0.3);
        }
        alb_readings_free(&readings[0]);
        alb_readings_free(&readings[1]);
    }
}

// A slab said to be half as thick again, and a transmission of twice its scale: no answer, and the figures of why.
static void another_slab_is_refused(void **state)
{
    (void)state;
    const slab_rings *rings = &slabs[WAX];
    alb_error error = {0};
    for (int wrong = 0; wrong < 2; wrong++) {
        alb_joint_known known = {rings->slab.thickness_mm, rings->slab.refractive_index, 0.5, 0.5, scale_sd, 0};
        alb_readings readings[ALB_SIDES] = {{0}};
        alb_joint joint;
        check_ok(slab_rings_photograph(readings, rings, 0.003, 1, 1, &error), &error);
        known.thickness_mm *= wrong == 0 ? 1.5 : 1;
        for (int k = 0; k < readings[ALB_TRANSMISSION].count; k++)
            readings[ALB_TRANSMISSION].value[k] *= wrong == 1 ? 2 : 1;
        const alb_joint_side both[ALB_SIDES] = {{&readings[0], &rings->forward[0]}, {&readings[1], &rings->forward[1]}};
        check_ok(alb_joint_fit(&joint, both, &known, &error), &error);
        print_message("%s\n", joint.undecided);
        assert_non_null(strstr(joint.undecided, "neighbours miss them alike"));
        assert_non_null(strstr(joint.undecided, "chi-square"));
        alb_readings_free(&readings[0]);
        alb_readings_free(&readings[1]);
    }
}

static void any_number_of_threads_gives_the_same_bytes(void **state)
{
    (void)state;
    alb_joint outside, inside[2];
    fit(&outside, &slabs[MILK], 1, 1, false);
#pragma omp parallel for
    for (int i = 0; i < 2; i++)
        slab_rings_fit(&inside[i], &slabs[MILK], noise, 1, scale_sd, 1, false, NULL);
    for (int i = 0; i < 2; i++)
        assert_memory_equal(&inside[i], &outside, sizeof outside);
}

static void refuses_what_does_not_decide(void **state)
{
    (void)state;
    alb_error error = {0};
    alb_joint joint;
    const slab_rings *rings = &slabs[MARBLE];
    alb_readings readings[ALB_SIDES] = {{0}};
    check_ok(slab_rings_photograph(readings, rings, noise, 1, 0, &error), &error);
    alb_joint_known known = {rings->slab.thickness_mm, 1.5, 0, 0, scale_sd, 0};
    const alb_joint_side transmission[ALB_SIDES] = {{0}, {&readings[1], &rings->forward[1]}};
    check_fails(alb_joint_fit(&joint, transmission, &known, &error), &error, ALB_UNDECIDED, "transmission alone");
    const alb_joint_side both[ALB_SIDES] = {{&readings[0], &rings->forward[0]}, {&readings[1], &rings->forward[1]}};
    known.thickness_mm = 0;
    check_fails(alb_joint_fit(&joint, both, &known, &error), &error, ALB_BAD_DATA, "thickness");
    known = (alb_joint_known){rings->slab.thickness_mm, NAN, 0, 0, scale_sd, 0};
    check_fails(alb_joint_fit(&joint, both, &known, &error), &error, ALB_BAD_DATA, "index");
    known.refractive_index = 1.5;
    for (int side = 0; side < ALB_SIDES; side++)
        for (int k = 0; k < readings[side].count; k++)
            readings[side].value[k] = k % 3 ? (double)NAN : (double)INFINITY;
    check_fails(alb_joint_fit(&joint, both, &known, &error), &error, ALB_UNDECIDED, "0 readings");
    for (int side = 0; side < ALB_SIDES; side++) // nothing of light in it: an answer, or none, but no crash
        for (int k = 0; k < readings[side].count; k++)
            readings[side].value[k] = k % 2 ? -1e30 : 1e-30;
    if (!alb_joint_fit(&joint, both, &known, &error))
        assert_true(error.text[0]);
    alb_readings_free(&readings[0]);
    alb_readings_free(&readings[1]);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(recovers_what_scattered_the_photons),
                                       cmocka_unit_test(scale_error),
                                       cmocka_unit_test(reflection_alone_knows_less),
                                       cmocka_unit_test(anisotropy_is_found),
                                       cmocka_unit_test(scatter_beyond_the_noise_widens),
                                       cmocka_unit_test(another_slab_is_refused),
                                       cmocka_unit_test(any_number_of_threads_gives_the_same_bytes),
                                       cmocka_unit_test(refuses_what_does_not_decide)};
    return cmocka_run_group_tests(tests, prepare, drop);
}

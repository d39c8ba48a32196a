// Optical properties of a fitted slab: what they are made from, and their part of material.json written and read back.
#include "base/random.h"
#include "check.h"
#include "discrete_ordinates.h"
#include "fit/properties.h"

// A slab whose two sides were fitted with these totals.
static alb_material slab(double reflection, double transmission, double relative_sd)
{
    alb_material material = {.thickness_mm = 5, .refractive_index = 1.5, .channels = 1, .channel_names = {"G"}};
    for (int side = 0; side < ALB_SIDES; side++) {
        alb_fitted *fitted = &material.fitted[side][0];
        *fitted = (alb_fitted){.profile = {ALB_FORM_EXPONENTIAL, {1, 1}}, .identifiable = true};
        fitted->total = side ? transmission : reflection;
        fitted->total_sd = relative_sd * fitted->total;
    }
    return material;
}

static alb_material marble(double relative_sd)
{
    const alb_medium medium = {0.0041, 2.62, 0, 1.5, 5};
    double totals[2];
    discrete_ordinates(totals, &medium);
    return slab(totals[0], totals[1], relative_sd);
}

static void values_and_their_price(void **state)
{
    (void)state;
    const alb_material material = marble(0.01);
    const alb_properties_basis basis = {0};
    alb_properties p[3];
    alb_properties_find(p, &material, &basis);
    assert_true(p[0].known && !p[1].known && !*p[1].refused);
    check_relative(p[0].optical.absorption_per_mm, 0.0041, 0.001);
    check_relative(p[0].optical.reduced_scattering_per_mm, 2.62, 0.001);
    assert_true(p[0].other_anisotropy == 0.9);
    check_relative(p[0].other[1], 2.62, 0.02); // 13 mean free paths: similarity holds
    assert_true(p[0].other[1] != p[0].optical.reduced_scattering_per_mm);
    alb_text notes = {0};
    alb_properties_note(&notes, "G", &p[0]);
    assert_non_null(strstr(notes.bytes, "G: absorption 0.0041 +- "));
    assert_non_null(strstr(notes.bytes, "1 % of thickness by -1 and -1 %"));
    alb_text_free(&notes);
}

// An error of 1 % that both sides share moves the absorption by (R + T), one that each has of its own by
// hypot(R, T): the ratio of the sds, as both are all there is.
static void shared_and_own_errors(void **state)
{
    (void)state;
    const alb_material material = marble(0.01);
    alb_properties_basis shared = {.common_sd = {{0.01}, {0.01}}}, own = shared;
    own.own_sd[0][0] = own.own_sd[1][0] = 0.01;
    alb_properties p[2][3];
    alb_properties_find(p[0], &material, &shared);
    alb_properties_find(p[1], &material, &own);
    const double R = material.fitted[0][0].total, T = material.fitted[1][0].total;
    check_relative(p[0][0].optical.absorption_sd / p[1][0].optical.absorption_sd, (R + T) / hypot(R, T),
                   0.02); // the ratio T / R, which also moves it a little
    assert_true(p[0][0].optical.reduced_scattering_sd < p[1][0].optical.reduced_scattering_sd);
}

static void reasons_not_to(void **state)
{
    (void)state;
    alb_material material = marble(0.01), bright = slab(0.8, 0.3, 0.001), bare = material;
    const alb_properties_basis smooth = {0}, ground = {.finish = ALB_FINISH_GROUND};
    alb_properties p[3];
    alb_properties_find(p, &material, &ground);
    assert_true(!p[0].known && strstr(p[0].refused, "ground"));
    alb_properties_find(p, &bright, &smooth);
    assert_true(!p[0].known && strstr(p[0].refused, "white reference"));
    material.fitted[0][0].identifiable = false;
    alb_properties_find(p, &material, &smooth);
    assert_true(!p[0].known && strstr(p[0].refused, "do not decide"));
    bare.thickness_mm = 0;
    alb_properties_find(p, &bare, &smooth);
    assert_true(!p[0].known && !*p[0].refused);
}

static bool round_trip(alb_optical_estimate *out, const alb_properties *p, alb_error *error)
{
    alb_json json;
    alb_json_begin(&json, NULL);
    alb_properties_put(&json, p);
    if (!alb_json_write(&json, "properties.json.tmp", error))
        return false;
    alb_record *record = alb_record_read("properties.json.tmp", error);
    alb_node root;
    const bool ok = record && alb_record_root(&root, record, error) && alb_properties_read(out, root, error);
    alb_record_free(record);
    remove("properties.json.tmp");
    return ok;
}

// Reflection alone: the ratio, and no other number.
static void one_side_only(void **state)
{
    (void)state;
    alb_error error = {0};
    alb_material material = marble(0.01);
    const alb_medium deep = {0.0041, 2.62, 0, 1.5, 200};
    double totals[2];
    discrete_ordinates(totals, &deep);
    material.fitted[0][0].total = totals[0];
    material.fitted[1][0] = (alb_fitted){0};
    const alb_properties_basis basis = {0};
    alb_properties p[3];
    alb_optical_estimate read;
    alb_properties_find(p, &material, &basis);
    assert_true(p[0].known && p[0].half_space);
    check_relative(1 - p[0].optical.reduced_albedo, 0.0041 / 2.6241, 0.005);
    check_ok(round_trip(&read, &p[0], &error), &error);
    assert_false(read.known);
    alb_text notes = {0};
    alb_properties_note(&notes, "G", &p[0]);
    assert_non_null(strstr(notes.bytes, "want both sides"));
    alb_text_free(&notes);
}

static void written_and_read(void **state)
{
    (void)state;
    alb_error error = {0};
    alb_material material = marble(0.01);
    const alb_properties_basis smooth = {0}, ground = {.finish = ALB_FINISH_GROUND};
    alb_properties p[3];
    alb_optical_estimate read;
    alb_properties_find(p, &material, &smooth);
    check_ok(round_trip(&read, &p[0], &error), &error);
    assert_true(read.known && read.absorption_per_mm == p[0].optical.absorption_per_mm &&
                read.reduced_scattering_per_mm == p[0].optical.reduced_scattering_per_mm);
    check_ok(round_trip(&read, &p[1], &error), &error); // not tried: nothing is written
    assert_false(read.known);
    p[0].optical.absorption_per_mm = -1;
    check_fails(round_trip(&read, &p[0], &error), &error, ALB_BAD_DATA, "absorption_per_mm");
    alb_properties_find(p, &material, &ground);
    check_ok(round_trip(&read, &p[0], &error), &error);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(values_and_their_price), cmocka_unit_test(shared_and_own_errors),
        cmocka_unit_test(reasons_not_to),         cmocka_unit_test(written_and_read),
        cmocka_unit_test(one_side_only),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

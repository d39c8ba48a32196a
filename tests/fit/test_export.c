// What renderers are told: files are read back as those programs do, their documented profile or medium computed from
// what was read (by formulas of this file's own), and held against what went in.
#include "base/random.h"
#include "check.h"
#include "fit/export.h"
#include "well_formed.h"

enum { MATERIALS = 60 };
// Numbers are printed with nine digits; the goal for a round trip is 1e-3.
static const double digits = 1e-7;

// A random three-channel material of absolute scale: sums of exponentials and dipoles of random length and total.
static alb_material random_material(unsigned index)
{
    alb_random random = alb_random_at(5, 0, index);
    alb_material material = {
        .name = "random wax", .channels = 3, .refractive_index = 1 + 0.6 * alb_random_uniform(&random)};
    static const char *const names[3] = {"R", "G", "B"};
    for (int c = 0; c < 3; c++) {
        alb_fitted *fitted = &material.fitted[ALB_REFLECTION][c];
        snprintf(material.channel_names[c], sizeof material.channel_names[c], "%s", names[c]);
        static const alb_form forms[] = {ALB_FORM_EXPONENTIAL, ALB_FORM_TWO_EXPONENTIALS, ALB_FORM_THREE_EXPONENTIALS};
        double b = exp(6 * alb_random_uniform(&random) - 3), *p = fitted->profile.parameters;
        fitted->profile.form = forms[index % 3];
        for (int t = 0; t < 3; t++, b *= 1.5 + 2 * alb_random_uniform(&random)) {
            p[2 * t] = b * b * (0.1 + alb_random_uniform(&random));
            p[2 * t + 1] = b;
        }
        const double scale = (0.02 + 0.97 * alb_random_uniform(&random)) / alb_profile_total(&fitted->profile);
        for (int t = 0; t < 3; t++)
            p[2 * t] *= scale;
        fitted->total = alb_profile_total(&fitted->profile);
        fitted->identifiable = true;
    }
    return material;
}

static char *exported(alb_export *export, const char *format, const alb_material *material, double unit_mm)
{
    alb_error error = {0};
    alb_text text = {0};
    const alb_exporter *exporter = alb_exporter_find(format);
    check_ok(alb_export_prepare(export, exporter, material, ALB_SOURCE_FOLDER "/README.md", unit_mm, &error), &error);
    exporter->put(&text, export);
    assert_false(text.failed);
    return text.bytes;
}

// Numbers behind the first place that holds `key`.
static void numbers_behind(double *out, int count, const char *text, const char *key)
{
    const char *at = strstr(text, key);
    assert_non_null(at);
    at += strlen(key);
    for (int i = 0; i < count; i++) {
        char *end;
        at += strcspn(at, "0123456789-");
        out[i] = strtod(at, &end);
        assert_true(end > at);
        at = end;
    }
}

static double burley(double albedo, double d, double r)
{
    return albedo / (8 * M_PI * d) * (exp(-r / d) + exp(-r / (3 * d))) / r;
}

// Against the Burley profile that the appearance holds, at distances from 0.01 d to 15 d.
static void check_burley(double albedo, double d_mm, alb_burley expected)
{
    for (double r = 0.01 * d_mm; r < 15 * d_mm; r *= 1.3)
        check_relative(burley(albedo, d_mm, r), burley(expected.albedo, expected.length_mm, r),
                       100 * digits); // 15 d: e^-15 of the error
}

// As Blender's bssrdf.h does: mean free path radius / (4 pi), divided by s(A) of diffuse entry.
static void check_cycles(const alb_material *material, double unit_mm)
{
    alb_export export;
    char *text = exported(&export, "cycles", material, unit_mm);
    double colour[3], radius[3];
    numbers_behind(colour, 3, text, "base_color = (");
    numbers_behind(radius, 3, text, "subsurface_radius = (");
    for (int c = 0; c < 3; c++) {
        const double mean_free_path = 0.25 / M_PI * radius[c] * unit_mm;
        const double s = 1.9 - colour[c] + 3.5 * pow(colour[c] - 0.8, 2);
        check_burley(colour[c], mean_free_path / s, export.appearance.channel[c].burley);
    }
    free(text);
}

// Arnold: the colour is the albedo seen, the radius the mean free path of a beam's profile.
static void check_arnold(const alb_material *material, double unit_mm)
{
    alb_export export;
    char *text = exported(&export, "arnold", material, unit_mm);
    double colour[3], radius[3];
    numbers_behind(colour, 3, text, "subsurface_color");
    numbers_behind(radius, 3, text, "subsurface_radius");
    for (int c = 0; c < 3; c++) {
        const double s = 1.85 - colour[c] + 7 * pow(fabs(colour[c] - 0.8), 3);
        check_burley(colour[c], radius[c] * unit_mm / s, export.appearance.channel[c].burley);
    }
    free(text);
}

// Absorption and scattering per mm, as the three programs that want a medium would use them.
static void read_media(double absorption[3][3], double scattering[3][3], const alb_material *material, double unit_mm)
{
    alb_export export;
    double a[3], b[3], scale;
    char *text = exported(&export, "pbrt", material, unit_mm);
    numbers_behind(a, 3, text, "\"rgb sigma_a\" [");
    numbers_behind(b, 3, text, "\"rgb sigma_s\" [");
    numbers_behind(&scale, 1, text, "\"float scale\"");
    for (int c = 0; c < 3; c++)
        absorption[0][c] = a[c] * scale / unit_mm, scattering[0][c] = b[c] * scale / unit_mm;
    free(text);
    text = exported(&export, "mitsuba", material, unit_mm);
    assert_true(well_formed(text));
    numbers_behind(a, 3, text, "name=\"sigma_t\"");
    numbers_behind(b, 3, text, "name=\"albedo\"");
    numbers_behind(&scale, 1, text, "name=\"scale\"");
    for (int c = 0; c < 3; c++)
        absorption[1][c] = a[c] * (1 - b[c]) * scale / unit_mm, scattering[1][c] = a[c] * b[c] * scale / unit_mm;
    free(text);
    text = exported(&export, "openpbr", material, unit_mm);
    assert_true(well_formed(text));
    numbers_behind(a, 3, text, "name=\"subsurface_color\" type=\"color3\" value=");
    numbers_behind(b, 3, text, "name=\"subsurface_radius_scale\" type=\"color3\" value=");
    numbers_behind(&scale, 1, text, "name=\"subsurface_radius\" type=\"float\" value=");
    for (int c = 0; c < 3; c++) {
        assert_true(b[c] <= 1);
        const double s = 4.09712 + 4.20863 * a[c] - sqrt(9.59217 + 41.6808 * a[c] + 17.7126 * a[c] * a[c]);
        const double extinction = 1 / (b[c] * scale * unit_mm);
        absorption[2][c] = s * s * extinction, scattering[2][c] = (1 - s * s) * extinction;
    }
    free(text);
}

static void round_trips_of_fits(void **state)
{
    (void)state;
    for (unsigned i = 0; i < MATERIALS; i++) {
        alb_error error = {0};
        alb_random random = alb_random_at(6, 0, i);
        const alb_material material = random_material(i);
        const double unit_mm = exp(8 * alb_random_uniform(&random) - 3);
        double absorption[3][3], scattering[3][3];
        alb_appearance appearance;
        check_ok(alb_appearance_derive(&appearance, &material, &error), &error);
        check_cycles(&material, unit_mm);
        check_arnold(&material, unit_mm);
        read_media(absorption, scattering, &material, unit_mm);
        for (int k = 0; k < 3; k++)
            for (int c = 0; c < 3; c++) {
                // a half-space that reflects the total, with the mean free path of Burley's beam profile
                const double a = absorption[k][c], s = scattering[k][c], total = appearance.channel[c].burley.albedo;
                const alb_profile dipole = {ALB_FORM_DIPOLE, {a, s, appearance.refractive_index}};
                check_relative(alb_profile_total(&dipole), total, 1e-5); // albedos near 1 lose digits in 1 - albedo
                const double ratio = 1.85 - total + 7 * pow(fabs(total - 0.8), 3);
                check_relative(1 / (a + s) / ratio, appearance.channel[c].burley.length_mm, 1e-5);
            }
    }
}

// Burley's own profile comes back as itself, and what is known of the medium goes before what is inverted.
static void known_things_pass_through(void **state)
{
    (void)state;
    alb_error error = {0};
    alb_appearance appearance;
    alb_material material = {
        .channels = 1, .channel_names = {"Y"}, .refractive_index = 1.4, .optical = {{true, 0.01, 1.5}}};
    material.fitted[ALB_REFLECTION][0] =
        (alb_fitted){.profile = {ALB_FORM_BURLEY, {0.6, 2.5}}, .total = 0.6, .identifiable = true};
    check_ok(alb_appearance_derive(&appearance, &material, &error), &error);
    check_relative(appearance.channel[0].burley.length_mm, 2.5, 1e-7);
    check_near(appearance.channel[0].deviation_maximum, 0, 1e-6);
    assert_int_equal(appearance.channel[0].medium_source, ALB_MEDIUM_MEASURED);
    check_near(appearance.channel[0].reduced_scattering_per_mm, 1.5, 0);
    material.optical[0].known = false;
    check_ok(alb_appearance_derive(&appearance, &material, &error), &error);
    assert_int_equal(appearance.channel[0].medium_source, ALB_MEDIUM_INVERTED);
}

typedef struct medium {
    char name[64];
    double scattering[3], absorption[3];
} medium;

static int read_table(medium media[64])
{
    FILE *file = fopen(ALB_SHARED_DATA "/translucent/tables/jensen2001_narasimhan2006.csv", "r");
    char line[512];
    int count = 0;
    if (!file)
        return 0;
    while (fgets(line, sizeof line, file) && count < 64) {
        medium *m = &media[count];
        count += sscanf(line, "%63[^,],%lf,%lf,%lf,%lf,%lf,%lf", m->name, &m->scattering[0], &m->scattering[1],
                        &m->scattering[2], &m->absorption[0], &m->absorption[1], &m->absorption[2]) == 7;
    }
    fclose(file);
    return count;
}

// The published media (Jensen et al. 2001, Narasimhan et al. 2006) survive every format; those of low albedo carry a
// warning, and those alone.
static void published_media(void **state)
{
    (void)state;
    medium media[64];
    const int count = read_table(media);
    if (count == 0)
        skip();
    assert_int_equal(count, 47);
    int warned = 0;
    for (int i = 0; i < count; i++) {
        alb_material material = {.channels = 3, .channel_names = {"R", "G", "B"}};
        snprintf(material.name, sizeof material.name, "%.40s", media[i].name);
        for (int c = 0; c < 3; c++) {
            alb_fitted *fitted = &material.fitted[ALB_REFLECTION][c];
            fitted->profile = (alb_profile){ALB_FORM_DIPOLE, {media[i].absorption[c], media[i].scattering[c], 1.3}};
            fitted->total = alb_profile_total(&fitted->profile);
            fitted->identifiable = true;
        }
        double absorption[3][3], scattering[3][3];
        read_media(absorption, scattering, &material, 10);
        check_cycles(&material, 10);
        check_arnold(&material, 10);
        for (int k = 0; k < 3; k++)
            for (int c = 0; c < 3; c++) {
                if (k == 2 && media[i].scattering[c] < 1e-5 * media[i].absorption[c]) { // where OpenPBR's curve begins
                    assert_true(scattering[k][c] < 1e-5 * absorption[k][c]);
                    continue;
                }
                const alb_profile read = {ALB_FORM_DIPOLE, {absorption[k][c], scattering[k][c], 1.3}};
                for (double r = 0.1; r < 20; r *= 2)
                    check_relative(alb_profile_value(&read, r),
                                   alb_profile_value(&material.fitted[ALB_REFLECTION][c].profile, r), 1e-3);
            }
        alb_export export;
        char *text = exported(&export, "pbrt", &material, 1);
        int low = 0;
        for (int c = 0; c < 3; c++)
            low += media[i].scattering[c] < 0.8 * (media[i].scattering[c] + media[i].absorption[c]);
        assert_int_equal(occurrences(text, "below 0.8"), low);
        warned += low > 0;
        free(text);
        if (strncmp(media[i].name, "Chicken", 7) == 0)
            print_message("%s: copies of the table differ in its red absorption by a factor of 10\n", media[i].name);
    }
    print_message("published media: %d, of low albedo in a channel %d\n", count, warned);
}

// The length found is the best one, and what is said of its deviation is so: against a fine midpoint sum of this test's
// own over the light of one exponential, whose cumulative share is 1 - (1 + b r) e^(-b r).
static void deviation_is_what_is_said(void **state)
{
    (void)state;
    alb_error error = {0};
    const double b = 0.7, share = 0.4;
    alb_material material = {.channels = 1, .channel_names = {"Y"}};
    material.fitted[ALB_REFLECTION][0] = (alb_fitted){
        .profile = {ALB_FORM_EXPONENTIAL, {share * b * b / (2 * M_PI), b}}, .total = share, .identifiable = true};
    alb_appearance appearance;
    check_ok(alb_appearance_derive(&appearance, &material, &error), &error);
    double squares[3] = {0}, largest = 0;
    const double d = appearance.channel[0].burley.length_mm;
    double light = 0;
    for (double r = 0.0005; r < 40; r += 0.001) {
        const double cumulative = 1 - (1 + b * r) * exp(-b * r), s = share * b * b / (2 * M_PI) * exp(-b * r);
        if (cumulative < 0.05 || cumulative > 0.95)
            continue;
        for (int k = 0; k < 3; k++) {
            const double x = log(burley(share, d * (1 + 0.01 * (k - 1)), r) / s);
            squares[k] += 2 * M_PI * s * r * 0.001 * x * x;
            largest = k == 1 ? fmax(largest, fabs(x)) : largest;
        }
        light += 2 * M_PI * s * r * 0.001;
    }
    assert_true(squares[1] < squares[0] && squares[1] < squares[2]);
    check_relative(appearance.channel[0].deviation_rms, sqrt(squares[1] / light), 0.005); // 180 against 3000 points
    check_relative(appearance.channel[0].deviation_maximum, largest, 0.02);
    assert_true(appearance.index_assumed);
}

static void lengths_scale(void **state)
{
    (void)state;
    for (unsigned i = 0; i < 10; i++)
        for (double k = 1e-6; k < 1e7; k *= 1e4) {
            alb_error error = {0};
            alb_material material = random_material(i);
            alb_appearance mm, scaled;
            check_ok(alb_appearance_derive(&mm, &material, &error), &error);
            alb_material other = material;
            for (int t = 0; t < 3; t++) {
                other.fitted[ALB_REFLECTION][1].profile.parameters[2 * t] /= k * k;
                other.fitted[ALB_REFLECTION][1].profile.parameters[2 * t + 1] /= k;
            }
            check_ok(alb_appearance_derive(&scaled, &other, &error), &error);
            check_relative(scaled.channel[1].burley.length_mm, k * mm.channel[1].burley.length_mm, 1e-6);
            check_relative(scaled.channel[1].deviation_rms, mm.channel[1].deviation_rms, 1e-6);
        }
}

static void anchors(void **state)
{
    (void)state;
    check_near(sqrt(1 - alb_openpbr_albedo(0.5)), 0.297138, 5e-7); // fit of the curve, OpenPBR 1.1
    for (double albedo = 0; albedo <= 1; albedo += 0.0625) {
        check_near(alb_openpbr_albedo(alb_openpbr_colour(albedo)), albedo, 2e-5); // its own curve ends at 0.99999
        check_near(
            alb_albedo_invert(alb_profile_total(&(alb_profile){ALB_FORM_DIPOLE, {1 - albedo, albedo, 1.4}}), 1.4),
            albedo, 1e-9);
    }
    check_near(alb_chiang_albedo(1), 1 - exp(-6.80023), 1e-9);
}

static void refused(void **state)
{
    (void)state;
    alb_error error = {0};
    alb_export export;
    const char *path = ALB_SOURCE_FOLDER "/README.md";
    alb_material material = random_material(0);
    material.fitted[ALB_REFLECTION][1].total = 1.5;
    check_fails(alb_export_prepare(&export, alb_exporter_find("pbrt"), &material, path, 1, &error), &error,
                ALB_BAD_DATA, "channel G reflects 1.5");
    check_ok(alb_export_prepare(&export, alb_exporter_find("csv"), &material, path, 1, &error), &error);
    material.fitted[ALB_REFLECTION][1].profile.form = ALB_FORM_NONE;
    check_fails(alb_export_prepare(&export, alb_exporter_find("pbrt"), &material, path, 1, &error), &error,
                ALB_BAD_DATA, "no reflection");
    material.channels = 2;
    check_fails(alb_export_prepare(&export, alb_exporter_find("cycles"), &material, path, 1, &error), &error,
                ALB_BAD_DATA, "channels R and G");
    assert_null(alb_exporter_find("teapot"));
}

// A name can break neither a comment nor a quoted name.
static void hostile_names(void **state)
{
    (void)state;
    alb_material material = random_material(1);
    snprintf(material.name, sizeof material.name, "9\"-->\n'\\<a> \xc3\xa9");
    for (int i = 0; i < alb_exporter_count; i++) {
        alb_export export;
        char *text = exported(&export, alb_exporters[i].name, &material, 1);
        assert_string_equal(export.identifier, "_________a____");
        assert_null(strstr(text, material.name));
        free(text);
    }
}

// S and its sd at the printed distances: of one exponential var S = e^(-2 b r) (va - 2 a r c + a^2 r^2 vb).
static void curves(void **state)
{
    (void)state;
    const double a = 0.03, b = 0.4, va = 1e-6, vb = 1e-5, cab = 2e-6;
    alb_material material = {.channels = 1, .channel_names = {"Y"}};
    alb_fitted *fitted = &material.fitted[ALB_TRANSMISSION][0];
    *fitted = (alb_fitted){.profile = {ALB_FORM_EXPONENTIAL, {a, b}}, .identifiable = true};
    fitted->covariance[0][0] = va, fitted->covariance[1][1] = vb;
    fitted->covariance[0][1] = fitted->covariance[1][0] = cab;
    alb_export export;
    char *text = exported(&export, "csv", &material, 1);
    int rows = 0;
    double previous = -1, r, s, sd;
    for (const char *line = strchr(text, '\n') + 1; *line; line = strchr(line, '\n') + 1, rows++) {
        assert_int_equal(sscanf(line, "Y,%lf,,,%lf,%lf", &r, &s, &sd), 3);
        check_below(previous, r);
        previous = r;
        check_relative(s, a * exp(-b * r), 1e-7); // r has nine digits, b r is below 10
        check_relative(sd, exp(-b * r) * sqrt(va - 2 * a * r * cab + a * a * r * r * vb),
                       1e-3); // printed with 4 digits
    }
    assert_int_equal(rows, 200);
    check_relative(1 - (1 + b * r) * exp(-b * r), 0.999, 1e-6);
    free(text);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(round_trips_of_fits),
        cmocka_unit_test(known_things_pass_through),
        cmocka_unit_test(published_media),
        cmocka_unit_test(deviation_is_what_is_said),
        cmocka_unit_test(lengths_scale),
        cmocka_unit_test(anchors),
        cmocka_unit_test(refused),
        cmocka_unit_test(hostile_names),
        cmocka_unit_test(curves),
    };
    return cmocka_run_group_tests_name("export", tests, NULL, NULL);
}

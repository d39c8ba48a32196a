// Optical properties from totals. A slab has two readings and two unknowns (inversion.c), solved on few streams, then
// on many. A half-space has one reading and one unknown, sigma_a / sigma_s'.
//
// Errors are carried linearly: of R and T, their common scale, and thickness, which scales both by its inverse exactly.
// Stops being true: as adding_doubling.c; and a wrong scale moves sigma_a by many times as much (alb_optical.by_scale).
#include "fit/optical.h"
#include "fit/inversion.h"
#include <math.h>

static alb_totals by_transport(const void *model, double absorption, double scattering)
{
    return alb_adding_doubling(model, absorption, scattering, 1);
}

typedef struct diffusion_model {
    alb_diffusion_face face;
    double entry;
} diffusion_model;

static alb_totals by_diffusion(const void *model, double absorption, double scattering)
{
    const diffusion_model *m = model;
    const alb_diffusion slab = alb_diffusion_at(&m->face, absorption, scattering, 1);
    return (alb_totals){m->entry * alb_diffusion_total(NULL, &slab, ALB_REFLECTION),
                        m->entry * alb_diffusion_total(NULL, &slab, ALB_TRANSMISSION)};
}

static double entry_of(double n) { return 1 - (n - 1) * (n - 1) / ((n + 1) * (n + 1)); }

void alb_optical_model_create(alb_optical_model *model, int streams, double n, double g)
{
    alb_streams_create(&model->coarse, streams < 6 ? streams : 6, n, g);
    alb_streams_create(&model->fine, streams, n, g);
    model->face = alb_diffusion_face_at(ALB_DIFFUSION_GROSJEAN, n);
}

// Standard deviations and sensitivities at x, by the Jacobian of the few streams.
static bool propagate(alb_optical *out, const alb_transfer *coarse, const double solution[2],
                      const alb_measured_totals *measured)
{
    const double x[2] = {solution[0], fmax(solution[1], solution[0] - 14)}; // lossless: at the limit of little loss
    const alb_totals t = coarse->totals(coarse->model, exp(x[1]), exp(x[0]));
    const double lost = coarse->entry - t.reflection - t.transmission, d = measured->thickness_mm;
    const alb_wanted here = {.log_lost = log(lost), .log_ratio = log(t.transmission / t.reflection)};
    const double by_reading[3][2] = {{-1 / t.reflection, -1 / lost}, // of R, T and the scale
                                     {1 / t.transmission, -1 / lost},
                                     {0, -(t.reflection + t.transmission) / lost}};
    const double sd[3] = {measured->reflection_sd, measured->transmission_sd, measured->scale_sd};
    const double zero[2] = {0, 0}, scale[2] = {exp(x[1]) / d, exp(x[0]) / d};
    double j[2][2], covariance[2][2] = {{0}};
    if (!alb_slab_jacobian(j, coarse, &here, x, zero))
        return false;
    for (int k = 0; k < 4; k++) {
        double step[2] = {-1, -1}, of[2], size = measured->thickness_sd_mm / d; // thickness
        const double minus[2] = {k < 3 ? -by_reading[k][0] : 0, k < 3 ? -by_reading[k][1] : 0};
        if (k < 3) {
            size = sd[k];
            if (!alb_slab_step(step, j, minus, HUGE_VAL))
                return false;
        }
        if (k == 2)
            out->by_scale[0] = solution[1] > -HUGE_VAL ? step[1] : (double)NAN, out->by_scale[1] = step[0];
        of[0] = scale[0] * step[1] * size, of[1] = scale[1] * step[0] * size;
        for (int p = 0; p < 4; p++)
            covariance[p / 2][p % 2] += of[p / 2] * of[p % 2];
    }
    out->by_thickness[0] = out->by_thickness[1] = -1;
    out->absorption_sd = sqrt(covariance[0][0]);
    out->reduced_scattering_sd = sqrt(covariance[1][1]);
    out->correlation = covariance[0][0] > 0 && covariance[1][1] > 0
                           ? covariance[0][1] / (out->absorption_sd * out->reduced_scattering_sd)
                           : 0;
    const double a = out->absorption_per_mm, s = out->reduced_scattering_per_mm, sum = a + s;
    out->reduced_albedo = s / sum;
    out->reduced_albedo_sd =
        sqrt(fmax(0, s * s * covariance[0][0] + a * a * covariance[1][1] - 2 * a * s * covariance[0][1])) / (sum * sum);
    return true;
}

const char *alb_optical_flag_text(int i)
{
    static const char *const texts[ALB_OPTICAL_FLAGS] = {
        "outside diffusion: thinner than 8 transport mean free paths",
        "outside diffusion: reduced albedo below 0.8",
        "ballistic light: thinner than 8 mean free paths",
        "the ratio of absorption to scattering alone is known",
        "absorption is not told from none",
    };
    return texts[i];
}

static void raise_flags(alb_optical *out, double d, double g)
{
    const double a = out->absorption_per_mm, s = out->reduced_scattering_per_mm;
    out->flags |= s * d < 1 || (a + s) * d < 8 ? ALB_OPTICAL_THIN : 0;
    out->flags |= s < 0.8 * (a + s) ? ALB_OPTICAL_LOW_ALBEDO : 0;
    out->flags |= (a + s / (1 - g)) * d < 8 ? ALB_OPTICAL_BALLISTIC : 0;
    out->flags |= a < 2 * out->absorption_sd || a == 0 ? ALB_OPTICAL_NO_ABSORPTION : 0;
}

// Refuses totals that no slab has.
static bool check_totals(const alb_measured_totals *m, double entry, alb_error *error)
{
    const double r = 1 - entry, R = m->reflection, T = m->thickness_mm > 0 ? m->transmission : 0, sum = R + T;
    const double sd = sqrt(m->reflection_sd * m->reflection_sd + m->transmission_sd * m->transmission_sd +
                           m->scale_sd * m->scale_sd * sum * sum);
    if (!(isfinite(sum) && isfinite(sd) && m->thickness_mm >= 0 && m->thickness_mm < 1e9 && m->thickness_sd_mm >= 0))
        return alb_fail(error, ALB_BAD_DATA,
                        "reflection %g, transmission %g, thickness %g mm: finite numbers are wanted", R, T,
                        m->thickness_mm);
    if (sum > entry + 3 * sd + 1e-9)
        return alb_fail(error, ALB_BAD_DATA,
                        "reflection %.4g + transmission %.4g = %.4g is more than the %.4g that enters (sd %.2g): the "
                        "scale of the readings is wrong; check the white reference",
                        R, T, sum, entry, sd);
    const double e = 2 * T / (entry * entry + sqrt(entry * entry * entry * entry + 4 * r * r * T * T));
    if (!(R > r * e * T))
        return alb_fail(error, ALB_BAD_DATA,
                        "reflection %.4g is no more than the %.4g of a slab that does not scatter (transmission %.4g)",
                        R, r * e * T, T);
    if (m->thickness_mm > 0 && !(T > 1e-10))
        return alb_fail(error, ALB_BAD_DATA,
                        "transmission %.4g: no light comes through, absorption and scattering cannot be told apart; "
                        "as a half-space (thickness 0) their ratio can",
                        T);
    return true;
}

// ln of the share that a half-space of sigma_a / sigma_s' = e^x loses, less log_lost.
static double half_space_residual(const alb_streams *streams, double entry, double log_lost, double x)
{
    return log(entry - alb_adding_doubling(streams, exp(x), 1, 0).reflection) - log_lost;
}

// ln(sigma_a / sigma_s') at which a half-space loses the share exp(log_lost); false position with halved ends
// (Illinois) in [low, high], in which the share rises.
static double half_space_at(const alb_streams *streams, double entry, double log_lost, double low, double high)
{
    double at_low = -HUGE_VAL, at_high = HUGE_VAL, x = (low + high) / 2;
    for (int i = 0, side = 0; i < 100; i++) {
        const double f = half_space_residual(streams, entry, log_lost, x);
        if (fabs(f) < 1e-9 || high - low < 1e-12)
            break;
        if (f < 0) {
            low = x, at_low = f;
            at_high *= side < 0 ? 0.5 : 1;
            side = -1;
        } else {
            high = x, at_high = f;
            at_low *= side > 0 ? 0.5 : 1;
            side = 1;
        }
        x = isinf(at_low) || isinf(at_high) ? (low + high) / 2 : (low * at_high - high * at_low) / (at_high - at_low);
    }
    return x;
}

// The same on other streams from a solution nearby: secants, the first of the given slope.
static double half_space_near(const alb_streams *streams, double entry, double log_lost, double x, double slope)
{
    double f = half_space_residual(streams, entry, log_lost, x);
    for (int i = 0; i < 12 && fabs(f) > 1e-9; i++) {
        const double step = -f / slope, next = half_space_residual(streams, entry, log_lost, x + step);
        if (!(fabs(next) < fabs(f)))
            break;
        slope = (next - f) / step;
        x += step, f = next;
    }
    return fabs(f) < 1e-6 ? x : half_space_at(streams, entry, log_lost, -40, 12);
}

static bool half_space(alb_optical *out, const alb_optical_model *model, double entry,
                       const alb_measured_totals *measured)
{
    const double lost = entry - measured->reflection;
    const double sd = hypot(measured->reflection_sd, measured->scale_sd * measured->reflection);
    out->absorption_per_mm = out->absorption_sd = NAN;
    out->reduced_scattering_per_mm = out->reduced_scattering_sd = NAN;
    out->by_scale[0] = out->by_scale[1] = out->by_thickness[0] = out->by_thickness[1] = NAN;
    out->flags = ALB_OPTICAL_RATIO_ONLY | (lost > 2 * sd ? 0 : ALB_OPTICAL_NO_ABSORPTION);
    out->reduced_albedo = 1;
    if (lost > 1e-9) {
        const double log_lost = log(lost), few = half_space_at(&model->coarse, entry, log_lost, -40, 12), h = 1e-3;
        const double slope = (half_space_residual(&model->coarse, entry, log_lost, few + h) -
                              half_space_residual(&model->coarse, entry, log_lost, few - h)) /
                             (2 * h);
        const double ratio = exp(half_space_near(&model->fine, entry, log_lost, few, slope));
        out->reduced_albedo = 1 / (1 + ratio);
        out->reduced_albedo_sd = ratio / ((1 + ratio) * (1 + ratio)) * sd / lost / slope;
    } else { // lost grows as the root of the ratio: what an sd would be lost by
        const double few = half_space_at(&model->coarse, entry, log(fmax(sd, 1e-9)), -40, 12);
        out->reduced_albedo_sd = exp(few) / (1 + exp(few));
    }
    out->flags |= out->reduced_albedo < 0.8 ? ALB_OPTICAL_LOW_ALBEDO : 0;
    return true;
}

bool alb_optical_from_totals(alb_optical *out, const alb_optical_model *model, const alb_measured_totals *measured,
                             alb_error *error)
{
    const double n = model->fine.refractive_index, d = measured->thickness_mm;
    const double entry = entry_of(n), boundary = model->face.boundary;
    const alb_transfer coarse = {by_transport, &model->coarse, entry, boundary, n},
                       fine = {by_transport, &model->fine, entry, boundary, n};
    *out = (alb_optical){.diffusion = {NAN, NAN}};
    if (!check_totals(measured, entry, error))
        return false;
    if (!(d > 0))
        return half_space(out, model, entry, measured);
    const alb_wanted wanted = alb_wanted_of(entry, measured->reflection, measured->transmission);
    double x[2];
    if (!alb_slab_find(x, &coarse, &wanted, 1e-4) || !alb_slab_refine(x, &fine, &coarse, &wanted))
        return alb_fail(error, ALB_BAD_DATA, "reflection %.6g, transmission %.6g: no slab of index %g has these totals",
                        measured->reflection, measured->transmission, n);
    if (wanted.lossless)
        x[1] = -HUGE_VAL;
    out->absorption_per_mm = exp(x[1]) / d;
    out->reduced_scattering_per_mm = exp(x[0]) / d;
    if (!propagate(out, &coarse, x, measured))
        return alb_fail(error, ALB_INTERNAL, "the totals do not change with the properties at sigma_a %g, sigma_s' %g",
                        out->absorption_per_mm, out->reduced_scattering_per_mm);
    raise_flags(out, d, model->fine.anisotropy);
    if (!(out->flags & (ALB_OPTICAL_THIN | ALB_OPTICAL_LOW_ALBEDO | ALB_OPTICAL_BALLISTIC)) &&
        !alb_optical_from_diffusion(out->diffusion, &model->face, n, measured->reflection, measured->transmission, d))
        out->diffusion[0] = out->diffusion[1] = NAN;
    return true;
}

bool alb_optical_from_diffusion(double properties[2], const alb_diffusion_face *face, double n, double reflection,
                                double transmission, double thickness_mm)
{
    const diffusion_model model = {*face, entry_of(n)};
    const alb_transfer slab = {by_diffusion, &model, model.entry, face->boundary, n};
    const alb_wanted wanted = alb_wanted_of(model.entry, reflection, transmission);
    double x[2];
    if (wanted.lossless || !alb_slab_find(x, &slab, &wanted, 1e-10))
        return false;
    properties[0] = exp(x[1]) / thickness_mm;
    properties[1] = exp(x[0]) / thickness_mm;
    return true;
}

// Dipoles and multipoles. With t = sigma_a + sigma_s': alpha' = sigma_s'/t, z0 = 1/t, sigma_tr = sqrt(sigma_a/D),
//   D = 1/(3 t)  (classic)   or   (2 sigma_a + sigma_s')/(3 t^2)  (Grosjean 1956, after d'Eon 2012, "A Better Dipole").
// The fluence is zero zb = 2 A D outside the faces z = 0 and z = d. That mirrors the source into +1 at L + z0 and -1 at
// L - 2 zb - z0, L = 2 m (d + 2 zb), m = 0, +-1, +-2, ... (half-space: m = 0 alone). With u = z - source and
// rho^2 = r^2 + u^2:
//   fluence phi = sum +- e^(-sigma_tr rho) / (4 pi D rho),
//   flux      J = sum +- u (1 + sigma_tr rho) e^(-sigma_tr rho) / (4 pi rho^3), along +z.
// Exitance: alpha' (C_phi phi -+ C_E J) at z = 0 (-) and d (+). Classic: C_phi = 0, C_E = 1 and Jensen's fit of A.
// Grosjean: C_phi = (1 - R1)/4, C_E = (1 - R2)/2 (Kienle & Patterson 1997; R1, R2, A: fresnel.h).
//
// Integrated over the plane the sum is that of a plane source between two absorbing planes, in closed form:
//   phi = sinh(sigma_tr p) sinh(sigma_tr q) / (D sigma_tr sinh(sigma_tr (d + 2 zb))),  |J| = cosh(sigma_tr zb)
//   sinh(..)..,
// with p = zb, q = d + zb - z0 at z = 0 and p = zb, q = zb + z0 at z = d.
//
// Stops being true: within one transport mean free path of the beam, for alpha' < 0.8, for slabs thinner than 8 mean
// free paths. Far out (r > 8 d, exitance 1e-10 of the peak) the alternating sum loses its digits.
#include "fit/diffusion.h"
#include "fit/fresnel.h"
#include <math.h>

// Terms beyond which no image is added; reached only where r is many times d and nothing absorbs.
enum { IMAGES_MAX = 400 };

alb_diffusion_face alb_diffusion_face_at(alb_diffusion_theory theory, double n)
{
    if (theory == ALB_DIFFUSION_CLASSIC) {
        const double f = -1.440 / (n * n) + 0.710 / n + 0.668 + 0.0636 * n;
        return (alb_diffusion_face){theory, n == 1 ? 1 : (1 + f) / (1 - f), 0, 1};
    }
    const alb_fresnel_moments m = alb_fresnel_moments_at(n);
    return (alb_diffusion_face){theory, m.boundary, (1 - m.first) / 4, (1 - m.second) / 2};
}

alb_diffusion alb_diffusion_at(const alb_diffusion_face *face, double absorption, double scattering, double thickness)
{
    const double t = absorption + scattering, excess = face->theory == ALB_DIFFUSION_GROSJEAN ? absorption / t : 0;
    const double diffusivity = (1 + excess) / (3 * t);
    return (alb_diffusion){.face = *face,
                           .absorption = absorption,
                           .scattering = scattering,
                           .thickness = thickness,
                           .albedo = scattering / t,
                           .diffusivity = diffusivity,
                           .attenuation = sqrt(absorption / diffusivity),
                           .source_depth = 1 / t,
                           .beyond = 2 * face->boundary * diffusivity};
}

// Derivatives of what a medium consists of by sigma_a (0) and sigma_s' (1).
typedef struct chain {
    double log_albedo[2], diffusivity[2], attenuation_2[2], source_depth[2], beyond[2]; // attenuation_2: sigma_tr^2
} chain;

static chain chain_of(const alb_diffusion *m)
{
    const double t = m->absorption + m->scattering, grosjean = m->face.theory == ALB_DIFFUSION_GROSJEAN;
    chain c;
    for (int p = 0; p < 2; p++) {
        c.log_albedo[p] = (p ? 1 / m->scattering : 0) - 1 / t;
        c.diffusivity[p] = -m->diffusivity / t + grosjean * ((p ? 0 : 1) - m->absorption / t) / (3 * t * t);
        c.attenuation_2[p] = ((p ? 0 : 1) - m->absorption / m->diffusivity * c.diffusivity[p]) / m->diffusivity;
        c.source_depth[p] = -1 / (t * t);
        c.beyond[p] = 2 * m->face.boundary * c.diffusivity[p];
    }
    return c;
}

// Exitance / alpha' and its derivatives by D, sigma_tr, z0 and zb.
typedef struct image_sum {
    double value, by_diffusivity, by_attenuation, by_source_depth, by_beyond;
} image_sum;

// Adds one image of strength +-1 at `source`; the place moves with z0 and zb at the given rates.
static void add_image(image_sum *sum, const alb_diffusion *m, double sign, double z, double source, double with_depth,
                      double with_beyond, double towards, double r)
{
    const double s = m->attenuation, u = z - source, rho = hypot(r, u), x = s * rho;
    const double e = sign * exp(-x) / (4 * M_PI * rho), e2 = e / (rho * rho);
    const double phi = m->face.of_fluence / m->diffusivity, flux = towards * m->face.of_flux;
    const double fluence = phi * e, by_u = -phi * u * (1 + x) * e2 + // of the fluence, then of the flux
                                           flux * e2 * (1 + x - u * u * (3 + x * (3 + x)) / (rho * rho));
    sum->value += fluence + flux * u * (1 + x) * e2;
    sum->by_diffusivity -= fluence / m->diffusivity;
    sum->by_attenuation -= phi * e * rho + flux * u * s * e;
    sum->by_source_depth -= by_u * with_depth;
    sum->by_beyond -= by_u * with_beyond;
}

static void add_pair(image_sum *sum, const alb_diffusion *m, alb_side side, int k, double r)
{
    const double z = side ? m->thickness : 0, towards = side ? 1 : -1;
    const double shift = 2.0 * k * (m->thickness + 2 * m->beyond);
    add_image(sum, m, 1, z, shift + m->source_depth, 1, 4.0 * k, towards, r);
    add_image(sum, m, -1, z, shift - 2 * m->beyond - m->source_depth, -1, 4.0 * k - 2, towards, r);
}

// Whether the images +-m, just added, do not matter any more.
static bool enough(double sum, double before) { return fabs(sum - before) <= 1e-12 * fabs(sum); }

double alb_diffusion_value(double gradient[2], const alb_diffusion *m, alb_side side, double r_mm)
{
    image_sum sum = {0};
    const bool slab = m->thickness > 0;
    if (slab || side == ALB_REFLECTION)
        add_pair(&sum, m, side, 0, r_mm);
    for (int k = 1; slab && k < IMAGES_MAX; k++) {
        const double before = sum.value;
        add_pair(&sum, m, side, k, r_mm);
        add_pair(&sum, m, side, -k, r_mm);
        if (enough(sum.value, before))
            break;
    }
    if (gradient) {
        const chain c = chain_of(m);
        for (int p = 0; p < 2; p++)
            gradient[p] = m->albedo * (sum.value * c.log_albedo[p] + sum.by_diffusivity * c.diffusivity[p] +
                                       sum.by_attenuation * c.attenuation_2[p] / (2 * m->attenuation) +
                                       sum.by_source_depth * c.source_depth[p] + sum.by_beyond * c.beyond[p]);
    }
    return m->albedo * sum.value;
}

// Share of integral_0^rho S r dr of one image: d(e^(-s rho))/d rho and d(-e^(-s rho)/rho) are the integrands. Written
// so that small discs keep their digits.
static double disc_of_image(const alb_diffusion *m, double sign, double u, double towards, double rho)
{
    const double s = m->attenuation, near = fabs(u), distance = hypot(rho, near);
    const double further = rho * rho / (distance + near), e = exp(-s * near), lost = -expm1(-s * further);
    const double fluence = s > 0 ? lost / s : further;
    const double share = further / distance, flux = copysign(share + (1 - share) * lost, u);
    return sign * e / (4 * M_PI) * (m->face.of_fluence / m->diffusivity * fluence + towards * m->face.of_flux * flux);
}

static double disc_of_pair(const alb_diffusion *m, alb_side side, int k, double rho)
{
    const double z = side ? m->thickness : 0, towards = side ? 1 : -1;
    const double shift = 2.0 * k * (m->thickness + 2 * m->beyond);
    return disc_of_image(m, 1, z - shift - m->source_depth, towards, rho) +
           disc_of_image(m, -1, z - shift + 2 * m->beyond + m->source_depth, towards, rho);
}

double alb_diffusion_disc(const alb_diffusion *m, alb_side side, double rho_mm)
{
    const bool slab = m->thickness > 0;
    double sum = slab || side == ALB_REFLECTION ? disc_of_pair(m, side, 0, rho_mm) : 0;
    for (int k = 1; slab && k < IMAGES_MAX; k++) {
        const double before = sum;
        sum += disc_of_pair(m, side, k, rho_mm) + disc_of_pair(m, side, -k, rho_mm);
        if (enough(sum, before))
            break;
    }
    return m->albedo * sum;
}

// (x coth x - 1) / x^2 = d ln(sinh(x)/x) / d(x^2) * 2; even and smooth.
static double sinh_slope(double x)
{
    if (x < 0.05) {
        const double y = x * x;
        return 1.0 / 3 - y * (1.0 / 45 - y * (2.0 / 945 - y / 4725));
    }
    return (x / tanh(x) - 1) / (x * x);
}

// sinh(x) / x * e^-x
static double scaled_sinh(double x) { return x != 0 ? -expm1(-2 * x) / (2 * x) : 1; }

// A plane source between absorbing planes `whole` apart, seen p from one of them, q from the other to the source:
// fluence D phi = p q / whole * ratio of sinh(x)/x, and its logarithmic derivatives by sigma_tr^2, p, q and whole.
typedef struct plane_sum {
    double value, by_attenuation_2, by_p, by_q, by_whole;
} plane_sum;

// d ln sinh(s x) / dx = s coth(s x), finite as s vanishes.
static double log_slope(double s, double x) { return (1 + s * x * (s * x) * sinh_slope(s * x)) / x; }

static plane_sum plane_of(double s, double p, double q, double whole)
{
    const double decay = exp(s * (p + q - whole));
    return (plane_sum){
        .value = decay * p * scaled_sinh(s * p) * q * scaled_sinh(s * q) / (whole * scaled_sinh(s * whole)),
        .by_attenuation_2 =
            (p * p * sinh_slope(s * p) + q * q * sinh_slope(s * q) - whole * whole * sinh_slope(s * whole)) / 2,
        .by_p = log_slope(s, p),
        .by_q = log_slope(s, q),
        .by_whole = -log_slope(s, whole)};
}

// The same for a half-space as `whole` and q grow: sinh(s q)/sinh(s whole) becomes e^(-s (whole - q)).
static plane_sum half_space_of(double s, double p, double deeper)
{
    const double slope = s > 0 ? 1 / (2 * s) : 0;
    return (plane_sum){.value = exp(-s * (deeper - p)) * p * scaled_sinh(s * p),
                       .by_attenuation_2 = p * p * sinh_slope(s * p) / 2 - deeper * slope,
                       .by_p = log_slope(s, p),
                       .by_q = -s};
}

double alb_diffusion_total(double gradient[2], const alb_diffusion *m, alb_side side)
{
    if (gradient)
        gradient[0] = gradient[1] = 0;
    if (side == ALB_TRANSMISSION && !(m->thickness > 0))
        return 0;
    const bool slab = m->thickness > 0;
    const double s = m->attenuation, zb = m->beyond, z0 = m->source_depth, whole = m->thickness + 2 * zb;
    const double q = side ? zb + z0 : m->thickness + zb - z0; // slab; a half-space counts the source's depth
    const plane_sum plane = slab ? plane_of(s, zb, q, whole) : half_space_of(s, zb, zb + z0);
    // flux = D d(phi)/dp; exitance = (C_phi / D + C_E s coth(s zb)) D phi
    const double slope = log_slope(s, zb), k = m->face.of_fluence / m->diffusivity + m->face.of_flux * slope;
    const double value = m->albedo * k * plane.value;
    if (!gradient)
        return value;
    const chain c = chain_of(m);
    const double x = s * zb, slope_by_zb = s * s - slope * slope;                   // (s coth)' = s^2 - (s coth)^2
    const double h = sinh_slope(x), slope_by_s2 = zb * (1 - x * x * h * h - h) / 2; // see d(x coth x)/d(x^2)
    for (int p = 0; p < 2; p++) {
        const double q_rate =
            !slab ? c.beyond[p] + c.source_depth[p] : c.beyond[p] + (side ? c.source_depth[p] : -c.source_depth[p]);
        const double log_plane = plane.by_attenuation_2 * c.attenuation_2[p] + plane.by_p * c.beyond[p] +
                                 plane.by_q * q_rate + plane.by_whole * 2 * c.beyond[p];
        const double k_rate = -m->face.of_fluence / (m->diffusivity * m->diffusivity) * c.diffusivity[p] +
                              m->face.of_flux * (slope_by_zb * c.beyond[p] + slope_by_s2 * c.attenuation_2[p]);
        gradient[p] = value * (c.log_albedo[p] + log_plane + k_rate / k);
    }
    return value;
}

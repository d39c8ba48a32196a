// Spots a second of a map, and how well it knows them: two exponentials with 1 % noise, against the rings of a spot and
// the threads, where readings are values of S (a pencil beam) and where they are seen through a spot of 0.5 mm radius.
// Prints the rows; forward models, form and covariance are in the time.
#include "base/progress.h"
#include "base/random.h"
#include "fit/map.h"
#include <math.h>
#include <omp.h>
#include <stdio.h>
#include <stdlib.h>

enum { SPOTS = 400 };
static const alb_profile truth = {ALB_FORM_TWO_EXPONENTIALS, {0.03, 0.5, 0.1, 1.6}};

typedef struct setting {
    int rings;
    const alb_spot *spot; // NULL: a pencil beam
} setting;

static bool read_spot(alb_readings *readings, alb_operator *forward, int spot, const void *context, alb_error *error)
{
    const setting *s = context;
    alb_random random = alb_random_at(1, 0, (unsigned)spot);
    if (!alb_readings_create(readings, s->rings, error))
        return false;
    const double step = 12.0 / s->rings;
    for (int i = 0; i < s->rings; i++) {
        readings->r_mm[i] = step * (i + 0.5);
        readings->area_mm2[i] = 2 * M_PI * readings->r_mm[i] * step;
        for (int k = 0; k < ALB_RING_SAMPLES; k++) {
            readings->sample_r_mm[i][k] = step * (i + (k + 0.5) / ALB_RING_SAMPLES);
            readings->sample_share[i][k] = 1.0 / ALB_RING_SAMPLES;
        }
    }
    readings->outer_mm = 12;
    if (!(s->spot ? alb_operator_create(forward, readings, s->spot, error)
                  : alb_operator_identity(forward, readings, error)))
        return false;
    double *exact = alb_operator_readings(forward, &truth, error);
    for (int i = 0; exact && i < s->rings; i++) {
        readings->sd[i] = 0.01 * hypot(exact[i], 0.003 * exact[0]);
        readings->value[i] = exact[i] + readings->sd[i] * alb_random_normal(&random);
    }
    free(exact);
    return exact != NULL;
}

static bool measure(const setting *s, int threads)
{
    alb_map_layer layer;
    alb_error error = {0};
    omp_set_num_threads(threads);
    const double start = alb_clock_s();
    if (!alb_map_layer_fit(&layer, SPOTS, 0, read_spot, s, "spots", &error)) {
        fprintf(stderr, "%s\n", error.text);
        return false;
    }
    const double seconds = alb_clock_s() - start, total = alb_profile_total(&truth);
    double squares = 0;
    for (int i = 0; i < SPOTS; i++)
        squares += pow(layer.spots[i].total / total - 1, 2) / SPOTS;
    printf("%-12s %6d %8d %14.0f %12.3f %10.3f\n", s->spot ? "spot 0.5 mm" : "pencil beam", s->rings, threads,
           SPOTS / seconds, 100 * sqrt(squares), layer.total.chi_square / (layer.total.count - 1));
    alb_map_layer_free(&layer);
    return true;
}

int main(void)
{
    alb_spot disc = {0};
    alb_error error = {0};
    bool ok = alb_spot_disc(&disc, 0.5, &error);
    const int most = omp_get_max_threads();
    printf("%-12s %6s %8s %14s %12s %10s\n", "light", "rings", "threads", "spots a second", "total rms %", "chi2/dof");
    for (int with_spot = 0; with_spot < 2; with_spot++)
        for (int rings = 30; ok && rings <= 120; rings *= 2)
            for (int threads = 1; ok && threads <= most; threads *= 2)
                ok = measure(&(setting){rings, with_spot ? &disc : NULL}, threads);
    alb_spot_free(&disc);
    return !ok;
}

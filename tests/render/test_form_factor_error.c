// The error that rows of rays state, against irradiances known without rays.
#include "convex_room.h"

enum { CASES = 14 };

typedef double rgb[3];

static const alb_box room = {.size_mm = {4, 4, 4}, .cells = {6, 6, 6}, .grading = 1, .inward = true};

typedef struct fields {
    rgb *radiosity, *truth, *found;
} fields;

static void fields_of(fields *f, const world *w, uint64_t number)
{
    const size_t n = w->patches.count;
    *f = (fields){calloc(n, sizeof(rgb)), calloc(n, sizeof(rgb)), calloc(n, sizeof(rgb))};
    random_radiosity(f->radiosity, w, 4, number);
    room_irradiance(f->truth, w, (const rgb *)f->radiosity, 1);
}

static void fields_free(fields *f)
{
    free(f->radiosity);
    free(f->truth);
    free(f->found);
}

static double true_error(const fields *f, const alb_form_factors *factors, size_t n)
{
    double worst = 0;
    alb_form_factors_apply(f->found, factors, (const rgb *)f->radiosity);
    for (int c = 0; c < 3; c++)
        worst = fmax(worst, rms_percent((const rgb *)f->found, (const rgb *)f->truth, n, 1, c));
    return worst;
}

// The stated error holds in at least 95 % of the cases, and does not say twice too much. It is asked with 64 rays
// for 12 % and 8 %: of 28 cases one may err more than it states.
static void stated_error_holds(void **state)
{
    (void)state;
    alb_error error = {0};
    world w;
    int over = 0, over_wanted = 0;
    double stated_sum = 0, true_sum = 0;
    world_of_box(&w, &room);
    for (uint64_t number = 0; number < CASES; number++) {
        fields f;
        fields_of(&f, &w, number);
        for (double wanted = 12; wanted > 7; wanted -= 4) {
            alb_form_factors factors;
            double stated, again;
            cast(&factors, &w, 64, number);
            check_ok(alb_form_factors_refine(&stated, &factors, &w.patches, &w.tracer, (const rgb *)f.radiosity, NULL,
                                             wanted, 4096, &error),
                     &error);
            check_ok(alb_form_factors_error(&again, &factors, (const rgb *)f.radiosity, NULL, &error), &error);
            check_near(again, stated, 0);
            over_wanted += stated > wanted;
            const double found = true_error(&f, &factors, w.patches.count);
            over += found > stated;
            stated_sum += stated;
            true_sum += found;
            alb_form_factors_free(&factors);
        }
        fields_free(&f);
    }
    assert_true(over <= 1);
    assert_true(over_wanted <= 1);
    check_below(stated_sum, 2 * true_sum);
    world_free(&w);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(stated_error_holds),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

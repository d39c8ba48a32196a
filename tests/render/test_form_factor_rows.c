// Packed rows against plain lists.
#include "base/random.h"
#include "check.h"
#include "render/form_factor_rows.h"
#include <omp.h>

enum { ROWS = 700, INDICES = 3 * ALB_BLOCK_MAX + 17, SKY = 2 * ALB_BLOCK_MAX - 3, LONGEST = 3000 };

typedef double rgb[3];

static double uniform(uint64_t stream, uint64_t index)
{
    alb_random random = alb_random_at(61, stream, index);
    return alb_random_uniform(&random);
}

// Row p: one to thousands of hits, some rows all in one block, some at SKY for the most part.
static uint32_t length_of(size_t p) { return (uint32_t)(1 + (LONGEST - 1) * pow(uniform(1, p), 8)); }

static uint32_t hit_of(size_t p, size_t q)
{
    const double u = uniform(100 + p, q);
    return p % 3 == 0 && uniform(1000 + p, q) < 0.7 ? SKY : (uint32_t)((p % 5 ? INDICES : 40) * u);
}

static void fill_rows(alb_hit_rows *rows, uint32_t counted, size_t memory_bytes)
{
    alb_error error = {0};
    uint32_t lengths[ROWS];
    for (size_t p = 0; p < ROWS; p++)
        lengths[p] = length_of(p);
    check_ok(alb_hit_rows_create(rows, lengths, ROWS, INDICES, counted, memory_bytes, &error), &error);
    uint32_t *hits = calloc(alb_hit_rows_largest_chunk(rows), sizeof *hits), scratch[LONGEST];
    for (size_t chunk = 0; chunk < rows->chunks; chunk++) {
        uint32_t *at = hits;
        for (size_t p = chunk * ALB_CHUNK_ROWS; p < ROWS && p < (chunk + 1) * ALB_CHUNK_ROWS; p++)
            for (size_t q = 0; q < lengths[p]; q++)
                *at++ = hit_of(p, q);
        alb_hit_rows_fill(rows, chunk, hits, scratch);
    }
    const size_t before = alb_hit_rows_bytes(rows);
    alb_hit_rows_trim(rows);
    // seven tenths of a third of the rows: of hits, as rows are of many lengths, a tenth at least
    if (counted == SKY && !memory_bytes)
        check_below((double)alb_hit_rows_bytes(rows), 0.9 * (double)before);
    free(hits);
}

static int ascending(const void *a, const void *b)
{
    const uint32_t x = *(const uint32_t *)a, y = *(const uint32_t *)b;
    return (x > y) - (x < y);
}

static void check_rows_come_back(uint32_t counted, size_t memory_bytes)
{
    alb_hit_rows rows;
    fill_rows(&rows, counted, memory_bytes);
    for (size_t p = 0; p < ROWS; p++) {
        uint32_t expected[LONGEST], found[LONGEST];
        const size_t length = length_of(p), even = (length + 1) / 2;
        for (size_t q = 0; q < length; q++)
            expected[q % 2 ? even + q / 2 : q / 2] = hit_of(p, q);
        qsort(expected, even, sizeof *expected, ascending);
        qsort(expected + even, length - even, sizeof *expected, ascending);
        alb_hit_rows_read(found, &rows, p);
        assert_memory_equal(found, expected, length * sizeof *found);
    }
    alb_hit_rows_free(&rows);
}

static void rows_come_back_sorted_by_halves(void **state)
{
    (void)state;
    for (size_t limit = 0; limit < 2; limit++) {
        check_rows_come_back(UINT32_MAX, limit);
        check_rows_come_back(SKY, limit);
    }
}

static float (*random_values(void))[4]
{
    float(*values)[4] = calloc(INDICES, sizeof *values);
    for (size_t i = 0; i < INDICES; i++)
        for (int c = 0; c < 3; c++)
            values[i][c] = (float)uniform(2, 3 * i + (size_t)c);
    return values;
}

// Means and half differences against sums in double: at most 64 additions in a lane, each rounded to 2^-24.
static const double rounding = 64 * 0x1p-24;

static void check_products(uint32_t counted)
{
    alb_hit_rows rows;
    static rgb means[ROWS], halves[ROWS];
    float(*values)[4] = random_values();
    fill_rows(&rows, counted, 0);
    alb_hit_rows_gather(means, &rows, (const float(*)[4])values);
    alb_hit_rows_gather_difference(halves, &rows, (const float(*)[4])values);
    for (size_t p = 0; p < ROWS; p++)
        for (size_t c = 0; c < 3; c++) {
            double sums[2] = {0}, counts[2] = {0};
            for (size_t q = 0; q < length_of(p); q++) {
                sums[q % 2] += (double)values[hit_of(p, q)][c];
                counts[q % 2] += 1;
            }
            check_relative(means[p][c], (sums[0] + sums[1]) / (counts[0] + counts[1]), rounding);
            if (counts[1] > 0)
                check_near(halves[p][c], 0.5 * (sums[0] / counts[0] - sums[1] / counts[1]), rounding);
        }
    free(values);
    alb_hit_rows_free(&rows);
}

static void products_match_plain_sums(void **state)
{
    (void)state;
    check_products(UINT32_MAX);
    check_products(SKY);
}

// Rows in a file, and any number of threads: the same bytes.
static void files_and_threads_do_not_matter(void **state)
{
    (void)state;
    static rgb out[4][ROWS];
    float(*values)[4] = random_values();
    for (size_t k = 0; k < 4; k++) {
        alb_hit_rows rows;
        omp_set_num_threads(1 + (int)(k % 2));
        fill_rows(&rows, SKY, k / 2);
        assert_true((rows.mapped_bytes > 0) == (k / 2 > 0));
        alb_hit_rows_gather(out[k], &rows, (const float(*)[4])values);
        assert_memory_equal(out[k], out[0], sizeof out[0]);
        alb_hit_rows_free(&rows);
    }
    free(values);
}

static void a_folder_without_room_is_refused(void **state)
{
    (void)state;
    alb_error error = {0};
    alb_hit_rows rows;
    const uint32_t one = 1;
    const char *kept = getenv("TMPDIR");
    setenv("TMPDIR", "/proc", 1);
    check_fails(alb_hit_rows_create(&rows, &one, 1, 1, UINT32_MAX, 1, &error), &error, ALB_ACCESS, "TMPDIR");
    if (kept)
        setenv("TMPDIR", kept, 1);
    else
        unsetenv("TMPDIR");
    assert_null(rows.hits);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(rows_come_back_sorted_by_halves),
        cmocka_unit_test(products_match_plain_sums),
        cmocka_unit_test(files_and_threads_do_not_matter),
        cmocka_unit_test(a_folder_without_room_is_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

// The 27 certified problems of nonlinear regression of NIST (StRD), each from its two starts, through the same solve as
// everything else; and those that are sums of exponentials from no start at all. Derivatives by complex steps: exact to
// rounding, and nothing of the models is written twice. Data and models in extended precision: the residuals of
// Lanczos1 are 1e-13 of its values, and those of rounded values have three or four digits left.
#include "check.h"
#include "fit/gauss_newton.h"
#include "fit/separable.h"
#include <complex.h>
#include <ctype.h>
#include <float.h>

typedef long double complex number;

static const long double pi = 3.14159265358979323846264338327950288L;

static number polynomial(const number *b, int count, number x)
{
    number sum = 0;
    for (int i = count - 1; i >= 0; i--)
        sum = sum * x + b[i];
    return sum;
}

static number bennett5(const number *b, const long double *x) { return b[0] * cpowl(b[1] + x[0], -1 / b[2]); }
static number boxbod(const number *b, const long double *x) { return b[0] * (1 - cexpl(-b[1] * x[0])); }
static number chwirut(const number *b, const long double *x) { return cexpl(-b[0] * x[0]) / (b[1] + b[2] * x[0]); }
static number danwood(const number *b, const long double *x) { return b[0] * cpowl(x[0], b[1]); }
static number enso(const number *b, const long double *x)
{
    const long double t = 2 * pi * x[0];
    return b[0] + b[1] * cosl(t / 12) + b[2] * sinl(t / 12) + b[4] * ccosl(t / b[3]) + b[5] * csinl(t / b[3]) +
           b[7] * ccosl(t / b[6]) + b[8] * csinl(t / b[6]);
}
static number eckerle4(const number *b, const long double *x)
{
    const number z = (x[0] - b[2]) / b[1];
    return b[0] / b[1] * cexpl(-z * z / 2);
}
static number gauss(const number *b, const long double *x)
{
    const number u = (x[0] - b[3]) / b[4], v = (x[0] - b[6]) / b[7];
    return b[0] * cexpl(-b[1] * x[0]) + b[2] * cexpl(-u * u) + b[5] * cexpl(-v * v);
}
static number hahn1(const number *b, const long double *x)
{
    return polynomial(b, 4, x[0]) / (1 + x[0] * polynomial(b + 4, 3, x[0]));
}
static number kirby2(const number *b, const long double *x)
{
    return polynomial(b, 3, x[0]) / (1 + x[0] * polynomial(b + 3, 2, x[0]));
}
static number lanczos(const number *b, const long double *x)
{
    return b[0] * cexpl(-b[1] * x[0]) + b[2] * cexpl(-b[3] * x[0]) + b[4] * cexpl(-b[5] * x[0]);
}
static number mgh09(const number *b, const long double *x)
{
    return b[0] * (x[0] * x[0] + x[0] * b[1]) / (x[0] * x[0] + x[0] * b[2] + b[3]);
}
static number mgh10(const number *b, const long double *x) { return b[0] * cexpl(b[1] / (x[0] + b[2])); }
static number mgh17(const number *b, const long double *x)
{
    return b[0] + b[1] * cexpl(-x[0] * b[3]) + b[2] * cexpl(-x[0] * b[4]);
}
static number misra1b(const number *b, const long double *x) { return b[0] * (1 - cpowl(1 + b[1] * x[0] / 2, -2)); }
static number misra1c(const number *b, const long double *x) { return b[0] * (1 - cpowl(1 + 2 * b[1] * x[0], -0.5)); }
static number misra1d(const number *b, const long double *x) { return b[0] * b[1] * x[0] / (1 + b[1] * x[0]); }
static number nelson(const number *b, const long double *x) { return b[0] - b[1] * x[0] * cexpl(-b[2] * x[1]); }
static number rat42(const number *b, const long double *x) { return b[0] / (1 + cexpl(b[1] - b[2] * x[0])); }
static number rat43(const number *b, const long double *x)
{
    return b[0] / cpowl(1 + cexpl(b[1] - b[2] * x[0]), 1 / b[3]);
}
static number roszman1(const number *b, const long double *x)
{
    return b[0] - b[1] * x[0] - catanl(b[2] / (x[0] - b[3])) / pi;
}

static const struct {
    const char *name;
    number (*model)(const number *b, const long double *x);
} problems[] = {
    {"Misra1a", boxbod},  {"Chwirut2", chwirut},  {"Chwirut1", chwirut},  {"Lanczos3", lanczos}, {"Gauss1", gauss},
    {"Gauss2", gauss},    {"DanWood", danwood},   {"Misra1b", misra1b},   {"Kirby2", kirby2},    {"Hahn1", hahn1},
    {"Nelson", nelson},   {"MGH17", mgh17},       {"Lanczos1", lanczos},  {"Lanczos2", lanczos}, {"Gauss3", gauss},
    {"Misra1c", misra1c}, {"Misra1d", misra1d},   {"Roszman1", roszman1}, {"ENSO", enso},        {"MGH09", mgh09},
    {"Thurber", hahn1},   {"BoxBOD", boxbod},     {"Rat42", rat42},       {"MGH10", mgh10},      {"Eckerle4", eckerle4},
    {"Rat43", rat43},     {"Bennett5", bennett5},
};

enum { ROWS = 260, COLUMNS = 9, PROBLEMS = sizeof problems / sizeof *problems };

typedef struct nist {
    number (*model)(const number *b, const long double *x);
    int parameters, rows;
    double start[2][COLUMNS], certified[COLUMNS], sd[COLUMNS];
    long double y[ROWS], x[ROWS][2];
} nist;

static void read_problem(nist *p, const char *name)
{
    char path[4096], line[256];
    snprintf(path, sizeof path, "%s/tests/fit/nist/%s.dat", ALB_SOURCE_FOLDER, name);
    FILE *file = fopen(path, "r");
    assert_non_null(file);
    bool data = false;
    while (fgets(line, sizeof line, file)) {
        double v[4];
        long double row[3] = {0};
        if (sscanf(line, " b%*d = %lf %lf %lf %lf", &v[0], &v[1], &v[2], &v[3]) == 4) {
            p->start[0][p->parameters] = v[0];
            p->start[1][p->parameters] = v[1];
            p->certified[p->parameters] = v[2];
            p->sd[p->parameters++] = v[3];
        } else if (strncmp(line, "Data:", 5) == 0) {
            data = strchr(line, 'y') && strchr(line, 'x') && !strchr(line, '=') && !strstr(line, "Response");
        } else if (data && sscanf(line, "%Lf %Lf %Lf", &row[0], &row[1], &row[2]) >= 2) {
            p->y[p->rows] = p->model == nelson ? logl(row[0]) : row[0];
            p->x[p->rows][0] = row[1];
            p->x[p->rows++][1] = row[2];
        }
    }
    fclose(file);
    assert_true(p->parameters > 1 && p->rows > p->parameters);
}

static void evaluate(double *residuals, double *jacobian, const double *parameters, const void *context)
{
    const nist *p = context;
    number b[COLUMNS];
    const long double h = 1e-150L;
    for (int k = 0; k < p->parameters; k++)
        b[k] = parameters[k];
    for (int i = 0; i < p->rows; i++) {
        residuals[i] = (double)(creall(p->model(b, p->x[i])) - p->y[i]);
        for (int k = 0; jacobian && k < p->parameters; k++) {
            b[k] = CMPLXL(parameters[k], h);
            jacobian[i * p->parameters + k] = (double)(cimagl(p->model(b, p->x[i])) / h);
            b[k] = parameters[k];
        }
    }
}

// Correct digits, 11 at most: that is what is certified.
static double digits(double found, double certified)
{
    const double relative = fabs(found - certified) / fabs(certified);
    return relative > 1e-11 ? fmax(-log10(relative), 0) : relative >= 0 ? 11 : 0;
}

static double fewest(const double *found, const double *certified, int n)
{
    double least = 11;
    for (int k = 0; k < n; k++)
        least = fmin(least, digits(found[k], certified[k]));
    return least;
}

static double sd_digits(const nist *p, const alb_problem *problem, const double *parameters, double chi_square)
{
    alb_error error = {0};
    double covariance[COLUMNS * COLUMNS], sd[COLUMNS];
    bool full_rank;
    check_ok(alb_problem_covariance(covariance, &full_rank, parameters, problem, &error), &error);
    if (!full_rank)
        return 0;
    for (int k = 0; k < p->parameters; k++)
        sd[k] = sqrt(covariance[k * p->parameters + k] * chi_square / (p->rows - p->parameters));
    return fewest(sd, p->sd, p->parameters);
}

static void certified_problems(void **state)
{
    (void)state;
    double lower[COLUMNS], upper[COLUMNS], sum = 0;
    int solved = 0;
    for (int k = 0; k < COLUMNS; k++) {
        lower[k] = -DBL_MAX;
        upper[k] = DBL_MAX;
    }
    for (int i = 0; i < PROBLEMS; i++) {
        nist p = {.model = problems[i].model};
        read_problem(&p, problems[i].name);
        const alb_problem problem = {p.parameters, p.rows, evaluate, &p, lower, upper};
        double found[2], sd[2];
        for (int s = 0; s < 2; s++) {
            alb_error error = {0};
            double parameters[COLUMNS], chi_square;
            memcpy(parameters, p.start[s], sizeof parameters);
            check_ok(alb_solve(parameters, &chi_square, &problem, &error), &error);
            found[s] = fewest(parameters, p.certified, p.parameters);
            sd[s] = sd_digits(&p, &problem, parameters, chi_square);
            solved += found[s] >= 4;
            sum += found[s];
            assert_true(sd[s] >= 6);
        }
        print_message("%-9s digits %5.1f %5.1f   of standard deviations %5.1f %5.1f\n", problems[i].name, found[0],
                      found[1], sd[0], sd[1]);
    }
    print_message("%d of %d runs to 4 digits or more; mean %.2f digits\n", solved, 2 * PROBLEMS, sum / 2 / PROBLEMS);
    assert_int_equal(solved, 2 * PROBLEMS);
    assert_true(sum / 2 / PROBLEMS >= 10.5);
}

// Lanczos1 to 3 are sums of three exponentials: found from no start.
static void no_start_values(void **state)
{
    (void)state;
    static const char *const names[] = {"Lanczos1", "Lanczos2", "Lanczos3"};
    for (int i = 0; i < 3; i++) {
        alb_error error = {0};
        alb_readings readings = {0};
        alb_operator forward = {0};
        alb_basis basis = {0};
        nist p = {.model = lanczos};
        read_problem(&p, names[i]);
        check_ok(alb_readings_create(&readings, p.rows, &error), &error);
        for (int k = 0; k < p.rows; k++) {
            readings.r_mm[k] = (double)p.x[k][0];
            readings.value[k] = (double)p.y[k];
            readings.sd[k] = readings.area_mm2[k] = 1;
            readings.outer_mm = (double)p.x[k][0];
        }
        check_ok(alb_operator_identity(&forward, &readings, &error), &error);
        check_ok(alb_basis_create(&basis, &readings, &forward, &error), &error);
        const alb_weighing weighing = {&readings, &forward, readings.sd, 0};
        alb_profile found = {0};
        double chi_square;
        bool any;
        check_ok(alb_search(&found, &chi_square, &any, (alb_candidate){ALB_FORM_THREE_EXPONENTIALS, false}, &basis,
                            &weighing, &error),
                 &error);
        assert_true(any);
        const double correct = fewest(found.parameters, p.certified, p.parameters);
        print_message("%s from no start: %.1f digits, residual sum of squares %.10g\n", names[i], correct, chi_square);
        assert_true(correct >= 10);
        alb_basis_free(&basis);
        alb_operator_free(&forward);
        alb_readings_free(&readings);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(certified_problems),
        cmocka_unit_test(no_start_values),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

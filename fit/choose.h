// The simplest form that the noise does not reject, and what is known of it.
#pragma once
#include "fit/form_search.h"
#include "fit/sensitivity.h"
#include "fit/uncertainty.h"

enum { ALB_ATTEMPTS_MAX = 10, ALB_REASON_SIZE = 320 };

typedef struct alb_attempt {
    alb_form form;
    bool tied;              // decay_2 held at 1.1 decay_1 (search.h)
    double chi_square, bic; // by the noise alone, as all of these; NaN where the form was not fitted
    int degrees_of_freedom;
    double p_value;        // P(chi-square) at least as large
    double lag_1, lag_1_p; // correlation of neighbouring whitened residuals, and P of one as large in white noise
    int at_bound;          // parameter that lies on a bound of the search; -1: none
    double bic_excess;     // over that of the form chosen; negative where a smaller one was given up
    char rejected[ALB_REASON_SIZE]; // empty: the one that was chosen
} alb_attempt;

typedef struct alb_outcome {
    alb_fitted fitted;
    bool tied; // three free parameters: the covariance is of rank 3
    alb_attempt attempts[ALB_ATTEMPTS_MAX];
    int attempt_count;           // others than one and two exponentials are tried only where these do not stand
    double discrepancy_relative; // 0: the form fits within the noise
    double rms_relative;         // (measured - fitted) / fitted over the readings above 3 sd
    // Transmission: light that came straight through, in readings left out to ballistic_to_mm; 0: none found.
    double ballistic_share, ballistic_sd, ballistic_to_mm;
    double measured_share;                                     // share of the total within the readings
    double slope_per_mm, slope_sd, slope_from_mm, slope_to_mm; // d ln S / dr over the outer half of the readings
    alb_knowledge knowledge;
    alb_sensitivity sensitivity;           // of the total to the range of the readings
    double offset, offset_sd;              // taken off all readings before (offset.h); sd 0: none was
    char offset_instead[ALB_BECAUSE_SIZE]; // a constant would do as well; empty where not
    double free_total;                     // before the energy was held (energy.h)
    double energy_rise;                    // of chi-square, to hold it; of all sides of the channel
    char undecided[ALB_REASON_SIZE];       // why the data do not decide; empty where they do (fitted.identifiable)
} alb_outcome;

// Relative standard deviations of what all readings share: the incident flux, a factor of all values; and the unit of
// length, which scales decays by 1 / (1 + e), amplitudes by 1 / (1 + e)^2 and leaves the total as it is.
typedef struct alb_common_sd {
    double flux, length;
} alb_common_sd;

// ALB_UNDECIDED where there are fewer than 3 readings;
// where the data do not decide between parameters it succeeds, with the best guess and the reason.
bool alb_choose(alb_outcome *outcome, const alb_readings *readings, const alb_operator *forward, alb_common_sd common,
                alb_error *error);

// The same in two steps; the second is most of the work where no form stands against the noise. Borrows the readings
// and the operator; free it after a first step that succeeded. Zero is empty.
typedef struct alb_choice {
    const alb_readings *readings;
    const alb_operator *forward;
    alb_common_sd common;
    int chosen; // of outcome->attempts; -1: none stands against the noise
    struct alb_choice_fit *fits;
    double *sd;
    alb_bases bases;
} alb_choice;

// What every form comes to by the noise, and which stands.
bool alb_choice_by_noise(alb_choice *choice, alb_outcome *outcome, const alb_readings *readings,
                         const alb_operator *forward, alb_common_sd common, alb_error *error);
// The rest of the outcome, with a discrepancy where none stands.
bool alb_choice_complete(alb_choice *choice, alb_outcome *outcome, alb_error *error);
void alb_choice_free(alb_choice *choice);

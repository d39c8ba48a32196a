// Where the search for the parameters of a form starts: the best places of a grid of decays.
#pragma once
#include "fit/search.h"

enum { ALB_STARTS_MAX = 8, ALB_TERMS_MAX = ALB_PARAMETERS_MAX / 2 };

typedef struct alb_start {
    double gain;               // how much it lowers chi-square from that of nothing
    int column[ALB_TERMS_MAX]; // of the basis; -1 behind the last term
    double amplitude[ALB_TERMS_MAX];
} alb_start;

// The best few that are not neighbours of a better one, five or, of three terms, eight; *count 0 where no amplitudes
// have the signs of the form.
bool alb_starts_find(alb_start best[ALB_STARTS_MAX], int *count, alb_candidate candidate, const alb_basis *basis,
                     const alb_weighing *weighing, alb_error *error);

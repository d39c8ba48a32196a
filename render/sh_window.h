// Windows against ringing: a band-limited function swings below and above the one it stands for. Basis as in sh.h.
#pragma once
#include "base/error.h"
#include "render/sh.h"

// Times 1 / (1 + strength l^2 (l + 1)^2) in band l: what minimises error plus strength times the squared Laplacian
// (Sloan 2008). The mean stays, energy (the sum of squares) falls.
void alb_sh_window(double *coefficients, int order, double strength);

// The least value over the sphere, and where (may be NULL). Order up to ALB_SH_ORDER_MAX.
double alb_sh_minimum(alb_vector *where, const double *coefficients, int order);

typedef struct alb_sh_dering_report {
    double strength;                // 0: nothing was to be done
    double minimum_before, minimum; // over the sphere
    double energy;                  // the part of the sum of squares that is left
} alb_sh_dering_report;

// The weakest window (to 1e-3 of its strength) that keeps the function at `least` or above everywhere; `report` may be
// NULL. Bad data where the mean itself is below, or what is not finite; the coefficients are then as they were.
bool alb_sh_dering(double *coefficients, alb_sh_dering_report *report, int order, double least, alb_error *error);

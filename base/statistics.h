// The few statistics that more than one stage needs.
#pragma once
#include <stddef.h>

// P(chi-square with `dof` degrees of freedom >= chi_square): the regularised incomplete gamma function Q(dof/2, x/2).
double alb_chi_square_tail(double chi_square, double dof);
// Median; sorts the values in place. NaN for none.
double alb_median(double *values, size_t count);

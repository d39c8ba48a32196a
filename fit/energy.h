// Energy: what leaves through both faces of a sample is no more than what came in.
#pragma once
#include "fit/measurement.h"

// Where the totals of a channel's sides together exceed 1, holds them there: the best fits whose totals are 1 together,
// or all amplitudes scaled where the sd of the incident flux explains it better; whichever raises chi-square less. The
// outcomes keep the free totals and the rise. A rise beyond 10.83 (1 in 1000) is no noise: where the fitting is
// absolute the outcomes are then marked as not decided, with the numbers; where it is not, its unit is not the incident
// flux and it is left as it is. In the end no material that is marked as identifiable, and none that is absolute,
// exceeds 1.
bool alb_energy_hold(alb_fitting *fitting, int channel, alb_error *error);

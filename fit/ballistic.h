// Transmission through a slab so thin that light comes through without having scattered.
#pragma once
#include "fit/choose.h"

// Looks for it where the outcome (alb_choose) follows the readings badly, or not with parameters that they decide, or
// with a term as narrow as the spot. Where a form that is fitted beyond the light that falls in straight is better, the
// outcome becomes that one's, and what lies above it inside is its ballistic share. Fails only for want of memory.
bool alb_ballistic_find(alb_outcome *outcome, const alb_readings *readings, const alb_operator *forward,
                        alb_common_sd common, alb_error *error);

// Transmission through a slab so thin that light comes through without having scattered.
#pragma once
#include "fit/choose.h"

// As alb_choose. Where no form follows the readings, or not with parameters that they decide, but one does that is
// fitted beyond the light that falls in straight, that one is taken, and what lies above it inside is the outcome's
// ballistic share.
bool alb_choose_behind(alb_outcome *outcome, const alb_readings *readings, const alb_operator *forward,
                       alb_common_sd common, alb_error *error);

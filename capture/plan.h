// A plan as JSON: the same keys stand in PLAN.json and, in full, inside session.json.
#pragma once
#include "capture/session.h"

// Reads and checks the keys sample, white_reference, board and shots of `object`; other keys are the caller's affair.
bool alb_plan_parse(alb_plan *plan, alb_node object, alb_error *error);
// Writes the same keys into the open object; obtained exposures are not part of a plan.
void alb_plan_put(alb_json *json, const alb_plan *plan);

// What material.json holds beside the numbers that are read from it.
#pragma once
#include "base/record.h"

// Whether the descriptive members of one side of a channel, as many as are there, are of their type: numbers finite or
// null, texts, tables of forms tried. A member of another name, or of another type: ALB_BAD_DATA with its place.
bool alb_outcome_check(alb_node side, alb_error *error);
// The same of an estimate: value, sd, interval_95, cramer_rao_sd, identifiable, because.
bool alb_estimate_check(alb_node object, const char *key, alb_error *error);

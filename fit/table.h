// A measured profile from a CSV file.
#pragma once
#include "fit/observe.h"

// Header "r_mm,value_per_mm2" or "r_mm,value_per_mm2,sd_per_mm2", then one reading a line, distances rising. Strict:
// what is wrong is named with file, line and column (ALB_BAD_DATA). Values at points: each sample is its own distance.
bool alb_table_read(alb_readings *readings, const char *path, alb_error *error);
// The same from bytes; `name` is what errors call them.
bool alb_table_parse(alb_readings *readings, const char *name, const char *bytes, alb_error *error);

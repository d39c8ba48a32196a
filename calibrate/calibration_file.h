// Writing calibration.json: what only calibrate does.
#pragma once
#include "calibrate/calibration.h"

// The object "lens": each parameter as {value, sd}, the size and the rms.
void alb_lens_write(alb_json *json, const alb_lens *lens, const double sd[9], double rms_px);
// Writes calibration.json inside calibration->folder.
bool alb_calibration_write(const alb_calibration *calibration, const alb_provenance *provenance, alb_error *error);

// The lens and the poses of a session from its photographs of the board.
#pragma once
#include "calibrate/calibration.h"
#include "calibrate/target.h"

// Fills calibration->views, lens_sd and lens_rms_px; `views` (freed by the caller) keeps what was found, view by view.
bool alb_geometry_measure(alb_calibration *calibration, alb_board_views *views, const alb_session *session,
                          alb_error *error);
// The lens alone from all pictures of a folder, in the order of their names.
bool alb_geometry_photographs(alb_lens_estimate *estimate, alb_board_views *views, const char *folder,
                              const alb_board *board, alb_error *error);
// Prints a line per photograph: name, rms or "board not found".
void alb_geometry_print(const alb_board_views *views);

// Frames of a session, checked: the sizes and channels that session.json states, every value a number.
#pragma once
#include "base/image.h"
#include "capture/session.h"

bool alb_frame_read(alb_image *frame, const alb_session *session, const alb_shot *shot, int exposure, int repeat,
                    alb_error *error);

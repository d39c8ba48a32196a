// One frame, held against what session.json says of all.
#include "calibrate/frames.h"
#include <math.h>
#include <string.h>

bool alb_frame_read(alb_image *frame, const alb_session *session, const alb_shot *shot, int exposure, int repeat,
                    alb_error *error)
{
    char path[ALB_PATH_SIZE];
    *frame = (alb_image){0};
    if (!alb_session_frame(path, session, shot, exposure, repeat, error) || !alb_image_read(frame, NULL, path, error))
        return false;
    const bool same_size =
        frame->width == session->width && frame->height == session->height && frame->channels == session->channels;
    bool same_names = true;
    for (int c = 0; same_size && c < frame->channels; c++)
        same_names &= !strcmp(frame->name[c], session->channel_names[c]);
    size_t bad = 0;
    const size_t count = (size_t)frame->width * (size_t)frame->height * (size_t)frame->channels;
    for (size_t i = 0; i < count; i++)
        bad += isfinite(frame->pixels[i]) ? 0 : 1;
    if (!same_names)
        alb_fail(error, ALB_BAD_DATA, "%s: its channels do not have the names that session.json says (%s%s%s)", path,
                 session->channel_names[0], session->channels > 1 ? ", " : "", session->channel_names[1]);
    else if (!same_size)
        alb_fail(error, ALB_BAD_DATA, "%s: %d x %d with %d channels, but session.json says %d x %d with %d", path,
                 frame->width, frame->height, frame->channels, session->width, session->height, session->channels);
    else if (bad)
        alb_fail(error, ALB_BAD_DATA, "%s: %zu values are not numbers; a raw frame holds only numbers", path, bad);
    else
        return true;
    alb_image_free(frame);
    return false;
}

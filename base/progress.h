// One line of progress with the time left, on a terminal; silent elsewhere. Call from one thread.
#pragma once

typedef struct alb_progress {
    const char *label;
    double start_s, last_s;
    long total;
} alb_progress;

void alb_progress_begin(alb_progress *progress, const char *label, long total);
void alb_progress_at(alb_progress *progress, long done);
void alb_progress_end(alb_progress *progress);
// Seconds of a monotonic clock: for stage timings.
double alb_clock_s(void);

// Progress on a terminal: one line, rewritten at most ten times a second, with the time left estimated from the pace so
// far (linear in the work done; wrong where later steps cost more).
#include "base/progress.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

double alb_clock_s(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

static int on_terminal(void)
{
    const char *kind = getenv("TERM");
    return isatty(STDERR_FILENO) && kind && strcmp(kind, "dumb") != 0;
}

void alb_progress_begin(alb_progress *progress, const char *label, long total)
{
    *progress = (alb_progress){.label = label, .start_s = alb_clock_s(), .total = total};
    progress->last_s = progress->start_s;
}

void alb_progress_at(alb_progress *progress, long done)
{
    const double now_s = alb_clock_s();
    if (now_s - progress->last_s < 0.1 || done <= 0 || progress->total <= 0 || !on_terminal())
        return;
    progress->last_s = now_s;
    const double share = done < progress->total ? (double)done / (double)progress->total : 1;
    const long left_s = (long)((now_s - progress->start_s) * (1 - share) / share + 0.5);
    fprintf(stderr, "\r\033[K%s %3.0f %%, %ld:%02ld left", progress->label, 100 * share, left_s / 60, left_s % 60);
    fflush(stderr);
}

void alb_progress_end(alb_progress *progress)
{
    if (progress->last_s > progress->start_s && on_terminal()) {
        fputs("\r\033[K", stderr);
        fflush(stderr);
    }
    *progress = (alb_progress){0};
}

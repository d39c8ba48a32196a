// Which pixels faces cover, row by row: of up to ALB_SHADOW_FACES faces at once, an array for each figure, which vector
// units take eight at a time. Pixels are as in alb_shadow_corners. Internal to render/shadow_view.c.
#pragma once
#include "render/shadow_view.h"

enum { ALB_SHADOW_FACES = 128 };

typedef struct alb_shadow_rows {
    float x[3][ALB_SHADOW_FACES], y[3][ALB_SHADOW_FACES]; // corners of all the faces given
    int count;                                            // of those that may cover the centre of a pixel
    int32_t faces[ALB_SHADOW_FACES];                      // which they are
    // Of these: the uppermost corner and the next below it; how far x goes a row along the edges from the uppermost to
    // the lowest corner, to the next, and from there to the lowest; the first row below each corner.
    float upper_x[ALB_SHADOW_FACES], upper_y[ALB_SHADOW_FACES], middle_x[ALB_SHADOW_FACES], middle_y[ALB_SHADOW_FACES];
    float along[ALB_SHADOW_FACES], above[ALB_SHADOW_FACES], below[ALB_SHADOW_FACES];
    int32_t top[ALB_SHADOW_FACES], middle[ALB_SHADOW_FACES], bottom[ALB_SHADOW_FACES];
} alb_shadow_rows;

// With fronts_only, of faces that show their front alone.
void alb_shadow_rows_set(alb_shadow_rows *rows, const alb_shadow_corners *corners, const uint32_t (*faces)[3],
                         int count, bool fronts_only);

// The first pixel whose centre lies beyond the coordinate; coordinates are in 0..pixels up to rounding.
static inline int alb_shadow_first_beyond(float at) { return (int)(at + 0.5f); }

// The pixels run[0] up to below run[1] that face n of those counted covers, of a row from top[n] up to below bottom[n].
static inline void alb_shadow_rows_run(int run[2], const alb_shadow_rows *r, int n, int row)
{
    const float y = (float)row + 0.5f, one = r->upper_x[n] + (y - r->upper_y[n]) * r->along[n],
                other = row < r->middle[n] ? r->upper_x[n] + (y - r->upper_y[n]) * r->above[n]
                                           : r->middle_x[n] + (y - r->middle_y[n]) * r->below[n];
    run[0] = alb_shadow_first_beyond(one < other ? one : other);
    run[1] = alb_shadow_first_beyond(one > other ? one : other);
}

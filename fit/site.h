// Where the spots of a projected grid lie on a face.
#pragma once
#include "fit/observe.h"

typedef struct alb_site {
    double x_mm, y_mm;
    double reach_mm; // half the distance to the nearest other spot; half the way to the border where there is none
} alb_site;

// Finds columns * rows spots, row by row from the top (largest y), each row from small x to large; `mirrored` (the face
// is seen from behind): from large x to small. ALB_BAD_DATA says how many there are where it is another number, and
// where rows cannot be told apart (the grid is turned against the face's axes by more than about pitch / width).
bool alb_sites_find(alb_site *sites, int columns, int rows, bool mirrored, const alb_channel *channel,
                    alb_error *error);

// Puts the sites seen on the far face where the known ones of the near face are, mirrored, turned and shifted as a
// whole so that they lie best on those seen: light that has spread through the slab and over its neighbours' moves
// each, all together but little.
void alb_sites_align(alb_site *seen, const alb_site *known, int count);

// The part of a face and of a channel on it within the site's reach; everything else NaN, values times `factor`.
// Free the face with alb_face_free, value and variance with free().
bool alb_site_cut(alb_face *face, double **value, double **variance, const alb_site *site, double factor,
                  const alb_channel *channel, alb_error *error);

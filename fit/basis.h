// What all profiles read at the same places share: columns of readings of e^(-b r) on a grid of decays b, and the
// effective distances from which they follow for any b.
#pragma once
#include "fit/operator.h"

enum { ALB_LANES = 4 }; // that sums over rows are taken in

// Arrays of `rows` hold the readings, behind them room for their energy (sum value * area), and zeros up to a multiple
// of four. Zero is empty.
typedef struct alb_basis {
    int count, rows;
    double lowest, highest;   // bounds of ln b, b in 1/mm
    int nodes;                // of the grid on which a search starts
    double first, step;       // ln b of its first node, and between nodes
    double *column;           // nodes x rows: readings of e^(-b r) at the nodes
    double *tied;             // the same at ALB_TIED_RATIO b
    double *distance, *slope; // fine nodes x rows: rho(ln b) in mm and its derivative; slope NULL: one row of distances
    int fine_nodes;           // from `lowest` on
    double fine_step;
    double *share, *area_mm2; // rows: reading of S = 1; area that a reading stands for
    int *group;               // readings [group[g], group[g + 1]) are one of `merged`
    struct alb_basis *merged; // of neighbouring readings merged, for the first steps of a search; NULL there
} alb_basis;

bool alb_basis_create(alb_basis *basis, const alb_readings *readings, const alb_operator *forward, alb_error *error);
void alb_basis_free(alb_basis *basis);
// rho, rho + rho', rho + 2 rho' + rho'' at x = ln b, rows each, where the basis has a table.
void alb_basis_distances(double *distances, const alb_basis *basis, double ln_decay);

// The readings of a slab's two faces as a least-squares problem (joint.c): which of them count, what they weigh, and
// what the slab's light makes of them. Parts of alb_joint_fit alone.
#pragma once
#include "fit/joint.h"

enum { ALB_JOINT_PRIORS = ALB_JOINT_PARAMETERS - ALB_JOINT_ANISOTROPY };
// The model's accuracy, one sd, shared by the readings within a span of ln r; and how near the beam they may be, in
// transport mean free paths.
static const double alb_joint_accuracy = 1.5e-3, alb_joint_span = 0.2, alb_joint_near_mfp = 0.5;

// One row: a reading, the face it is of, its row of the operator and the sd to weigh it with.
typedef struct alb_joint_row {
    int side, index, neighbours;    // that share its error of the model
    double r_mm, value, sd, weight; // weight: 1 / sd with the model's accuracy
} alb_joint_row;

typedef struct alb_joint_problem {
    const alb_joint_side *sides;
    const alb_joint_known *known;
    alb_joint_row *rows;
    int count; // of rows; what is known of g and the factors are ALB_JOINT_PRIORS more residuals
    double prior[ALB_JOINT_PRIORS], prior_sd[ALB_JOINT_PRIORS], end_mm, point[ALB_JOINT_PARAMETERS];
    double (*on_grid)[ALB_OPERATOR_COLUMNS], (*columns[ALB_SIDES])[ALB_OPERATOR_COLUMNS];
} alb_joint_problem;

// Rows, columns and grid for all readings, and a Jacobian with room for the residuals behind it.
bool alb_joint_problem_create(alb_joint_problem *p, double **jacobian, alb_error *error);
void alb_joint_problem_free(alb_joint_problem *p);
alb_slab alb_joint_slab_at(const alb_joint_known *known, const double *parameters);
// Every reading with an sd; those within the spot too.
void alb_joint_collect(alb_joint_problem *p);
// The best of a grid by diffusion (diffusion.h), which is wrong by tens of percent but never lost.
void alb_joint_start(double parameters[ALB_JOINT_PARAMETERS], const alb_joint_problem *p);
// Keeps what is far enough from the beam for the parameters, and weighs it.
void alb_joint_choose_rows(alb_joint_problem *p, const double *parameters);
// With the model's accuracy and the discrepancy in the sd.
void alb_joint_weigh(alb_joint_problem *p, double discrepancy);
// What the slab at the parameters, and those a step to either side, make of the readings: what alb_joint_evaluate
// continues from.
bool alb_joint_evaluate_sides(alb_joint_problem *p, const double *parameters, alb_error *error);
// Residuals (count + ALB_JOINT_PRIORS) and, where wanted, their derivatives near the point where the sides were last
// evaluated: ln(W S) as linear in ln sigma_a, ln sigma_s' and g. An evaluation for alb_solve; context: the problem.
void alb_joint_evaluate(double *residuals, double *jacobian, const double *parameters, const void *context);

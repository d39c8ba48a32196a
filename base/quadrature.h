// Nodes and weights of integration over an interval.
#pragma once

// Gauss-Legendre; exact for polynomials of degree 2 count - 1. Nodes rise. count from 1 to 64.
void alb_quadrature_gauss(double *node, double *weight, int count, double from, double to);
// Gauss-Radau with the last node at `to`; degree 2 count - 2. count from 2 to 64.
void alb_quadrature_radau(double *node, double *weight, int count, double from, double to);

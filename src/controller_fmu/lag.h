/* First-order lag T dy/dt + y = u of a sampled signal, discretised with a first-order hold: exact for an input that is
 * linear between its samples (ramp-invariant).
 *
 *   y_k = y_k-1 + c_0 (u_k-1 - y_k-1) + c_1 (u_k - u_k-1),   c_0 = 1 - exp(-h/T),   c_1 = 1 - c_0 T/h
 *
 * Written in differences, so that the gain at 0 Hz is exactly 1 whatever the rounding of c_0 and c_1. No FMI. */
#ifndef FEEDSIM_LAG_H
#define FEEDSIM_LAG_H

#include "prefix.h"

#define lag_of PREFIXED(lag_of)
#define lag_settle PREFIXED(lag_settle)
#define lag_step PREFIXED(lag_step)

typedef struct Lag {
    double c_0, c_1; /* [1] */
} Lag;

typedef struct LagState {
    double u, y; /* input and output at the last sample, in the unit of the signal */
} LagState;

/* Time constant T >= 0 [s] (0 hands the input through), sampling time h > 0 [s]. */
Lag lag_of(double T, double h);

/* Settled at `value`, as after a long time of constant input. */
void lag_settle(LagState *x, double value);

/* Take in the present sample u and return y. */
double lag_step(const Lag *p, LagState *x, double u);

#endif

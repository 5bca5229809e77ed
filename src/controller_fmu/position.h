/* Position controller with speed feedforward, dynamic matching and symmetry filter; works every T_pos.
 *
 *   n_new = (K_v x_e + k_ffw I_P n_ffw(t - T_dyn)) / I_P
 *   x_e   = x_s(t - T_dyn - T_sym) - x_a                        T_sym as a dead time
 *   x_e   = lag(T_sym) of x_s(t - T_dyn) - x_a                  T_sym as a first-order lag
 *
 * T_dyn (matching) makes the slower drives' delay common to all axes of a path; T_sym (symmetry) delays the position
 * setpoint by the time that the speed loop takes to follow the feedforward. The delays of the position setpoint are
 * added and applied once. Source: the paper's section 2.2. No FMI. */
#ifndef FEEDSIM_POSITION_H
#define FEEDSIM_POSITION_H

#include <stdbool.h>

#include "delay.h"
#include "lag.h"
#include "prefix.h"

#define position_of PREFIXED(position_of)
#define position_start PREFIXED(position_start)
#define position_step PREFIXED(position_step)

typedef struct PositionParameters {
    double T_pos;      /* cycle [s] */
    double I_P;        /* lead, pitch / (2 pi) [m/rad] */
    double K_v;        /* gain [1/s] */
    double k_ffw;      /* weight of the feedforward [1] */
    double T_dyn;      /* dynamic matching [s] */
    double T_sym;      /* symmetry filter [s] */
    bool symmetry_lag; /* symmetry filter as a first-order lag instead of a dead time */
} PositionParameters;

typedef struct Position {
    double I_P, K_v, k_ffw;
    Delay x_delay; /* of the position setpoint, over T_pos samples */
    Delay n_delay; /* of the feedforward, over T_pos samples */
    bool symmetry_lag;
    Lag lag;
} Position;

typedef struct PositionState {
    double x_e; /* following error at the last position instant [m] */
    LagState lag;
    int32_t x_newest, n_newest;
} PositionState;

Position position_of(const PositionParameters *parameters);

/* The past before the first instant: the setpoint stood at x_s [m], the feedforward was 0. The rings hold
 * p->x_delay.length samples [m] and p->n_delay.length samples [rad/s]. */
void position_start(const Position *p, PositionState *x, double *x_ring, double *n_ring, double x_s);

/* One position instant: x_s [m], n_ffw [rad/s], x_a [m] -> speed setpoint n_new [rad/s]. */
double position_step(const Position *p, PositionState *x, double *x_ring, double *n_ring, double x_s, double n_ffw,
                     double x_a);

#endif

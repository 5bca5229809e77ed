/* Torques of the motor that repeat with its turn: cogging, which needs no current, and torque ripple, which goes with
 * it.
 *
 *   M_a = M (1 + sum r_j sin(theta_j)) + sum A_j sin(theta_j)      theta_j = k_j phi + psi_j
 *   phi = integral of n_a from the start on                        k_j order, psi_j phase
 *
 * M: torque of the motor's equations. The speed runs linearly between the instants, so that the integral up to t_k is
 * exact: T_c (n(t_k-1) + n(t_k))/2 a cycle. What acts at t_k+1 takes the angle that the last slope leads to. Each angle
 * is kept within a turn of its own, also of orders that are no whole numbers (a screw behind a gear), so that a day at
 * speed costs no digits. Pure functions, no FMI. */
#ifndef FEEDSIM_ORDERS_H
#define FEEDSIM_ORDERS_H

#include <stdint.h>

#include "prefix.h"

#define orders_add PREFIXED(orders_add)
#define orders_turn PREFIXED(orders_turn)
#define orders_torque PREFIXED(orders_torque)
#define orders_too_fast PREFIXED(orders_too_fast)
#define angle_within_turn PREFIXED(angle_within_turn)

enum { ORDERS_EACH = 3, ORDERS_MOST = 2 * ORDERS_EACH };

typedef struct Order {
    double order;     /* per turn of the motor [1] */
    double amplitude; /* A [N.m], or r [1] */
    double phase;     /* psi [rad] */
    int32_t ripple;   /* goes with the torque; 0: cogging */
} Order;

typedef struct Orders {
    int32_t count; /* 0: off */
    Order at[ORDERS_MOST];
} Orders;

typedef struct OrdersState {
    double theta[ORDERS_MOST]; /* at the last instant [rad] */
    double ahead[ORDERS_MOST]; /* at the end of the cycle that it opened */
    double n;                  /* speed then [rad/s] */
    int64_t turning;           /* there was an instant; 0 or not */
} OrdersState;

/* Enter a torque; one whose amplitude is 0 is left out. */
void orders_add(Orders *p, double order, double amplitude, double phase, int32_t ripple);

/* An instant with speed n [rad/s]: the angles there and a cycle of T_c [s] later. */
void orders_turn(const Orders *p, OrdersState *x, double n, double T_c);

/* M [N.m] with what is added to it, at the angles theta[p->count]. */
double orders_torque(const Orders *p, const double *theta, double M);

/* The highest order whose frequency at speed n is above a fifth of the sampling rate 1/T_c; 0: none. */
double orders_too_fast(const Orders *p, double n, double T_c);

/* An angle [rad] less whole turns; 0 for one that no longer says where in the turn it is. */
double angle_within_turn(double angle);

#endif

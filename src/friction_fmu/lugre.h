/* LuGre friction with a Stribeck and a logarithmic part, motor side: rad, rad/s, N.m.
 *
 *   M_fr  = k sigma_0 z + sigma_1 dz/dt + sigma_2 n                                                  (1)
 *   dz/dt = n - |n| / g(n) z                                                                         (6)
 *   g(n)  = (1 + a sgn n) (F_C + (F_S - F_C) exp(-(|n|/v_s)^beta) + F_log ln(|n|/v_log + 1)) / sigma_0   (7)
 *
 * Source: Wiesauer, Bleicher, 18th CIRP CMMO (2021); equation numbers are the paper's. The print of (7) lacks the exp;
 * the factor with the asymmetry a is an addition. k comes from the transmission engaging model (tem.h); k = 1 is pure
 * LuGre. Pure functions: no memory, no FMI. */
#ifndef FEEDSIM_LUGRE_H
#define FEEDSIM_LUGRE_H

#include <stdbool.h>

#include "prefix.h"

#define lugre_shape PREFIXED(lugre_shape)
#define lugre_shares_shape PREFIXED(lugre_shares_shape)
#define lugre_level PREFIXED(lugre_level)
#define lugre_level_of PREFIXED(lugre_level_of)
#define lugre_level_slope PREFIXED(lugre_level_slope)
#define lugre_advance PREFIXED(lugre_advance)
#define lugre_rate PREFIXED(lugre_rate)
#define lugre_torque PREFIXED(lugre_torque)
#define lugre_torque_by_speed PREFIXED(lugre_torque_by_speed)

typedef struct Lugre {
    double sigma_0;   /* bristle stiffness [N.m/rad], > 0 */
    double sigma_1;   /* bristle damping [N.m.s/rad] */
    double sigma_2;   /* viscous coefficient [N.m.s/rad] */
    double F_C, F_S;  /* Coulomb and static torque [N.m], 0 < F_C <= F_S */
    double v_s;       /* Stribeck speed [rad/s], > 0 */
    double beta;      /* Stribeck exponent [1], > 0 */
    double F_log;     /* factor of the logarithmic rise [N.m] */
    double v_log;     /* reference speed of the logarithmic rise [rad/s], > 0 */
    double asymmetry; /* a [1], |a| < 1 */
} Lugre;

/* What costs most of g at a speed, and depends on beta, v_s and v_log alone. */
typedef struct LugreShape {
    double fall; /* exp(-(|n|/v_s)^beta) [1] */
    double rise; /* ln(|n|/v_log + 1) [1]; 0 where F_log is 0 */
} LugreShape;

LugreShape lugre_shape(const Lugre *p, double n);

/* Whether both have the same shape at every speed. */
bool lugre_shares_shape(const Lugre *p, const Lugre *q);

/* g(n) [rad], the bristle deflection at constant speed n [rad/s]; > 0. At n = 0 the value between both directions. */
double lugre_level(const Lugre *p, double n);

/* The same with its shape at n. */
double lugre_level_of(const Lugre *p, double n, LugreShape shape);

/* n dg/dn [rad]: the form that stays finite at n = 0 for every beta. */
double lugre_level_slope(const Lugre *p, double n);

/* z [rad] after h [s] at constant speed n, with g = g(n): Eq. 6 solved exactly. Taken at the mean speed of a step
 * within which the speed is linear and keeps its sign it is of second order, and stable for any h. */
double lugre_advance(double z, double n, double g, double h);

/* dz/dt [rad/s], Eq. 6, with g = g(n). */
double lugre_rate(double z, double n, double g);

/* M_fr [N.m], Eq. 1, with the share k of the bristle stiffness engaged and g = g(n). */
double lugre_torque(const Lugre *p, double k, double z, double n, double g);

/* Partial derivative of M_fr by n [N.m.s/rad], z and k held. At n = 0, where the derivative differs from side to side,
 * the mean of both sides for a = 0. */
double lugre_torque_by_speed(const Lugre *p, double z, double n);

#endif

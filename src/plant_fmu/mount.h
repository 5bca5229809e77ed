/* A levelling mount in one direction: elastic, friction and Maxwell element side by side.
 *
 *   F   = K_e x + F_f + F_v                                    x: deflection since the machine stood still; F acts
 * against F_f = F_s + d/(x_2 (1 - a) + d) (F_max - F_s)              d = x - x_s > 0,  a = F_s/F_max F_f = F_s + d/(x_2
 * (1 + a) - d) (F_max + F_s)              d < 0;  (x_s, F_s): the last reversal dF_v/dt = K_v (dx/dt - F_v/c)
 *
 * Source: M. Berg, "A non-linear rubber spring model for rail vehicle dynamics analysis", Vehicle System Dynamics 30
 * (1998) 197-212. F_f has the stiffness F_max/x_2 at rest and behind every reversal, and never reaches F_max. It is
 * exact for any x; a reversal inside a step is found on the cubic through places and speeds at its ends, so that the
 * loss does not hang on the step: of second order at least. Pure functions. */
#ifndef FEEDSIM_MOUNT_H
#define FEEDSIM_MOUNT_H

#include "prefix.h"

#define mount_friction PREFIXED(mount_friction)
#define mount_prepare PREFIXED(mount_prepare)
#define mount_move PREFIXED(mount_move)
#define mount_advance PREFIXED(mount_advance)
#define mount_force PREFIXED(mount_force)

typedef struct Mount {
    double K_e;        /* [N/m] */
    double F_max, x_2; /* [N], 0: no friction; [m] > 0: where half of F_max is reached from rest */
    double K_v, c;     /* [N/m], [N.s/m]; one of them 0: no viscous part */
    double h, relaxed; /* share of F_v that relaxes over steps of h, as mount_prepare() leaves it; h 0: no step's */
} Mount;

/* All numbers, so that it lies among those of a state. */
typedef struct MountState {
    double x;        /* [m] */
    double x_s, F_s; /* last reversal [m], [N] */
    double F_v;      /* [N] */
} MountState;

/* F_f at x [m] when the motion goes there from the last reversal without another. */
double mount_friction(const Mount *mount, const MountState *state, double x);

/* To x [m] without a reversal on the way; one where it begins is found. F_v stays. */
void mount_move(const Mount *mount, MountState *state, double x);

/* Ahead of many steps of h [s]: saves time, and changes no result. */
void mount_prepare(Mount *mount, double h);

/* Over h [s] > 0 to x [m], with the speeds v_0 and v_1 [m/s] at both ends. F_v is exact for a mean speed that is
 * held. */
void mount_advance(const Mount *mount, MountState *state, double x, double v_0, double v_1, double h);

/* F of a state [N]. */
double mount_force(const Mount *mount, const MountState *state);

#endif

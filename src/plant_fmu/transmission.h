/* Play with contact between a motor and what it drives: the rotor taken off the structure, and joined to it by a
 * contact with stiffness and damping.
 *
 *   J dn/dt = M_a - M_fr - C            the motor's side, of inertia J [kg.m2]: rotor, and what turns with it
 *   T       = C + J dn_s/dt             what the structure gets at the rotor's port: it holds J in its modes
 *   C       = c e + d de/dt             e = dead zone of half the play b of delta: delta -+ b/2 in contact, 0 between
 *   delta   = angle of the motor less that of the structure
 *
 * So a stiff contact without play leaves the structure as it is. Over a step C and T are held at their means: C as the
 * quotient of the spring's energy and the way, (V+ - V)/(delta+ - delta) + d (e+ - e)/h, J dn_s/dt as J (n_s+ - n_s)/h.
 * The step is implicit, of second order, stable for any stiffness, and work and energy agree to rounding: the discrete
 * gradient of O. Gonzalez, Time integration and discrete Hamiltonian systems, J. Nonlinear Science 6 (1996). A wave of
 * angular frequency omega has a period longer by (omega h)^2/12 of itself.
 *
 * Angles in rad, torques in N.m, all at the motor. Pure functions; the memory is the caller's. */
#ifndef FEEDSIM_TRANSMISSION_H
#define FEEDSIM_TRANSMISSION_H

#include <stdbool.h>
#include <stddef.h>

#include "prefix.h"

#define transmission_step PREFIXED(transmission_step)

typedef struct Transmission {
    bool on;
    double J;    /* [kg.m2] */
    double c, d; /* [N.m/rad], [N.m.s/rad] */
    double half; /* b/2 [rad] */
    double lead; /* for who shows it at the slide [m/rad] */
} Transmission;

/* All numbers, so that it lies among those of a state. */
typedef struct TransmissionState {
    double angle, n;     /* of the motor [rad], [rad/s] */
    double angle_s, n_s; /* of the structure at the rotor's port, which the caller writes */
    double C;            /* torque of the contact at the end of the step [N.m] */
    double T;            /* mean torque on the structure over the last step [N.m] */
    double u;            /* M_a - M_fr at the end of the step [N.m] */
    double heat;         /* of the damping since the start [J] */
} TransmissionState;

/* Advance over h [s] > 0 from start[axes] to end[axes], whose T are the torques for the structure. u, du [axes]: M_a -
 * M_fr at the start, and its change. angle_free, n_free [axes]: the structure at the end of the step with T = 0;
 * by_angle, by_n [axes][axes]: what a held T of 1 of each axis (column) adds there. False where a torque is no finite
 * number. *settled: the torques agree with one another, to 1e-6 of the largest at least. */
bool transmission_step(size_t axes, const Transmission *p, const double *u, const double *du, const double *angle_free,
                       const double *n_free, const double *by_angle, const double *by_n, const TransmissionState *start,
                       TransmissionState *end, double h, bool *settled);

#endif

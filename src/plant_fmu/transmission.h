/* Play with contact between a motor and what it drives: the rotor taken off the structure, and joined to it by a
 * contact with stiffness and damping.
 *
 *   J dn/dt = M_a - M_fr - C            the motor's side, of inertia J [kg.m2]: rotor, and what turns with it
 *   T       = C + J dn_s/dt             what the structure gets at the rotor's port: it holds J in its modes
 *   C       = c e + d de/dt             e = dead zone of half the play b of delta: delta -+ b/2 in contact, 0 between
 *   delta   = angle of the motor less that of the structure
 *
 * So a stiff contact without play leaves the structure as it is. Over a step, C and T are straight lines with the mean
 * and the first moment of what they stand for: C along the cubic through delta and its speed at both ends, with the
 * instants at which it enters or leaves the contact; J dn_s/dt by n_s at the ends and the way between. The step is
 * implicit and symmetric in time: of fourth order while the contact holds, and the energy of a free contact stays
 * within bounds. It settles where transmission_rate() times h is small; the caller sees to that.
 *
 * Angles in rad, torques in N.m, all at the motor. Pure functions; the memory is the caller's. */
#ifndef FEEDSIM_TRANSMISSION_H
#define FEEDSIM_TRANSMISSION_H

#include <stdbool.h>
#include <stddef.h>

#include "prefix.h"

#define transmission_rate PREFIXED(transmission_rate)
#define transmission_step PREFIXED(transmission_step)

typedef struct Transmission {
    bool on;
    double J;    /* [kg.m2] */
    double c, d; /* [N.m/rad], [N.m.s/rad] */
    double half; /* b/2 [rad] */
    double lead; /* for who shows it at the slide [m/rad] */
    double rate; /* of it, transmission_rate() [1/s] */
} Transmission;

/* All numbers, so that it lies among those of a state. */
typedef struct TransmissionState {
    double delta;   /* [rad] */
    double n;       /* of the motor [rad/s] */
    double n_s;     /* of the structure at the rotor's port, which the caller writes */
    double C;       /* torque of the contact at the end of the step [N.m] */
    double T, ramp; /* torque on the structure over the last step: its mean, and its change over it [N.m] */
    double u;       /* M_a - M_fr at the end of the step [N.m] */
    double heat;    /* of the damping since the start [J] */
} TransmissionState;

/* What the structure shows at the rotors' ports at the end of a step. */
typedef struct TransmissionPorts {
    const double *way_free, *n_free;       /* [axes] with all T = 0: how far it turns, and its speed then */
    const double *by_way, *by_n;           /* [axes][axes] what a held T of 1 of each axis (column) adds */
    const double *by_way_ramp, *by_n_ramp; /* [axes][axes] the same of a T that runs from -1/2 to 1/2 */
} TransmissionPorts;

/* How fast the closed contact answers [1/s]: its angular frequency sqrt(c/J_r), or d/(2 J_r) where that is more;
 * J_r: of J and J_s side by side, J_s > 0 the inertia of the structure that answers at once, without J. */
double transmission_rate(const Transmission *p, double J_s);

/* Advance over h [s] > 0 from start[axes] to end[axes], whose T and ramp are the torques for the structure. u, du
 * [axes]: M_a - M_fr at the start, and its change. False where a torque is no finite number. *settled: the torques
 * agree with one another, to 1e-6 of the largest at least. */
bool transmission_step(size_t axes, const Transmission *p, const double *u, const double *du,
                       const TransmissionPorts *ports, const TransmissionState *start, TransmissionState *end, double h,
                       bool *settled);

#endif

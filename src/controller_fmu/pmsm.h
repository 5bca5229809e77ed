/* Permanent-magnet synchronous motor in rotor coordinates, amplitude-invariant.
 *
 *   L_d di_d/dt = u_d - R i_d + omega_e L_q i_q                       omega_e = p n
 *   L_q di_q/dt = u_q - R i_q - omega_e (L_d i_d + psi)               psi = K_t / (3/2 p)
 *   M = 3/2 p (psi i_q + (L_d - L_q) i_d i_q)
 *
 * Advanced exactly over a cycle in which voltage and speed are held:
 *
 *   i(t + h) = i(t) + h phi(Z) di/dt(t),   Z = h A,   phi(Z) = (exp(Z) - 1)/Z
 *
 * A 2 x 2 matrix satisfies Z^2 = tr Z - det (Cayley-Hamilton), so every function of it is f_0 + f_1 Z with two numbers.
 * phi is summed as its series for a Z halved until it is small, then doubled back. Unlike the forms by eigenvalues this
 * has no special cases (equal eigenvalues, R = 0, standstill, L_d != L_q) and nothing cancels. No FMI. */
#ifndef FEEDSIM_PMSM_H
#define FEEDSIM_PMSM_H

#include "prefix.h"

#define pmsm_flux_linkage PREFIXED(pmsm_flux_linkage)
#define pmsm_step PREFIXED(pmsm_step)
#define pmsm_torque PREFIXED(pmsm_torque)

typedef struct Pmsm {
    double R;        /* stator resistance [Ohm] >= 0 */
    double L_d, L_q; /* inductances [H] > 0 */
    double psi;      /* flux linkage [V.s] */
    double p;        /* pole pairs [1] */
} Pmsm;

typedef struct PmsmState {
    double i_d, i_q; /* [A] */
} PmsmState;

/* psi [V.s] from the torque constant K_t [N.m/A] and the pole pairs p. */
double pmsm_flux_linkage(double K_t, double p);

/* Advance by h [s] at voltages u_d, u_q [V] and speed n [rad/s], all held. */
void pmsm_step(const Pmsm *p, PmsmState *x, double u_d, double u_q, double n, double h);

/* M [N.m]. */
double pmsm_torque(const Pmsm *p, const PmsmState *x);

#endif

/* Current controller in rotor coordinates: one PI per axis, decoupling, feedforward of the electromotive force, limit
 * of the voltage's amplitude. e_d = -i_d (the d setpoint is 0), e_q = i_q_s - i_q, omega_e = p n_a, all at t_k:
 *
 *   I_d += K_p T_c/T_n e_d                     I_q += K_p T_c/T_n e_q
 *   u_d  = K_p e_d + I_d - omega_e L_q i_q     u_q  = K_p e_q + I_q + omega_e (L_d i_d + psi)
 *   (u_d', u_q') = (u_d, u_q) min(1, u_max/|u|)
 *   I_d += min(1, T_c/T_n) (u_d' - u_d)        I_q likewise: anti-windup by the realised voltage
 *
 * The voltage is stored: it acts on [t_k+1, t_k+2], one T_c of computing delay. No FMI. */
#ifndef FEEDSIM_CURRENT_H
#define FEEDSIM_CURRENT_H

#include "pmsm.h"
#include "prefix.h"

#define current_of PREFIXED(current_of)
#define current_step PREFIXED(current_step)

typedef struct CurrentController {
    double K_p;      /* [V/A] */
    double K_i;      /* K_p T_c/T_n [V/A] */
    double tracking; /* min(1, T_c/T_n) [1] */
    double u_max;    /* [V] */
} CurrentController;

typedef struct CurrentState {
    double I_d, I_q; /* integral parts [V] */
    double u_d, u_q; /* limited voltage computed at the last instant, for the cycle after the present one [V] */
    int limited;     /* at the last instant; 0 or not, see speed.h */
} CurrentState;

/* K_p [V/A] >= 0, T_n [s] > 0, amplitude limit u_max [V] >= 0, cycle T_c [s]. */
CurrentController current_of(double K_p, double T_n, double u_max, double T_c);

/* One instant: setpoint i_q_s [A], measured currents i [A], speed n_a [rad/s] -> x->u_d, x->u_q. */
void current_step(const CurrentController *p, CurrentState *x, const Pmsm *motor, const PmsmState *i, double i_q_s,
                  double n_a);

#endif

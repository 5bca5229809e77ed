/* Reference model: what the speed loop would do with a P controller. It stands ahead of the integrator only, so that
 * the integrator does not act on a deviation that is part of the intended response.
 *
 *   n_ref / n_s = exp(-s T_ref) omega_0^2 / (s^2 + 2 D omega_0 s + omega_0^2)
 *
 * The PT2 is discretised by Tustin without prewarping at T_c, n_s(t_k) acting on n_ref(t_k); its lag behind a ramp is
 * then 2 D/omega_0 exactly. The dead time is a delay line over T_c samples with linear interpolation. No FMI. */
#ifndef FEEDSIM_REFERENCE_MODEL_H
#define FEEDSIM_REFERENCE_MODEL_H

#include <stdbool.h>

#include "biquad.h"
#include "delay.h"
#include "prefix.h"

#define reference_model_of PREFIXED(reference_model_of)
#define reference_model_start PREFIXED(reference_model_start)
#define reference_model_step PREFIXED(reference_model_step)

typedef struct ReferenceModel {
    bool on; /* false: n_ref = n_s, the dead time included */
    Delay dead_time;
    Biquad pt2;
} ReferenceModel;

typedef struct ReferenceModelState {
    BiquadState pt2;
    int32_t newest;
} ReferenceModelState;

/* omega_0 [rad/s] > 0, D [1] >= 0, dead time T_ref [s] >= 0, cycle T_c [s]. */
ReferenceModel reference_model_of(bool on, double omega_0, double D, double T_ref, double T_c);

/* Settled at the setpoint n_s [rad/s]. The ring holds p->dead_time.length samples [rad/s]. */
void reference_model_start(const ReferenceModel *p, ReferenceModelState *x, double *ring, double n_s);

/* One instant: n_s -> n_ref [rad/s]. */
double reference_model_step(const ReferenceModel *p, ReferenceModelState *x, double *ring, double n_s);

#endif

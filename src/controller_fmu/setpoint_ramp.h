/* Hand-over of the speed setpoint from the position controller's cycle T_pos to the speed controller's cycle T_c =
 * T_pos/N.
 *
 *   ramped:  n_s = n_old + (n_new - n_old)(j + 1)/N,   tick j = 0 ... N - 1 of the position cycle
 *   held:    n_s = n_new from tick 0
 *
 * The ramp reaches n_new in the cycle's last tick: it delays by T_pos - T_c, the held setpoint by (T_pos - T_c)/2. No
 * FMI. */
#ifndef FEEDSIM_SETPOINT_RAMP_H
#define FEEDSIM_SETPOINT_RAMP_H

#include <stdbool.h>
#include <stdint.h>

#include "prefix.h"

#define setpoint_ramp_take PREFIXED(setpoint_ramp_take)
#define setpoint_ramp_value PREFIXED(setpoint_ramp_value)

typedef struct SetpointRamp {
    int32_t ticks; /* N = T_pos/T_c */
    bool ramped;
} SetpointRamp;

typedef struct SetpointRampState {
    double n_old, n_new; /* [rad/s] */
} SetpointRampState;

/* Tick 0 of a position cycle: the position controller's new value [rad/s]. */
void setpoint_ramp_take(SetpointRampState *x, double n_new);

/* Speed setpoint [rad/s] in tick j, 0 <= j < N. */
double setpoint_ramp_value(const SetpointRamp *p, const SetpointRampState *x, int32_t j);

#endif

#include "setpoint_ramp.h"

void setpoint_ramp_take(SetpointRampState *x, double n_new) {
    x->n_old = x->n_new;
    x->n_new = n_new;
}

double setpoint_ramp_value(const SetpointRamp *p, const SetpointRampState *x, int32_t j) {
    if (!p->ramped || j + 1 >= p->ticks) {
        return x->n_new;
    }
    return x->n_old + (x->n_new - x->n_old) * (j + 1) / p->ticks;
}

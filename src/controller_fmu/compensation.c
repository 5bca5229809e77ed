#include "compensation.h"

#include <math.h>

double pulse_amplitude(const FrictionPulse *p, double a) {
    const double *at = p->acceleration;
    if (!p->adaptation || (a >= at[0] && a <= at[1])) {
        return p->amplitude;
    }
    if (a < at[0]) {
        return p->amplitude * a / at[0];
    }
    if (a >= at[2]) {
        return p->min;
    }
    return p->amplitude + (p->min - p->amplitude) * (a - at[1]) / (at[2] - at[1]);
}

double pulse_step(const FrictionPulse *p, PulseState *x, double n_ffw) {
    const double decay = p->T > 0.0 ? exp(-p->T_pos / p->T) : 0.0;
    x->value *= decay;
    const double back = reversal_step(&x->reversal, p->resolution, n_ffw * p->I_P * p->T_pos);
    if (x->reversal.samples == 1) {
        x->a = fabs(n_ffw - x->n) * p->I_P / p->T_pos;
    }
    if (back > 0.0) {
        x->next = x->reversal.direction * pulse_amplitude(p, x->a) / p->I_P;
        x->wait = p->wait - (double)(x->reversal.samples - 1) * p->T_pos;
    }
    if (fabs(x->next) > 0.0) {
        if (x->wait <= 1e-9 * p->T_pos) {
            x->value = p->T > 0.0 ? x->next * exp(fmin(x->wait, 0.0) / p->T) : x->next;
            x->next = 0.0;
        } else {
            x->wait -= p->T_pos;
        }
    }
    x->n = n_ffw;
    return x->value;
}

double torque_table_value(const TorqueTable *p, double speed) {
    int32_t i = 0;
    while (i < p->points && p->speed[i] < speed) {
        ++i;
    }
    if (i == 0) {
        return p->torque[0];
    }
    if (i == p->points) {
        return p->torque[i - 1];
    }
    const double share = (speed - p->speed[i - 1]) / (p->speed[i] - p->speed[i - 1]);
    return p->torque[i - 1] + share * (p->torque[i] - p->torque[i - 1]);
}

void torque_table_start(const TorqueTable *p, TorqueTableState *x, double *ring) {
    *x = (TorqueTableState){0};
    delay_fill(&p->delay, ring, &x->newest, 0.0);
}

void torque_table_step(const TorqueTable *p, TorqueTableState *x, double *ring, double n_ffw) {
    const double n = delay_step(&p->delay, ring, &x->newest, n_ffw);
    const double speed = fabs(n) * p->I_P;
    const double back = reversal_step(&x->reversal, p->resolution, n * p->I_P * p->T_pos);
    x->way = back > 0.0 ? back : x->way + speed * p->T_pos;
    const double share = p->distance > 0.0 ? fmin(1.0, x->way / p->distance) : 1.0;
    x->M = x->reversal.direction * torque_table_value(p, speed) * share;
}

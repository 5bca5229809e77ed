#include "orders.h"

#include <math.h>

static const double TURN = 6.283185307179586;

void orders_add(Orders *p, double order, double amplitude, double phase, int32_t ripple) {
    if (amplitude > 0.0 || amplitude < 0.0) {
        p->at[p->count++] = (Order){.order = order, .amplitude = amplitude, .phase = phase, .ripple = ripple};
    }
}

double angle_within_turn(double angle) {
    if (!(fabs(angle) < 1e12)) {
        return 0.0;
    }
    return fabs(angle) > TURN ? angle - TURN * trunc(angle / TURN) : angle;
}

void orders_turn(const Orders *p, OrdersState *x, double n, double T_c) {
    const double before = x->turning ? x->n : n;
    const double since = x->turning ? 0.5 * T_c * (before + n) : 0.0, next = T_c * (n + 0.5 * (n - before));
    for (int32_t j = 0; j < p->count; ++j) {
        const double theta = x->turning ? x->theta[j] : p->at[j].phase;
        x->theta[j] = angle_within_turn(theta + p->at[j].order * since);
        x->ahead[j] = angle_within_turn(x->theta[j] + p->at[j].order * next);
    }
    x->n = n;
    x->turning = 1;
}

double orders_torque(const Orders *p, const double *theta, double M) {
    double ripple = 0.0, cogging = 0.0;
    for (int32_t j = 0; j < p->count; ++j) {
        const double wave = p->at[j].amplitude * sin(theta[j]);
        if (p->at[j].ripple) {
            ripple += wave;
        } else {
            cogging += wave;
        }
    }
    return M + M * ripple + cogging;
}

double orders_too_fast(const Orders *p, double n, double T_c) {
    double highest = 0.0;
    for (int32_t j = 0; j < p->count; ++j) {
        if (p->at[j].order * fabs(n) * T_c > TURN / 5.0 && p->at[j].order > highest) {
            highest = p->at[j].order;
        }
    }
    return highest;
}

#include "position.h"

Position position_of(const PositionParameters *parameters) {
    const PositionParameters *q = parameters;
    double dead_time = q->T_dyn + (q->symmetry_lag ? 0.0 : q->T_sym);
    Position p = {.I_P = q->I_P, .K_v = q->K_v, .k_ffw = q->k_ffw, .symmetry_lag = q->symmetry_lag};
    p.x_delay = delay_cubic(dead_time / q->T_pos);
    p.n_delay = delay_cubic(q->T_dyn / q->T_pos);
    p.lag = lag_of(q->T_sym, q->T_pos);
    return p;
}

void position_start(const Position *p, PositionState *x, double *x_ring, double *n_ring, double x_s) {
    delay_fill(&p->x_delay, x_ring, &x->x_newest, x_s);
    delay_fill(&p->n_delay, n_ring, &x->n_newest, 0.0);
    lag_settle(&x->lag, x_s);
}

double position_step(const Position *p, PositionState *x, double *x_ring, double *n_ring, double x_s, double n_ffw,
                     double x_a) {
    double x_delayed = delay_step(&p->x_delay, x_ring, &x->x_newest, x_s);
    double n_delayed = delay_step(&p->n_delay, n_ring, &x->n_newest, n_ffw);
    if (p->symmetry_lag) {
        x_delayed = lag_step(&p->lag, &x->lag, x_delayed);
    }
    x->x_e = x_delayed - x_a;
    return (p->K_v * x->x_e + p->k_ffw * p->I_P * n_delayed) / p->I_P;
}

#include "reference_model.h"

ReferenceModel reference_model_of(bool on, double omega_0, double D, double T_ref, double T_c) {
    ReferenceModel p = {.on = on};
    p.dead_time = delay_linear(on ? T_ref / T_c : 0.0);
    p.pt2 = biquad_low_pass(omega_0 * T_c / 2.0, D);
    return p;
}

void reference_model_start(const ReferenceModel *p, ReferenceModelState *x, double *ring, double n_s) {
    delay_fill(&p->dead_time, ring, &x->newest, n_s);
    biquad_settle(&p->pt2, &x->pt2, n_s);
}

double reference_model_step(const ReferenceModel *p, ReferenceModelState *x, double *ring, double n_s) {
    if (!p->on) {
        return n_s;
    }
    return biquad_step(&p->pt2, &x->pt2, delay_step(&p->dead_time, ring, &x->newest, n_s));
}

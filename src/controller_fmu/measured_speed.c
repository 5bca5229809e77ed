#include "measured_speed.h"

MeasuredSpeed measured_speed_of(int window, double T_c, double I_P) {
    MeasuredSpeed p = {.window = delay_linear(window), .per_distance = window > 0 ? 1.0 / (window * T_c * I_P) : 0.0};
    return p;
}

void measured_speed_start(const MeasuredSpeed *p, int32_t *newest, double *ring, double x_a) {
    delay_fill(&p->window, ring, newest, x_a);
}

double measured_speed_step(const MeasuredSpeed *p, int32_t *newest, double *ring, double x_a, double n_a) {
    if (p->per_distance == 0.0) {
        return n_a;
    }
    return (x_a - delay_step(&p->window, ring, newest, x_a)) * p->per_distance;
}

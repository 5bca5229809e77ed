#include "biquad.h"

Biquad biquad_band_stop(double K, double D_num, double D_den) {
    double a_0 = 1.0 + 2.0 * D_den * K + K * K;
    Biquad p = {.b_0 = (1.0 + 2.0 * D_num * K + K * K) / a_0,
                .b_2 = (1.0 - 2.0 * D_num * K + K * K) / a_0,
                .a_2 = (1.0 - 2.0 * D_den * K + K * K) / a_0,
                .g = 4.0 * K * K / a_0};
    return p;
}

Biquad biquad_low_pass(double K, double D_den) {
    double a_0 = 1.0 + 2.0 * D_den * K + K * K;
    Biquad p = {
        .b_0 = K * K / a_0, .b_2 = K * K / a_0, .a_2 = (1.0 - 2.0 * D_den * K + K * K) / a_0, .g = 4.0 * K * K / a_0};
    return p;
}

void biquad_settle(const Biquad *p, BiquadState *x, double value) {
    x->s_1 = value - p->b_0 * value;
    x->s_2 = p->b_2 * value - p->a_2 * value;
}

double biquad_step(const Biquad *p, BiquadState *x, double u) {
    double y = p->b_0 * u + x->s_1;
    x->s_1 = p->g * (u - y) - p->b_0 * u - p->b_2 * u + y + p->a_2 * y + x->s_2;
    x->s_2 = p->b_2 * u - p->a_2 * y;
    return y;
}

#include "lugre.h"

#include <math.h>

static double sign(double n) {
    return (double)((n > 0) - (n < 0));
}

/* (|n|/v_s)^beta. The usual beta of 1 needs no pow(), which returns its first argument then. */
static double stribeck_exponent(const Lugre *p, double speed) {
    const double ratio = speed / p->v_s;
    return fabs(p->beta - 1) > 0 ? pow(ratio, p->beta) : ratio;
}

LugreShape lugre_shape(const Lugre *p, double n) {
    const double speed = fabs(n);
    /* 0 times an overflowing logarithm's argument would be no number */
    return (LugreShape){.fall = exp(-stribeck_exponent(p, speed)), .rise = p->F_log > 0 ? log1p(speed / p->v_log) : 0};
}

/* Equal as values, with no word of a compiler about comparing them. */
static bool same(double a, double b) {
    return a <= b && a >= b;
}

bool lugre_shares_shape(const Lugre *p, const Lugre *q) {
    const bool rises = p->F_log > 0;
    return same(p->v_s, q->v_s) && same(p->beta, q->beta) && rises == (q->F_log > 0) &&
           (!rises || same(p->v_log, q->v_log));
}

double lugre_level(const Lugre *p, double n) {
    return lugre_level_of(p, n, lugre_shape(p, n));
}

double lugre_level_of(const Lugre *p, double n, LugreShape shape) {
    double torque = p->F_C + (p->F_S - p->F_C) * shape.fall;
    if (p->F_log > 0) {
        torque += p->F_log * shape.rise;
    }
    return (1 + p->asymmetry * sign(n)) * torque / p->sigma_0;
}

double lugre_level_slope(const Lugre *p, double n) {
    const double speed = fabs(n);
    const double x = stribeck_exponent(p, speed);
    double torque = 0;
    if (x < 700) { /* beyond, exp(-x) has vanished while x may be infinite */
        torque -= (p->F_S - p->F_C) * p->beta * x * exp(-x);
    }
    torque += p->F_log * (speed / (speed + p->v_log));
    return (1 + p->asymmetry * sign(n)) * torque / p->sigma_0;
}

double lugre_advance(double z, double n, double g, double h) {
    const double z_end = sign(n) * g;
    /* expm1: the small steps of a slow speed must not be lost in 1 - exp(). */
    return z - (z_end - z) * expm1(-fabs(n) / g * h);
}

double lugre_rate(double z, double n, double g) {
    /* Eq. 6 factored: exactly 0 at constant speed, where n - |n|/g z leaves a rounding error that sigma_1 would pass
     * on. */
    return fabs(n) / g * (sign(n) * g - z);
}

double lugre_torque(const Lugre *p, double k, double z, double n, double g) {
    return k * p->sigma_0 * z + p->sigma_1 * lugre_rate(z, n, g) + p->sigma_2 * n;
}

double lugre_torque_by_speed(const Lugre *p, double z, double n) {
    const double g = lugre_level(p, n);
    /* d(|n|/g)/dn = sgn(n) (g - n dg/dn) / g^2 */
    const double rate_by_speed = 1 - sign(n) * z * (g - lugre_level_slope(p, n)) / (g * g);
    return p->sigma_1 * rate_by_speed + p->sigma_2;
}

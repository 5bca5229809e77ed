/* The friction contact over time (src/friction_fmu/contact.c) against its equations, integrated a second time. */
#include "check.h"
#include "contact.h"
#include "tem.h"

static const Contact Z_AXIS = {.lugre = {.sigma_0 = 300,
                                         .sigma_1 = 0.8,
                                         .sigma_2 = 0.006,
                                         .F_C = 1.6,
                                         .F_S = 2.1,
                                         .v_s = 0.6,
                                         .beta = 1,
                                         .F_log = 0.4,
                                         .v_log = 3,
                                         .asymmetry = 0.1},
                               .W = 0.04,
                               .gamma = 0.35};

static long double sign_of(long double n) {
    return n > 0 ? 1 : n < 0 ? -1 : 0;
}

/* Eqs. 6 and 7 in long double. */
static long double rate(const Lugre *p, long double n, long double z) {
    const long double speed = fabsl(n), stribeck = expl(-powl(speed / p->v_s, p->beta));
    const long double level = (1 + p->asymmetry * sign_of(n)) *
                              (p->F_C + (p->F_S - p->F_C) * stribeck + p->F_log * logl(speed / p->v_log + 1)) /
                              p->sigma_0;
    return n - speed / level * z;
}

/* Classical Runge-Kutta from t to end along n_0 + slope t, which keeps its sign. */
static long double integrate(const Lugre *p, long double z, long double n_0, long double slope, long double t,
                             long double end) {
    enum { STEPS = 4000 };
    const long double d = (end - t) / STEPS;
    for (int i = 0; i < STEPS; i++) {
        const long double at = t + d * i, n = n_0 + slope * at, m = n + slope * d / 2, e = n + slope * d;
        /* a rounding past the crossing must not take the other side's asymmetry */
        const long double last = sign_of(e) == sign_of(m) ? e : 0;
        const long double k1 = rate(p, n, z), k2 = rate(p, m, z + d / 2 * k1), k3 = rate(p, m, z + d / 2 * k2),
                          k4 = rate(p, last, z + d * k3);
        z += d / 6 * (k1 + 2 * k2 + 2 * k3 + k4);
    }
    return z;
}

/* Of the bristles, at constant speed. */
static double advance(double z, double n, double h) {
    return lugre_advance(z, n, lugre_level(&Z_AXIS.lugre, n), h);
}

static void order_is_two_through_a_reversal(void) {
    /* -0.6 to +0.9 rad/s within 0.1 s: the crossing at 0.04 s falls into a step unless their number is a multiple of 5
     */
    const double n_0 = -0.6, slope = 15, stop = 0.1;
    long double expected = integrate(&Z_AXIS.lugre, 0, n_0, slope, 0, 0.04L);
    expected = integrate(&Z_AXIS.lugre, expected, n_0, slope, 0.04L, stop);
    double errors[2];
    for (int level = 0; level < 2; level++) {
        const int steps = level == 0 ? 128 : 512;
        ContactState state = {0, 0};
        for (int i = 0; i < steps; i++) {
            const double a = n_0 + slope * (stop * i / steps), b = n_0 + slope * (stop * (i + 1) / steps);
            state = contact_advance(&Z_AXIS, state, a, b, stop / steps);
        }
        errors[level] = fabs(state.z - (double)expected);
        /* c: 0.6 * 0.04/2 = 0.012 rad back, then 0.9 * 0.06/2 = 0.027 forth; some hundred roundings */
        CHECK_NEAR(state.c, 0.015, 1e-15);
    }
    /* 4 times the steps: 1/16 of the error at order 2, 1/4 at order 1; the band leaves room for terms of order 3 and
     * for where within its step the crossing lies */
    CHECK(errors[0] > 0 && errors[0] < 1e-5);
    CHECK(errors[0] / errors[1] > 14 && errors[0] / errors[1] < 18);
}

static void step_is_split_where_the_speed_crosses_zero(void) {
    const double starts[] = {-2, 2, -0.3, 0.3}, ends[] = {6, -6, 0.1, -0.1};
    const double crossings[] = {0.25, 0.25, 0.75, 0.75}; /* share of the step */
    const double h = 0.0078125;                          /* a power of two: no roundings of its own */
    for (int i = 0; i < 4; i++) {
        const ContactState from = {.z = 2e-3, .c = -0.015};
        const ContactState whole = contact_advance(&Z_AXIS, from, starts[i], ends[i], h);
        const double until = crossings[i] * h;
        ContactState parts = contact_advance(&Z_AXIS, from, starts[i], 0, until);
        parts = contact_advance(&Z_AXIS, parts, 0, ends[i], h - until);
        CHECK_NEAR(whole.z, parts.z, 1e-17); /* 0.3 and 0.1 put the crossing a rounding off 0.75 */
        CHECK_NEAR(whole.c, parts.c, 1e-17);
        const ContactState unsplit = {.z = advance(from.z, (starts[i] + ends[i]) / 2, h), .c = 0};
        CHECK(fabs(whole.z - unsplit.z) > 1e-5); /* the split matters in these cases */
    }
    /* out to an end of the zone and back: without the split c would only see the 7.8 mrad between start and end */
    const ContactState there = contact_advance(&Z_AXIS, (ContactState){0, 0.015}, 4, -2, 0.015);
    CHECK_NEAR(there.c, 0.02 - 2 * 0.005 / 2, 1e-17);
}

static void without_a_crossing_a_step_is_that_at_the_mean_speed(void) {
    const double pairs[][2] = {{1, 3}, {-3, -1}, {0, 2}, {2, 0}, {0, -2}, {0, 0}};
    for (size_t i = 0; i < sizeof pairs / sizeof pairs[0]; i++) {
        const double mean = (pairs[i][0] + pairs[i][1]) / 2;
        const ContactState state = contact_advance(&Z_AXIS, (ContactState){1e-3, 0.01}, pairs[i][0], pairs[i][1], 1e-3);
        CHECK_EQUAL(state.z, advance(1e-3, mean, 1e-3));
        CHECK_EQUAL(state.c, tem_advance(0.01, mean * 1e-3, Z_AXIS.W));
    }
}

static void torque_takes_the_engaged_share(void) {
    const ContactState state = {.z = -2e-3, .c = 0.01};
    double share = 0;
    const double torque = contact_torque(&Z_AXIS, state, -0.4, &share);
    CHECK_NEAR(contact_engagement(&Z_AXIS, state), 0.25, 1e-16); /* (W/2 - c)/W */
    CHECK_NEAR(share, 0.35 + 0.25 * 0.65, 1e-16);
    CHECK_NEAR(torque, (double)(share * 300.0L * -2e-3 + 0.8L * rate(&Z_AXIS.lugre, -0.4L, -2e-3) + 0.006L * -0.4),
               1e-15);
    CHECK_EQUAL(contact_torque(&Z_AXIS, state, -0.4, NULL), torque);
    Contact pure = Z_AXIS;
    pure.W = 0;
    contact_torque(&pure, (ContactState){1e-3, 0}, 1, &share);
    CHECK_EQUAL(share, 1);
}

int main(void) {
    order_is_two_through_a_reversal();
    step_is_split_where_the_speed_crosses_zero();
    without_a_crossing_a_step_is_that_at_the_mean_speed();
    torque_takes_the_engaged_share();
    return CHECK_RESULT;
}

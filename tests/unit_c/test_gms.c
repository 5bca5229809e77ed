/* Generalised Maxwell slip (src/friction_gms_fmu/gms.c) against closed forms of Maxwell elements. */
#include <float.h>
#include <math.h>

#include "check.h"
#include "gms.h"

static const Lugre FLAT = {.sigma_0 = 300, .F_C = 1.6, .F_S = 1.6, .v_s = 0.6, .beta = 1, .v_log = 3};
static const Lugre CURVED = {.sigma_0 = 300,
                             .sigma_1 = 0.8,
                             .sigma_2 = 0.006,
                             .F_C = 1.6,
                             .F_S = 2.1,
                             .v_s = 0.6,
                             .beta = 1.5,
                             .F_log = 0.4,
                             .v_log = 3,
                             .asymmetry = 0.1};

static double torque_of(const ContactState *state) {
    double torque = 0;
    for (int i = 0; i < GMS_ELEMENTS; i++) {
        torque += state->force[i];
    }
    return torque;
}

/* Moved by x [rad] in many uneven steps of constant speed, then stopped. */
static ContactState moved(const Contact *p, ContactState state, double x) {
    const double n = x > 0 ? 0.01 : -0.01, whole = fabs(x) / 0.01;
    for (int i = 0; i < 7; i++) {
        state = contact_advance(p, state, n, n, whole * (i + 1) / 28);
    }
    return state;
}

/* Torque after x [rad] from rest, every element written out. */
static double virgin(const Contact *p, double x, double level) {
    double torque = 0;
    for (int i = 0; i < GMS_ELEMENTS; i++) {
        torque += fmin(p->stiffness[i] * x, p->share[i] * level);
    }
    return torque;
}

static void elements_are_in_equal_ratios(void) {
    const double cases[][2] = {{1, 0}, {20, 0}, {20, 0.7}, {1e6, -3}, {300, 3}};
    for (size_t c = 0; c < sizeof cases / sizeof cases[0]; c++) {
        const Contact p = contact_make(&CURVED, cases[c][0], cases[c][1], 200);
        double shares = 0, stiffnesses = 0;
        for (int i = 0; i < GMS_ELEMENTS; i++) {
            shares += p.share[i];
            stiffnesses += p.stiffness[i];
            const double slip = p.share[i] / p.stiffness[i] / (p.share[0] / p.stiffness[0]);
            const double ratio = pow(cases[c][0], (double)i / (GMS_ELEMENTS - 1));
            CHECK_NEAR(slip, ratio, 1e-13 * ratio); /* a few roundings of exp and log */
            CHECK_NEAR(p.share[i] / p.share[0], pow(ratio, cases[c][1]), 1e-12 * pow(ratio, cases[c][1]));
        }
        CHECK_NEAR(shares, 1, 1e-15);
        CHECK_NEAR(stiffnesses, 300, 1e-12);
    }
}

static void virgin_curve_is_the_sum_of_elements(void) {
    const Contact p = contact_make(&FLAT, 20, 0.3, 200);
    for (int i = 0; i <= 40; i++) {
        const double x = 0.002 * i;
        const ContactState state = moved(&p, contact_at(&p, 0, 0), x > 0 ? x : DBL_MIN);
        CHECK_NEAR(torque_of(&state), virgin(&p, x, 1.6), 1e-14);
        /* the state of that deflection, and not only the torque, is the same */
        const ContactState begun = contact_at(&p, contact_deflection(&p, &state), 0);
        for (int e = 0; e < GMS_ELEMENTS; e++) {
            CHECK_NEAR(begun.force[e], state.force[e], 1e-13);
        }
        const ContactState other = contact_at(&p, -1e-4 * i, 0);
        CHECK_NEAR(contact_deflection(&p, &other), -fmin(1e-4 * i, 1.6 / 300), 1e-16);
    }
}

/* Masing's rule: behind a reversal the branch is the virgin curve, doubled in torque and angle. */
static void branches_follow_masing(void) {
    const Contact p = contact_make(&FLAT, 20, -0.4, 200);
    const double reach[] = {0.004, 0.011, 0.1};
    for (int r = 0; r < 3; r++) {
        const ContactState top = moved(&p, contact_at(&p, 0, 0), reach[r]);
        for (int i = 1; i <= 20; i++) {
            const double x = 2 * reach[r] * i / 20;
            const ContactState back = moved(&p, top, -x);
            CHECK_NEAR(torque_of(&back), virgin(&p, reach[r], 1.6) - 2 * virgin(&p, x / 2, 1.6), 2e-14);
        }
    }
}

/* Non-local memory: a small loop within a large one closes, and the way goes on as if it had not been. */
static void inner_loops_leave_no_trace(void) {
    const Contact p = contact_make(&FLAT, 20, 0.3, 200);
    const ContactState begun = moved(&p, moved(&p, contact_at(&p, 0, 0), 0.03), -0.006);
    const ContactState looped = moved(&p, moved(&p, begun, 0.004), -0.004);
    const ContactState nested = moved(&p, moved(&p, moved(&p, moved(&p, begun, 0.004), -0.001), 0.001), -0.004);
    const ContactState straight = moved(&p, begun, -0.007), after = moved(&p, looped, -0.007);
    for (int i = 0; i < GMS_ELEMENTS; i++) {
        CHECK_NEAR(looped.force[i], begun.force[i], 1e-14);
        CHECK_NEAR(nested.force[i], begun.force[i], 1e-14);
        CHECK_NEAR(after.force[i], straight.force[i], 1e-14);
    }
}

/* A closed loop of amplitude X takes 4 alpha F (X - alpha F/k) of every element that slips, and nothing of the others.
 */
static void loops_take_the_work_of_maxwell_elements(void) {
    const Contact p = contact_make(&FLAT, 20, 0.3, 1e6);
    const double X = 0.009;
    double expected = 0, work = 0;
    for (int i = 0; i < GMS_ELEMENTS; i++) {
        const double slip = p.share[i] * 1.6 / p.stiffness[i];
        expected += X > slip ? 4 * p.share[i] * 1.6 * (X - slip) : 0;
    }
    enum { STEPS = 20000 };
    ContactState state = moved(&p, contact_at(&p, 0, 0), X);
    for (int i = 0; i < 2 * STEPS; i++) {
        const double n = i < STEPS ? -1 : 1, h = 2 * X / STEPS, before = torque_of(&state);
        state = contact_advance(&p, state, n, n, h);
        work += n * h * (before + torque_of(&state)) / 2;
    }
    CHECK_NEAR(work, expected, 1e-6 * expected); /* trapezoids past ten kinks each way */
}

static void constant_speed_is_the_stribeck_curve(void) {
    const Contact p = contact_make(&CURVED, 20, 0.3, 200);
    const double speeds[] = {1e-3, 0.05, 0.6, 5, 150, -1e-3, -0.6, -150};
    for (size_t i = 0; i < sizeof speeds / sizeof speeds[0]; i++) {
        const double n = speeds[i];
        const ContactState state = contact_advance(&p, contact_at(&p, 0, 0), n, n, 1e3);
        const double level =
            (1 + copysign(0.1, n)) * (1.6 + 0.5 * exp(-pow(fabs(n) / 0.6, 1.5)) + 0.4 * log(fabs(n) / 3 + 1));
        double share = 1;
        CHECK_NEAR(contact_torque(&p, state, n, &share), copysign(level, n) + 0.006 * n, 1e-12);
        CHECK_EQUAL(share, 0); /* all slip */
    }
}

/* A step of the speed while all slip: every element follows with the time constant s/C. */
static void slipping_lags_behind_the_curve(void) {
    const Contact p = contact_make(&CURVED, 20, 0.3, 50);
    const double slow = 0.05, fast = 2;
    const ContactState begun = contact_advance(&p, contact_at(&p, 0, 0), slow, slow, 1e3);
    const double from = torque_of(&begun);
    const double to = 1.1 * (1.6 + 0.5 * exp(-pow(fast / 0.6, 1.5)) + 0.4 * log(fast / 3 + 1));
    for (int i = 0; i < 10; i++) {
        const double t = 0.01 * i;
        const ContactState state = contact_advance(&p, begun, fast, fast, t);
        CHECK_NEAR(torque_of(&state), to + (from - to) * exp(-50 * t / to), 1e-14);
    }
}

/* At rest all elements stick, and a start in the same direction breaks away once more. */
static void rest_keeps_the_torque(void) {
    const Contact p = contact_make(&CURVED, 20, 0.3, 200);
    ContactState state = contact_advance(&p, contact_at(&p, 0, 0), 5, 5, 10);
    state = contact_advance(&p, state, 5, 0, 0.1);
    double share = 0;
    const double torque = contact_torque(&p, state, 0, &share);
    CHECK_NEAR(share, 1, 1e-15);
    state = contact_advance(&p, state, 0, 0, 1e6);
    CHECK_EQUAL(contact_torque(&p, state, 0, NULL), torque);
    CHECK(torque < 1.1 * 2.1); /* the attraction was too slow for the whole static torque */
    state = contact_advance(&p, state, 1e-6, 1e-6, 0.1 / 1e-6);
    CHECK_NEAR(torque_of(&state), 1.1 * 2.1, 1e-4);
}

static ContactState along_a_sine(const Contact *p, int steps) {
    ContactState state = contact_at(p, 1e-3, 0);
    const double h = 2.0 / steps;
    for (int i = 0; i < steps; i++) {
        state = contact_advance(p, state, 2 * sin(5 * h * i + 0.3), 2 * sin(5 * h * (i + 1) + 0.3), h);
    }
    return state;
}

static void steps_are_of_second_order(void) {
    const Contact p = contact_make(&CURVED, 20, 0.3, 200);
    const ContactState fine = along_a_sine(&p, 1 << 20);
    double errors[3];
    for (int i = 0; i < 3; i++) {
        const ContactState state = along_a_sine(&p, 2000 << (2 * i));
        errors[i] = fabs(torque_of(&state) - torque_of(&fine));
    }
    CHECK(errors[0] < 1e-3);
    for (int i = 0; i < 2; i++) {
        CHECK_NEAR(log2(errors[i] / errors[i + 1]) / 2, 2, 0.2);
    }
}

static void derivative_by_speed_is_that_of_the_torque(void) {
    const Contact p = contact_make(&CURVED, 20, 0.3, 200);
    const double speeds[] = {0.4, -2, 30};
    for (size_t i = 0; i < sizeof speeds / sizeof speeds[0]; i++) {
        const double n = speeds[i], d = 1e-5 * fabs(n);
        const ContactState state = contact_advance(&p, contact_at(&p, 0, 0), n, n, 0.01 / fabs(n));
        const double slope =
            (contact_torque(&p, state, n + d, NULL) - contact_torque(&p, state, n - d, NULL)) / (2 * d);
        CHECK_NEAR(contact_torque_by_speed(&p, &state, n), slope, 1e-8);
    }
    const ContactState rest = contact_at(&p, 1e-3, 0);
    CHECK_NEAR(contact_torque_by_speed(&p, &rest, 0), 0.806, 1e-15);
}

/* Any length of a step and any speed leave every element within its share of the largest torque. */
static void large_steps_stay_within_the_static_torque(void) {
    const Contact p = contact_make(&CURVED, 1e6, -3, 1e12);
    ContactState state = contact_at(&p, 0, 0);
    const double speeds[] = {0, 1e-300, 1e300, -1e300, 5, -5, 0, 1e-9, -40};
    for (size_t i = 0; i + 1 < sizeof speeds / sizeof speeds[0]; i++) {
        state = contact_advance(&p, state, speeds[i], speeds[i + 1], i % 2 == 0 ? 1e3 : 1e-9);
        for (int k = 0; k < GMS_ELEMENTS; k++) {
            CHECK(fabs(state.force[k]) <= 1.1 * (2.1 + 0.4 * 700) * p.share[k]);
        }
    }
}

int main(void) {
    elements_are_in_equal_ratios();
    virgin_curve_is_the_sum_of_elements();
    branches_follow_masing();
    inner_loops_leave_no_trace();
    loops_take_the_work_of_maxwell_elements();
    constant_speed_is_the_stribeck_curve();
    slipping_lags_behind_the_curve();
    rest_keeps_the_torque();
    steps_are_of_second_order();
    derivative_by_speed_is_that_of_the_torque();
    large_steps_stay_within_the_static_torque();
    return CHECK_RESULT;
}

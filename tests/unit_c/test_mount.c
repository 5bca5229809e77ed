/* A levelling mount: closed forms of its steady cycles, order of convergence in the step, energy, bounds. */
#include "check.h"
#include "mount.h"

static const double pi = 3.14159265358979323846;
static const Mount RUBBER = {.F_max = 1000, .x_2 = 20e-6};

/* Work of the friction from the state to x without a reversal on the way: the law's integral over d. */
static double work_to(const Mount *p, MountState state, double x) {
    mount_move(p, &state, x); /* finds a reversal where it begins */
    const double from = state.x_s;
    double both[2];
    for (int i = 0; i < 2; i++) {
        const double d = i == 0 ? state.x - from : 0, sign = d < 0 ? -1 : 1;
        const double A = p->x_2 * (1 - sign * state.F_s / p->F_max), B = p->F_max - sign * state.F_s;
        both[i] = state.F_s * d + B * (fabs(d) - A * log1p(fabs(d) / A));
    }
    return both[0] - both[1];
}

/* From x to x_end; the part between the last reversal and x belongs to another piece of the way. */
static double work(const Mount *p, MountState *state, double x_end) {
    MountState before = *state;
    const bool reversed = (x_end - before.x) * (before.x - before.x_s) < 0;
    double sum = work_to(p, before, x_end);
    if (!reversed) {
        MountState start = before;
        start.x = before.x_s;
        sum -= work_to(p, start, before.x);
    }
    mount_move(p, state, x_end);
    return sum;
}

static void steady_cycles_have_the_closed_form(void) {
    for (int k = 0; k < 9; k++) {
        const double x_0 = RUBBER.x_2 * pow(10, -2 + k / 2.0), x_2 = RUBBER.x_2, F_max = RUBBER.F_max;
        const double F_0 = F_max / (2 * x_2) * (sqrt(x_2 * x_2 + x_0 * x_0 + 6 * x_2 * x_0) - x_2 - x_0);
        const double a = F_0 / F_max, wide = x_2 * (1 + a);
        const double E = 2 * F_max * (2 * x_0 - wide * (1 + a) * log((wide + 2 * x_0) / wide));
        MountState state = {0, 0, 0, 0};
        /* The middle of a small cycle settles by x_0^2 a cycle alone. */
        for (int cycle = 0; cycle < 100 + (int)(20 * x_2 * x_2 / (x_0 * x_0)); cycle++) {
            mount_move(&RUBBER, &state, x_0);
            mount_move(&RUBBER, &state, -x_0);
        }
        double taken = work(&RUBBER, &state, x_0);
        taken += work(&RUBBER, &state, -x_0);
        CHECK_NEAR(mount_friction(&RUBBER, &state, state.x), -F_0, 1e-6 * F_0);
        CHECK_NEAR(taken, E, 1e-6 * E + 1e-12 * F_max * x_0);
    }
    MountState state = {0, 0, 0, 0}; /* numbers worked out by hand */
    for (int cycle = 0; cycle < 100; cycle++) {
        work(&RUBBER, &state, 30e-6);
        work(&RUBBER, &state, -30e-6);
    }
    CHECK_NEAR(mount_friction(&RUBBER, &state, state.x), -500, 1e-6 * 500);
    CHECK_NEAR(work(&RUBBER, &state, 30e-6) + work(&RUBBER, &state, -30e-6), 0.0211249, 5e-8);
}

/* From rest half of F_max is reached at x_2; the slope there and behind a reversal is F_max/x_2. */
static void stiffness_is_that_of_the_parameters(void) {
    MountState state = {0, 0, 0, 0};
    const double little = 1e-6 * RUBBER.x_2, K = RUBBER.F_max / RUBBER.x_2;
    CHECK_NEAR(mount_friction(&RUBBER, &state, RUBBER.x_2), 500, 1e-9);
    CHECK_NEAR(mount_friction(&RUBBER, &state, -RUBBER.x_2), -500, 1e-9);
    CHECK_NEAR(mount_friction(&RUBBER, &state, little) / little, K, 2e-6 * K);
    mount_move(&RUBBER, &state, 55e-6);
    const double top = mount_friction(&RUBBER, &state, 55e-6);
    mount_move(&RUBBER, &state, 55e-6 - little);
    CHECK_NEAR((top - mount_friction(&RUBBER, &state, state.x)) / little, K, 2e-6 * K);
}

static double random_share(unsigned *seed) {
    *seed = *seed * 1664525u + 1013904223u;
    return (double)(*seed >> 8) / (double)(1u << 24);
}

static void no_way_however_long_exceeds_F_max(void) {
    unsigned seed = 7;
    MountState state = {0, 0, 0, 0};
    for (int k = 0; k < 20000; k++) {
        mount_move(&RUBBER, &state, 200 * RUBBER.x_2 * (random_share(&seed) - 0.5) * pow(random_share(&seed), 4));
        CHECK(fabs(mount_friction(&RUBBER, &state, state.x)) <= RUBBER.F_max);
    }
    CHECK(fabs(mount_friction(&RUBBER, &state, 1e6)) <= RUBBER.F_max);
}

/* A closed way of reversals, gone through until it closes in force, too. */
static void closed_cycles_take_energy(void) {
    unsigned seed = 3;
    for (int cycle = 0; cycle < 50; cycle++) {
        double at[6], taken = 0, elastic = 0;
        for (int i = 0; i < 6; i++) {
            at[i] = 4 * RUBBER.x_2 * (random_share(&seed) - 0.5);
        }
        MountState state = {0, 0, 0, 0};
        for (int turn = 0; turn < 400; turn++) {
            elastic = mount_friction(&RUBBER, &state, state.x);
            taken = 0;
            for (int i = 0; i < 6; i++) {
                taken += work(&RUBBER, &state, at[i]);
            }
        }
        CHECK_NEAR(mount_friction(&RUBBER, &state, state.x), elastic, 1e-6 * RUBBER.F_max);
        CHECK(taken > 0);
    }
}

/* Steps of h over a decaying motion whose reversals lie anywhere: the force at the end. */
static double force_after(double h, int steps) {
    const Mount p = {.K_e = 4e7, .F_max = 1000, .x_2 = 20e-6, .K_v = 2e7, .c = 3e5};
    const double w = 2 * pi * 21, r = 9;
    MountState state = {0, 0, 0, 0};
    for (int k = 0; k < steps; k++) {
        double x[2], v[2];
        for (int i = 0; i < 2; i++) {
            const double t = h * (k + i);
            x[i] = 3e-5 * exp(-r * t) * sin(w * t);
            v[i] = 3e-5 * exp(-r * t) * (w * cos(w * t) - r * sin(w * t));
        }
        mount_advance(&p, &state, x[1], v[0], v[1], h);
    }
    return mount_force(&p, &state);
}

static void halved_steps_have_a_quarter_of_the_error(void) {
    const double T = 0.2613, exact = force_after(T / 3200000, 3200000);
    double off[4];
    for (int i = 0; i < 4; i++) {
        const int steps = 400 << i;
        off[i] = fabs(force_after(T / steps, steps) - exact);
    }
    CHECK(off[3] > 0);
    CHECK(log2(off[0] / off[3]) / 3 > 1.9);
}

/* With its reversals located, friction alone hangs on the step no more than a cubic does. */
static void reversals_are_located(void) {
    double off[2];
    for (int i = 0; i < 2; i++) {
        const int steps = 20 << i; /* a reversal in every tenth and twentieth step */
        const double h = 2 * pi / steps;
        MountState state = {0, 0, 0, 0};
        for (int k = 0; k < 20 * steps; k++) {
            const double t = h * (k + 0.3), to = h * (k + 1.3);
            mount_advance(&RUBBER, &state, 30e-6 * sin(to), 30e-6 * cos(t), 30e-6 * cos(to), h);
        }
        MountState exact = {0, 0, 0, 0};
        for (int k = 0; k < 20; k++) {
            mount_move(&RUBBER, &exact, 30e-6);
            mount_move(&RUBBER, &exact, -30e-6);
        }
        off[i] = fabs(state.F_s - mount_friction(&RUBBER, &exact, -30e-6));
    }
    CHECK(off[0] < 2e-4 * 500);
    CHECK(off[1] < off[0] / 8);
}

/* Maxwell element on a sine: stiffness K_v (w tau)^2/(1 + (w tau)^2) in phase, K_v w tau/(1 + (w tau)^2) ahead of it.
 */
static void viscous_part_is_a_maxwell_element(void) {
    const Mount p = {.K_v = 3e7, .c = 2e5};
    const double w = 2 * pi * 21, tau = p.c / p.K_v, share = w * tau, below = 1 + share * share, h = 1e-6;
    MountState state = {0, 0, 0, 0};
    double t = 0;
    for (; t < 0.4; t += h) {
        mount_advance(&p, &state, 1e-5 * sin(w * (t + h)), 1e-5 * w * cos(w * t), 1e-5 * w * cos(w * (t + h)), h);
    }
    const double expected = 1e-5 * p.K_v * (share * share * sin(w * t) + share * cos(w * t)) / below;
    CHECK_NEAR(mount_force(&p, &state), expected, 1e-6 * 1e-5 * p.K_v);
}

static void linear_mount_is_a_spring(void) {
    const Mount p = {.K_e = 4.5e7, .F_max = 0, .x_2 = 20e-6};
    MountState state = {0, 0, 0, 0};
    mount_advance(&p, &state, 3e-6, 0.1, -0.2, 1e-3);
    CHECK_EQUAL(mount_force(&p, &state), 4.5e7 * 3e-6);
}

int main(void) {
    steady_cycles_have_the_closed_form();
    stiffness_is_that_of_the_parameters();
    no_way_however_long_exceeds_F_max();
    closed_cycles_take_energy();
    halved_steps_have_a_quarter_of_the_error();
    reversals_are_located();
    viscous_part_is_a_maxwell_element();
    linear_mount_is_a_spring();
    return CHECK_RESULT;
}

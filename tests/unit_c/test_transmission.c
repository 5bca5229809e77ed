/* Play with contact between a motor and a free mass: closed forms, energy, order of convergence. */
#include "check.h"
#include "transmission.h"

static const double J = 0.006, J_S = 0.02, C_T = 900; /* kg.m2 of motor and mass, N.m/rad */

static bool settled;

/* One step of a motor and a free mass that holds J. */
static TransmissionState next(const Transmission *p, TransmissionState x, double u, double h) {
    const double m = J + J_S, none = 0;
    const double by_n = h / m, by_way = h * h / (2 * m), by_way_ramp = -h * h / (12 * m);
    const double way_free = h * x.n_s;
    const TransmissionPorts ports = {&way_free, &x.n_s, &by_way, &by_n, &by_way_ramp, &none};
    TransmissionState end;
    CHECK(transmission_step(1, p, &u, &none, &ports, &x, &end, h, &settled));
    CHECK(settled);
    return end;
}

/* The motor from n_0, alone at the torque u, for `steps` of h. */
static TransmissionState driven(const Transmission *p, TransmissionState state, double u, double h, int steps) {
    for (int k = 0; k < steps; k++) {
        state = next(p, state, u, h);
    }
    return state;
}

static double energy(const Transmission *p, TransmissionState x) {
    const double e = fmax(0, fabs(x.delta) - p->half);
    return (J * x.n * x.n + J_S * x.n_s * x.n_s + p->c * e * e) / 2;
}

static void its_rate_is_that_of_two_masses(void) {
    Transmission p = {.on = true, .J = J, .c = C_T, .d = 0.3};
    CHECK_NEAR(transmission_rate(&p, J_S), sqrt(C_T * (1 / J + 1 / J_S)), 1e-10);
    p.d = 30; /* overdamped */
    CHECK_NEAR(transmission_rate(&p, J_S), 15 * (1 / J + 1 / J_S), 1e-10);
}

/* Two masses on a spring: the motor starts at n_0, and swings about the common speed. */
static void without_play_two_masses_swing(void) {
    const Transmission p = {.on = true, .J = J, .c = C_T};
    const double n_0 = 2, mean = n_0 * J / (J + J_S), omega = sqrt(C_T * (1 / J + 1 / J_S));
    double off[3];
    for (int i = 0; i < 3; i++) {
        const double h = 0.3 / omega / (1 << i), t = 30 / omega;
        const TransmissionState x = driven(&p, (TransmissionState){.n = n_0}, 0, h, 100 << i);
        off[i] = x.n - (mean + (n_0 - mean) * cos(omega * t));
        CHECK_NEAR(J * x.n + J_S * x.n_s, J * n_0, 1e-13);
    }
    CHECK_NEAR(log2(off[0] / off[1]), 4, 0.05);
    CHECK_NEAR(log2(off[1] / off[2]), 4, 0.05);
    CHECK(fabs(off[0]) < 1e-3 * n_0);
}

/* A stiff contact without play: one mass, whatever its share on either side. */
static void stiff_contact_joins_them(void) {
    Transmission p = {.on = true, .J = J, .c = 1e8, .d = 1e3};
    p.rate = transmission_rate(&p, J_S);
    const int steps = (int)ceil(0.1 * p.rate / 0.3);
    const TransmissionState x = driven(&p, (TransmissionState){.n = 0}, 3, 0.1 / steps, steps);
    CHECK_NEAR(x.n, 3 * 0.1 / (J + J_S), 1e-6);
    CHECK_NEAR(x.n_s, x.n, 1e-6);
}

/* Largest deviation of the energy from the start's, as a share of it, over `steps` of h. */
static double energy_off(const Transmission *p, TransmissionState *x, double whole, double h, int steps) {
    double most = 0;
    for (int k = 0; k < steps; k++) {
        *x = next(p, *x, 0, h);
        most = fmax(most, fabs(energy(p, *x) + x->heat - whole) / whole);
    }
    return most;
}

/* To and fro across the play, 2000 impacts and more: the energy stays within bounds that do not widen. */
static void energy_stays(void) {
    const Transmission p = {.on = true, .J = J, .c = C_T, .half = 0.5e-3};
    const double h = 0.3 / transmission_rate(&p, J_S);
    double before = 0;
    for (int i = 0; i < 3; i++) {
        TransmissionState x = {.n = 0.5};
        const double whole = energy(&p, x);
        const double early = energy_off(&p, &x, whole, h / (1 << i), 10000);
        const double late = energy_off(&p, &x, whole, h / (1 << i), 90000);
        CHECK(early < 3e-5 && late < 1.01 * early);
        CHECK(i == 0 || log2(before / late) > 3.5);
        CHECK_EQUAL(x.heat, 0);
        before = late;
    }
}

/* What the damping takes from it is what it has made warm. */
static void energy_warms(void) {
    const Transmission p = {.on = true, .J = J, .c = C_T, .d = 0.2, .half = 0.5e-3};
    TransmissionState x = {.n = 0.5}, y = x;
    const double whole = energy(&p, x), h = 125e-6;
    CHECK(energy_off(&p, &x, whole, h, 800) < 1e-6);
    CHECK(energy_off(&p, &y, whole, h / 4, 3200) < 1e-8);
    CHECK(x.heat > 0.3 * whole * J_S / (J + J_S));
}

/* Motor alone while the play lasts: b/2 at n_0, and the mass does not know of it. */
static void in_the_play_they_are_apart(void) {
    const Transmission p = {.on = true, .J = J, .c = C_T, .d = 1, .half = 0.5e-3};
    const TransmissionState x = driven(&p, (TransmissionState){.n = 1}, 0, 1e-6, 499);
    CHECK_EQUAL(x.n, 1);
    CHECK_EQUAL(x.n_s, 0);
    CHECK_EQUAL(x.C, 0);
    CHECK_NEAR(x.delta, 499e-6, 1e-15);
    CHECK(driven(&p, x, 0, 1e-6, 10).C > 0);
}

/* Swinging through the play: the period is that of the half waves in contact and of the ways between,
 * 2 pi/omega + 2 b/n_rel. */
static void period_with_play_is_that_of_its_pieces(void) {
    const Transmission p = {.on = true, .J = J, .c = C_T, .half = 0.5e-3};
    const double n_0 = 1, omega = sqrt(C_T * (1 / J + 1 / J_S)), h = 1e-6;
    const double period = 2 * acos(-1.0) / omega + 4 * p.half / n_0;
    TransmissionState x = {.n = n_0};
    double at = 0, before = 0;
    int crossings = 0;
    for (int k = 1; crossings < 10; k++) { /* upwards through the middle */
        x = next(&p, x, 0, h);
        const double delta = x.delta;
        if (k > 1 && before < 0 && delta >= 0) {
            at = (k - delta / (delta - before)) * h;
            crossings++;
        }
        before = delta;
    }
    CHECK_NEAR(at / 10, period, 1e-6 * period);
}

static void two_axes_move_one_mass(void) {
    const Transmission p[2] = {{.on = true, .J = J, .c = C_T}, {.on = true, .J = J, .c = C_T}};
    const double h = 1e-4, m = J_S + 2 * J, n = h / m, a = h * h / (2 * m);
    const double by_n[4] = {n, n, n, n}, by_way[4] = {a, a, a, a}, u[2] = {1, 1}, none[4] = {0};
    const double by_way_ramp[4] = {-a / 6, -a / 6, -a / 6, -a / 6};
    TransmissionState x[2] = {{.n = 0}, {.n = 0}}, end[2];
    for (int k = 0; k < 1000; k++) {
        const double way_free[2] = {h * x[0].n_s, h * x[1].n_s};
        const double n_free[2] = {x[0].n_s, x[1].n_s};
        const TransmissionPorts ports = {way_free, n_free, by_way, by_n, by_way_ramp, none};
        CHECK(transmission_step(2, p, u, none, &ports, x, end, h, &settled));
        CHECK(settled);
        for (int i = 0; i < 2; i++) { /* the structure's end has the torques of both */
            end[i].n_s = n_free[i] + n * (end[0].T + end[1].T);
            x[i] = end[i];
        }
    }
    CHECK_NEAR(J * (x[0].n + x[1].n) + J_S * x[0].n_s, 2 * 0.1, 1e-10);
}

/* Two motors that say to be 0.6 each of the one mass they move: there is no such machine. */
static void what_does_not_settle_is_said(void) {
    const double h = 1e-4, n = h * 0.6 / J, a = h * h * 0.3 / J;
    const Transmission p[2] = {{.on = true, .J = J, .c = C_T}, {.on = true, .J = J, .c = C_T}};
    const double by_n[4] = {n, n, n, n}, by_way[4] = {a, a, a, a}, u[2] = {1, 1}, none[4] = {0};
    const double by_way_ramp[4] = {-a / 6, -a / 6, -a / 6, -a / 6};
    const TransmissionPorts ports = {none, u, by_way, by_n, by_way_ramp, none};
    TransmissionState x[2] = {{.n = 0}, {.n = 0}}, end[2];
    CHECK(transmission_step(2, p, u, none, &ports, x, end, h, &settled));
    CHECK(!settled);
}

int main(void) {
    its_rate_is_that_of_two_masses();
    without_play_two_masses_swing();
    stiff_contact_joins_them();
    energy_stays();
    energy_warms();
    in_the_play_they_are_apart();
    period_with_play_is_that_of_its_pieces();
    two_axes_move_one_mass();
    what_does_not_settle_is_said();
    return CHECK_RESULT;
}

/* Play with contact between a motor and a free mass: closed forms, energy to rounding, order of convergence. */
#include "check.h"
#include "transmission.h"

static const double J = 0.006, J_S = 0.02, C_T = 900; /* kg.m2 of motor and mass, N.m/rad */

static bool settled;

/* The motor from n_0, alone at the torque u, for `steps` of h. The structure is a free mass that holds J. */
static TransmissionState driven(const Transmission *p, TransmissionState state, double u, double h, int steps) {
    const double by_n = h / (J + J_S), by_angle = h * h / (2 * (J + J_S)), none = 0;
    for (int k = 0; k < steps; k++) {
        TransmissionState end;
        const double angle_free = state.angle_s + h * state.n_s, n_free = state.n_s;
        CHECK(transmission_step(1, p, &u, &none, &angle_free, &n_free, &by_angle, &by_n, &state, &end, h, &settled));
        state = end;
    }
    return state;
}

static double energy(const Transmission *p, TransmissionState x) {
    const double delta = x.angle - x.angle_s, e = fmax(0, fabs(delta) - p->half);
    return (J * x.n * x.n + J_S * x.n_s * x.n_s + p->c * e * e) / 2;
}

/* Two masses on a spring: the motor starts at n_0, and swings about the common speed. */
static void without_play_two_masses_swing(void) {
    const Transmission p = {.on = true, .J = J, .c = C_T};
    const double n_0 = 2, mean = n_0 * J / (J + J_S), omega = sqrt(C_T * (1 / J + 1 / J_S));
    double off[3];
    for (int i = 0; i < 3; i++) {
        const double h = 100e-6 / (1 << i), t = 0.02;
        const TransmissionState x = driven(&p, (TransmissionState){.n = n_0}, 0, h, 200 << i);
        off[i] = x.n - (mean + (n_0 - mean) * cos(omega * t));
        CHECK_NEAR(J * x.n + J_S * x.n_s, J * n_0, 1e-13);
    }
    CHECK_NEAR(off[0] / off[1], 4, 0.05);
    CHECK_NEAR(off[1] / off[2], 4, 0.02);
    CHECK(fabs(off[0]) < 0.02 * n_0);
}

/* A stiff contact without play: one mass, whatever its share on either side. */
static void stiff_contact_joins_them(void) {
    const Transmission p = {.on = true, .J = J, .c = 1e8, .d = 1e3};
    const TransmissionState x = driven(&p, (TransmissionState){.n = 0}, 3, 125e-6, 800);
    CHECK_NEAR(x.n, 3 * 0.1 / (J + J_S), 1e-6);
    CHECK_NEAR(x.n_s, x.n, 1e-6);
}

/* To and fro across the play, 2000 impacts and more: the energy stays, or is what the damping has made warm. */
static void energy_stays_or_warms(void) {
    Transmission p = {.on = true, .J = J, .c = C_T, .half = 0.5e-3};
    TransmissionState x = {.n = 0.5};
    const double whole = energy(&p, x);
    x = driven(&p, x, 0, 125e-6, 80000);
    CHECK_NEAR(energy(&p, x), whole, 1e-10 * whole);
    CHECK_EQUAL(x.heat, 0);
    p.d = 0.2;
    x = driven(&p, (TransmissionState){.n = 0.5}, 0, 125e-6, 800);
    CHECK_NEAR(energy(&p, x) + x.heat, whole, 1e-11 * whole);
    CHECK(x.heat > 0.3 * whole * J_S / (J + J_S));
}

/* Motor alone while the play lasts: b/2 at n_0, and the mass does not know of it. */
static void in_the_play_they_are_apart(void) {
    const Transmission p = {.on = true, .J = J, .c = C_T, .d = 1, .half = 0.5e-3};
    const TransmissionState x = driven(&p, (TransmissionState){.n = 1}, 0, 1e-6, 499);
    CHECK_EQUAL(x.n, 1);
    CHECK_EQUAL(x.n_s, 0);
    CHECK_EQUAL(x.C, 0);
    CHECK_NEAR(x.angle, 499e-6, 1e-15);
    CHECK(driven(&p, x, 0, 1e-6, 10).C > 0);
}

/* Swinging through the play: the period is that of the half waves in contact and of the ways between,
 * 2 pi/omega + 2 b/n_rel. */
static void period_with_play_is_that_of_its_pieces(void) {
    const Transmission p = {.on = true, .J = J, .c = C_T, .half = 0.5e-3};
    const double n_0 = 1, omega = sqrt(C_T * (1 / J + 1 / J_S)), h = 1e-6;
    const double period = 2 * acos(-1.0) / omega + 4 * p.half / n_0;
    TransmissionState x = {.n = n_0};
    const double by_n = h / (J + J_S), by_angle = h * h / (2 * (J + J_S)), none = 0;
    double at = 0, before = 0;
    int crossings = 0;
    for (int k = 1; crossings < 10; k++) { /* upwards through the middle */
        TransmissionState end;
        const double angle_free = x.angle_s + h * x.n_s, n_free = x.n_s;
        transmission_step(1, &p, &none, &none, &angle_free, &n_free, &by_angle, &by_n, &x, &end, h, &settled);
        x = end;
        const double delta = x.angle - x.angle_s;
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
    const double by_n[4] = {n, n, n, n}, by_angle[4] = {a, a, a, a}, u[2] = {1, 1}, none[2] = {0, 0};
    TransmissionState x[2] = {{.n = 0}, {.n = 0}}, end[2];
    for (int k = 0; k < 1000; k++) {
        const double angle_free[2] = {x[0].angle_s + h * x[0].n_s, x[1].angle_s + h * x[1].n_s};
        const double n_free[2] = {x[0].n_s, x[1].n_s};
        CHECK(transmission_step(2, p, u, none, angle_free, n_free, by_angle, by_n, x, end, h, &settled));
        CHECK(settled);
        for (int i = 0; i < 2; i++) { /* the structure's end has the torques of both */
            end[i].n_s = n_free[i] + n * (end[0].T + end[1].T);
            end[i].angle_s = angle_free[i] + a * (end[0].T + end[1].T);
            x[i] = end[i];
        }
    }
    CHECK_NEAR(J * (x[0].n + x[1].n) + J_S * x[0].n_s, 2 * 0.1, 1e-10);
}

/* Two motors that say to be 0.6 each of the one mass they move: there is no such machine. */
static void what_does_not_settle_is_said(void) {
    const double h = 1e-4, n = h * 0.6 / J, a = h * h * 0.3 / J;
    const Transmission p[2] = {{.on = true, .J = J, .c = C_T}, {.on = true, .J = J, .c = C_T}};
    const double by_n[4] = {n, n, n, n}, by_angle[4] = {a, a, a, a}, u[2] = {1, 1}, none[2] = {0, 0};
    TransmissionState x[2] = {{.n = 0}, {.n = 0}}, end[2];
    CHECK(transmission_step(2, p, u, none, none, u, by_angle, by_n, x, end, h, &settled));
    CHECK(!settled);
}

int main(void) {
    without_play_two_masses_swing();
    stiff_contact_joins_them();
    energy_stays_or_warms();
    in_the_play_they_are_apart();
    period_with_play_is_that_of_its_pieces();
    two_axes_move_one_mass();
    what_does_not_settle_is_said();
    return CHECK_RESULT;
}

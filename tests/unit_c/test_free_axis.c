/* The rigid axis under a given torque (src/friction_fmu/free_axis.c) against closed forms and a fine solution. */
#include "check.h"
#include "free_axis.h"
#include "friction_values.h"

enum { STEPS = 400 };

/* Coulomb friction that is next to none, bristles of 1 mrad; viscous friction as the tests set it */
static const double SMOOTH[PARAMETERS] = {[AT_sigma_0] = 1e-6, [AT_F_C] = 1e-9, [AT_F_S] = 1e-9, [AT_v_s] = 1,
                                          [AT_beta] = 1,       [AT_v_log] = 1,  [AT_gamma] = 1};
static const double J = 0.0164, H = 1e-3;

static double torque[STEPS], angle[STEPS + 2], speed[STEPS + 2];

static void mark(size_t at) {
    angle[at] = speed[at] = 77;
}

static void check_mark(size_t at) {
    CHECK(angle[at] == 77 && speed[at] == 77);
}

static void fill(double value) {
    for (int i = 0; i < STEPS; i++) {
        torque[i] = value;
    }
}

static void without_friction_it_falls_freely(void) {
    fill(0.5);
    mark(STEPS + 1);
    CHECK(free_axis(SMOOTH, J, 0.2, torque, STEPS, H, 1, -3, 0, angle, speed) == STEPS + 1);
    check_mark(STEPS + 1);
    for (int i = 0; i <= STEPS; i++) {
        const double t = H * i, a = 0.3 / J;
        CHECK_NEAR(speed[i], -3 + a * t, 1e-7); /* the friction that is left: 1e-9/J t */
        CHECK_NEAR(angle[i], t * (-3 + a / 2 * t), 1e-8);
    }
}

/* Greatest difference to J dn/dt = M - sigma_2 n from rest; the time constant is 82 ms. */
static double viscous_error(size_t substeps) {
    double values[PARAMETERS];
    memcpy(values, SMOOTH, sizeof values);
    values[AT_sigma_2] = 0.2;
    fill(0.5);
    CHECK(free_axis(values, J, 0, torque, STEPS, H, substeps, 0, 0, angle, speed) == STEPS + 1);
    double error = 0;
    for (int i = 0; i <= STEPS; i++) {
        const double t = H * i, tau = J / 0.2, reached = 0.5 / 0.2;
        error = fmax(error, fabs(speed[i] - reached * (1 - exp(-t / tau))));
        error = fmax(error, fabs(angle[i] - reached * (t - tau * (1 - exp(-t / tau)))));
    }
    return error;
}

static void viscous_friction_lets_it_approach_a_speed(void) {
    const double coarse = viscous_error(1), fine = viscous_error(8);
    CHECK_NEAR(coarse, 0, 2.5 * 1.5e-4); /* final speed times (h/tau)^2 */
    CHECK(coarse / fine > 60 && coarse / fine < 68);
}

static void below_break_away_it_sticks(void) {
    /* Constant g: dz = (1 - z/g) dx while it moves one way, so that a torque of F_C/2 moves it by g ln 2. Damped beyond
     * the critical 2 sqrt(sigma_0 J), that is without turning back. */
    const double values[PARAMETERS] = {[AT_sigma_0] = 300, [AT_sigma_2] = 5, [AT_F_C] = 1.6, [AT_F_S] = 1.6,
                                       [AT_v_s] = 1,       [AT_beta] = 1,    [AT_v_log] = 1, [AT_gamma] = 1};
    const double g = 1.6 / 300;
    fill(0.8 + 0.1);
    double way[2];
    for (int i = 0; i < 2; i++) {
        CHECK(free_axis(values, J, 0.1, torque, STEPS, H, 10, 0, 0, angle, speed) == STEPS + 1);
        way[i] = angle[STEPS];
        CHECK_NEAR(way[i], g * log(2), 1e-4 * g); /* after 400 ms, 12 times sigma_2/(sigma_0/2) */
        CHECK_NEAR(speed[STEPS], 0, 1e-5);
        for (int k = 1; k <= STEPS; k++) {
            CHECK(angle[k] >= angle[k - 1]);
        }
        /* with the deflection that holds the torque it does not move at all */
        CHECK(free_axis(values, J, 0.1, torque, STEPS, H, 10, 0, g / 2, angle, NULL) == STEPS + 1);
        CHECK_NEAR(angle[STEPS], 0, 1e-15);
    }
    CHECK_EQUAL(way[0], way[1]); /* nothing is kept between calls */
}

static void load_is_taken_off_the_torque(void) {
    static double expected[STEPS + 1];
    for (int i = 0; i < STEPS; i++) {
        torque[i] = 4 * sin(0.05 * i);
    }
    CHECK(free_axis(VALUES, J, 0, torque, STEPS, H, 2, 0, 0, expected, NULL) == STEPS + 1);
    for (int i = 0; i < STEPS; i++) {
        torque[i] += 0.5;
    }
    CHECK(free_axis(VALUES, J, 0.5, torque, STEPS, H, 2, 0, 0, angle, speed) == STEPS + 1);
    for (int i = 0; i <= STEPS; i++) {
        CHECK_NEAR(angle[i], expected[i], 1e-12); /* roundings of the sum */
    }
}

/* Several reversals, jumps from interval to interval. */
static void staircase(void) {
    for (int i = 0; i < STEPS; i++) {
        torque[i] = 4 * sin(0.07 * (i / 4) * 4 + 0.3) + 0.3;
    }
}

static double error_with(size_t substeps) {
    static double fine[STEPS + 1];
    CHECK(free_axis(VALUES, J, 0.1, torque, STEPS, H, 4096, 2, 1e-3, fine, NULL) == STEPS + 1);
    CHECK(free_axis(VALUES, J, 0.1, torque, STEPS, H, substeps, 2, 1e-3, angle, NULL) == STEPS + 1);
    double error = 0;
    for (int i = 0; i <= STEPS; i++) {
        error = fmax(error, fabs(angle[i] - fine[i]));
    }
    return error;
}

static void substeps_are_of_second_order(void) {
    staircase();
    /* A reversal lies somewhere within its step, and the extrapolated M_fr knows its kink afterwards only: that costs
     * an error of order 2 whose factor changes with the place. 64 times the substeps, then, and within a factor of 2.
     */
    const double ratio = error_with(2) / error_with(128);
    CHECK(ratio > 2048 && ratio < 8192);
}

static void substeps_are_intervals_of_the_same_torque(void) {
    static double fine[4 * STEPS], there[4 * STEPS + 1];
    staircase();
    for (int i = 0; i < 4 * STEPS; i++) {
        fine[i] = torque[i / 4];
    }
    CHECK(free_axis(VALUES, J, 0.1, fine, (size_t)4 * STEPS, H / 4, 1, 2, 1e-3, there, NULL) == 4 * STEPS + 1);
    CHECK(free_axis(VALUES, J, 0.1, torque, STEPS, H, 4, 2, 1e-3, angle, speed) == STEPS + 1);
    for (int i = 0; i <= STEPS; i++) {
        CHECK_EQUAL(angle[i], there[4 * i]);
    }
}

static size_t count_with(int parameter, double value) {
    double values[PARAMETERS];
    memcpy(values, VALUES, sizeof values);
    values[parameter] = value;
    return free_axis(values, J, 0, torque, STEPS, H, 1, 0, 0, angle, speed);
}

static void refusals(void) {
    staircase();
    for (int k = 0; k < REFUSED; k++) {
        const int i = BELOW[k].at;
        CHECK(count_with(i, VALUES[i]) == STEPS + 1);
        mark(0);
        CHECK(count_with(i, BELOW[k].value) == 0);
        CHECK(count_with(i, NAN) == 0);
        check_mark(0);
    }
    const double wrong[] = {0, -1, NAN, INFINITY};
    for (int i = 0; i < 4; i++) {
        CHECK(free_axis(VALUES, wrong[i], 0, torque, STEPS, H, 1, 0, 0, angle, speed) == 0);
        CHECK(free_axis(VALUES, J, 0, torque, STEPS, wrong[i], 1, 0, 0, angle, speed) == 0);
    }
    CHECK(free_axis(VALUES, J, 0, torque, STEPS, H, 0, 0, 0, angle, speed) == 0);
    check_mark(0);
    CHECK(free_axis(VALUES, J, 0, torque, 0, H, 1, 5, 0, angle, speed) == 1); /* an instant alone */
    CHECK(angle[0] == 0 && speed[0] == 5);
}

static void stops_where_the_motion_is_no_number(void) {
    const double wild[] = {0, 1, NAN, 1};
    mark(3);
    CHECK(free_axis(VALUES, J, 0, wild, 4, H, 2, 0, 0, angle, speed) == 3);
    check_mark(3);
    CHECK(free_axis(VALUES, J, NAN, wild, 4, H, 2, 0, 0, angle, speed) == 1);
    CHECK(free_axis(VALUES, J, 0, wild, 4, H, 2, 0, NAN, angle, speed) == 1);
    mark(0);
    CHECK(free_axis(VALUES, J, 0, wild, 4, H, 2, NAN, 0, angle, speed) == 0);
    check_mark(0);
}

int main(void) {
    without_friction_it_falls_freely();
    viscous_friction_lets_it_approach_a_speed();
    below_break_away_it_sticks();
    load_is_taken_off_the_torque();
    substeps_are_of_second_order();
    substeps_are_intervals_of_the_same_torque();
    refusals();
    stops_where_the_motion_is_no_number();
    return CHECK_RESULT;
}

/* What real drives have besides: torques over the motor's turn, errors of measuring, corrections of the control. */
#include "check.h"
#include "drive.h"

static const double T_C = 125e-6, PI = 3.141592653589793;

/* Speed in a straight line: the angle is the parabola, and the torque that of the angle; at t_k+1 as well. */
static void angle_is_the_integral_of_the_speed(void) {
    Orders p = {.count = 0};
    orders_add(&p, 6.0, 0.4, 0.3, 0);
    orders_add(&p, 12.0, 0.0, 0.0, 0); /* off: left out */
    orders_add(&p, 2.5, 0.05, -0.2, 1);
    CHECK(p.count == 2);
    OrdersState x = {.turning = 0};
    for (int k = 0; k < 4000; ++k) {
        const double t = k * T_C;
        orders_turn(&p, &x, 3.0 + 40.0 * t, T_C);
        const double phi = 3.0 * t + 20.0 * t * t, next = t + T_C, ahead = 3.0 * next + 20.0 * next * next;
        const double cogging = 0.4 * sin(6.0 * phi + 0.3), ripple = 0.05 * sin(2.5 * phi - 0.2);
        /* 4000 roundings of an angle of up to 2 pi */
        CHECK_NEAR(orders_torque(&p, x.theta, 7.0), 7.0 * (1.0 + ripple) + cogging, 1e-11);
        if (k > 0) {
            CHECK_NEAR(orders_torque(&p, x.ahead, 0.0), 0.4 * sin(6.0 * ahead + 0.3), 1e-11);
        }
    }
}

/* Two hours at 3000 rpm, order 30: 10.8 million turns of that angle, each 2.4e-16 off by what 2 pi is as a double. */
static void angle_stays_within_its_turn(void) {
    Orders p = {.count = 0};
    orders_add(&p, 30.0, 1.0, 0.0, 0);
    OrdersState x = {.turning = 0};
    const double step = 0.125, n = 100.0 * PI; /* 39.27 rad a step: 187.5 turns of the order */
    for (int k = 0; k <= 57600; ++k) {
        orders_turn(&p, &x, n, step);
    }
    CHECK(fabs(x.theta[0]) <= 2.0 * PI);
    CHECK_NEAR(sin(x.theta[0]), 0.0, 1e-7); /* 57600 whole and half turns: even */
    CHECK_EQUAL(angle_within_turn(1e300), 0.0);
    CHECK_EQUAL(angle_within_turn(INFINITY), 0.0);
    CHECK_EQUAL(orders_too_fast(&p, 300.0, T_C), 0.0); /* 1432 Hz, a fifth is 1600 Hz */
    CHECK_EQUAL(orders_too_fast(&p, -340.0, T_C), 30.0);
}

static void points_are_linear_and_hold_beyond(void) {
    const double at[POINTS] = {1, 2, 4, 4, 4, 4, 4, 4, 4, 4, 9};
    const Points p = points_of(0.1, 0.05, at);
    CHECK(p.used && !points_of(0.1, 0.0, at).used);
    CHECK_EQUAL(points_value(&p, -5.0), 1.0);
    CHECK_NEAR(points_value(&p, 0.125), 1.5, 1e-14);
    CHECK_NEAR(points_value(&p, 0.19), 3.6, 1e-14);
    CHECK_NEAR(points_value(&p, 0.599), 8.9, 1e-12);
    CHECK_EQUAL(points_value(&p, 7.0), 9.0);
    CHECK_EQUAL(points_value(&p, NAN), 1.0);
}

static void errors_are_zero_at_the_start(void) {
    Measuring p = {.T_c = T_C, .I_P = 0.003, .linear = 20e-6};
    measuring_add(&p, 20e-6, 0.1e-6, 0.4);
    measuring_add(&p, 10e-6, 0.0, 0.4);
    CHECK(p.periodic_errors == 1);
    MeasuringState x = {.started = 0};
    for (int k = 0; k < 200; ++k) {
        const double place = 0.8 + 1.1e-6 * k;
        double x_a = place, n_a = 4.0;
        measuring_step(&p, &x, k, &x_a, &n_a);
        const double wave = 2.0 * PI / 20e-6;
        const double error = 20e-6 * (place - 0.8) + 0.1e-6 * (sin(wave * place + 0.4) - sin(wave * 0.8 + 0.4));
        CHECK_NEAR(x_a - place, error, 1e-15); /* an ulp of 0.8 m, and 1e-11 rad of the wave's angle times 0.1 um */
        CHECK_EQUAL(n_a, 4.0);
    }
}

/* An eccentric encoder: its speed is the derivative of its angle. */
static void indirect_is_the_angle_of_the_motor(void) {
    const double e = 0.01, n = 20.0;
    Measuring p = {.T_c = T_C, .I_P = 0.003, .indirect = true, .eccentricity = e, .eccentric_phase = 0.7};
    MeasuringState x = {.started = 0};
    double before = 0.0, speed_before = 0.0;
    for (int k = 0; k < 3000; ++k) {
        double x_a = k == 0 ? 0.25 : 99.0, n_a = n; /* the scale counts at the first instant alone */
        measuring_step(&p, &x, k, &x_a, &n_a);
        const double phi = n * k * T_C;
        CHECK_NEAR(x_a, 0.25 + 0.003 * (phi + e * (sin(phi + 0.7) - sin(0.7))), 1e-13); /* 3000 roundings */
        CHECK_NEAR(n_a, n * (1.0 + e * cos(phi + 0.7)), 1e-11);
        if (k > 0) { /* trapezoidal rule: e n^3 T_c^3/12 off */
            CHECK_NEAR(x_a - before, 0.003 * 0.5 * T_C * (n_a + speed_before), 1e-13);
        }
        before = x_a;
        speed_before = n_a;
    }
}

static void resolution_and_noise(void) {
    Measuring p = {.T_c = T_C, .I_P = 0.003, .resolution = 1e-7};
    MeasuringState x = {.started = 0};
    for (int k = 0; k < 100; ++k) {
        double x_a = 0.1 + 1.7e-8 * k, n_a = 0.0;
        const double place = x_a;
        measuring_step(&p, &x, k, &x_a, &n_a);
        CHECK(fabs(x_a - place) <= 0.5e-7 * (1.0 + 1e-8));
        CHECK_NEAR(x_a / 1e-7, round(x_a / 1e-7), 1e-9);
    }
    double sum = 0.0, squares = 0.0, product = 0.0, other = 0.0, last = 0.0;
    const int count = 200000;
    for (int k = 0; k < count; ++k) {
        const double noise = noise_of_instant(7, k);
        sum += noise;
        squares += noise * noise;
        product += noise * last;
        other += noise * noise_of_instant(8, k);
        last = noise;
    }
    const double sigma = 1.0 / sqrt(count); /* of a mean of so many; within 5 of them */
    CHECK_NEAR(sum / count, 0.0, 5.0 * sigma);
    CHECK_NEAR(squares / count, 1.0, 5.0 * 1.3 * sigma); /* kurtosis 2.7: the variance's own is sqrt(1.7) */
    CHECK_NEAR(product / count, 0.0, 5.0 * sigma);
    CHECK_NEAR(other / count, 0.0, 5.0 * sigma);
    CHECK_EQUAL(noise_of_instant(7, 123), noise_of_instant(7, 123)); /* of seed and instant alone */
}

static void backlash_compensation_follows_the_setpoint(void) {
    const Corrections p = {.used = true, .backlash = 8e-6, .change = 0.25};
    CorrectionsState x = {.started = 0};
    CHECK_EQUAL(corrections_step(&p, &x, 0.1), 0.1);
    double x_s = 0.1;
    for (int k = 1; k <= 10; ++k) {
        x_s += 1e-4;
        CHECK_NEAR(corrections_step(&p, &x, x_s) - x_s, 4e-6 * fmin(1.0, 0.25 * k), 1e-16);
    }
    CHECK_NEAR(corrections_step(&p, &x, x_s) - x_s, 4e-6, 1e-16); /* at rest it stays */
    for (int k = 1; k <= 10; ++k) {
        x_s -= 1e-4;
        CHECK_NEAR(corrections_step(&p, &x, x_s) - x_s, 4e-6 * fmax(-1.0, 1.0 - 0.25 * k), 1e-16);
    }
    const double plus[POINTS] = {0, 1e-6, 2e-6, 3e-6, 4e-6, 5e-6, 6e-6, 7e-6, 8e-6, 9e-6, 1e-5};
    const double minus[POINTS] = {-1e-6, -1e-6, -1e-6, -1e-6, -1e-6, -1e-6, -1e-6, -1e-6, -1e-6, -1e-6, -1e-6};
    Corrections table = {.used = true, .change = 2.0, .leadscrew = points_of(0.0, 0.1, plus)};
    CorrectionsState y = {.started = 0};
    corrections_step(&table, &y, 0.2);
    CHECK_NEAR(corrections_step(&table, &y, 0.25) - 0.25, 2.5e-6, 1e-16);
    table.leadscrew_minus = points_of(0.0, 0.1, minus);
    CHECK_NEAR(corrections_step(&table, &y, 0.26) - 0.26, 2.6e-6, 1e-16);
    CHECK_NEAR(corrections_step(&table, &y, 0.25) - 0.25, -1e-6, 1e-16);
}

/* What a spline leaves of the end of a motion, to and fro about it, is no reversal; nor is a way back within the
 * resolution, however long it takes. Beyond it is one. */
static void a_way_back_within_the_resolution_is_no_reversal(void) {
    const Corrections p = {.used = true, .resolution = 1e-7, .backlash = 8e-6, .change = 2.0};
    const double left_of_a_stop[] = {1.7e-8, -1.7e-8, -4.6e-9, 4.6e-9, 1.2e-9, -1.2e-9, 0.0};
    for (int side = -1; side <= 1; side += 2) {
        CorrectionsState x = {.started = 0};
        double end = 0.1;
        corrections_step(&p, &x, end);
        for (int k = 0; k < 10; ++k) {
            end += side * 1e-4;
            corrections_step(&p, &x, end);
        }
        for (size_t k = 0; k < sizeof left_of_a_stop / sizeof *left_of_a_stop; ++k) {
            const double x_s = end + side * left_of_a_stop[k];
            CHECK_NEAR(corrections_step(&p, &x, x_s) - x_s, side * 4e-6, 1e-16);
        }
        for (int k = 1; k <= 20; ++k) { /* of the furthest point, which is 17 nm behind the end */
            const double back = k * 1e-8, x_s = end - side * back;
            CHECK_NEAR(corrections_step(&p, &x, x_s) - x_s, side * (back + 1.7e-8 > 1e-7 ? -4e-6 : 4e-6), 1e-16);
        }
    }
}

/* Without current there is cogging, and no ripple; with the ideal current loop both act at once. */
static void cogging_needs_no_current(void) {
    Drive p = {.T_c = T_C, .ticks = 8, .K_t = 2.0, .ideal_current_loop = true};
    const PositionParameters position = {.T_pos = 1e-3, .I_P = 0.003, .K_v = 0.0};
    p.position = position_of(&position);
    p.ramp = (SetpointRamp){.ticks = 8, .ramped = true};
    p.reference_model = reference_model_of(false, 900.0, 1.0, 0.0, T_C);
    p.speed = speed_of(0.0, 0.012, false, 80.0, T_C);
    orders_add(&p.orders, 4.0, 0.5, 0.0, 0);
    orders_add(&p.orders, 1.0, 0.1, 0.5, 1);
    drive_layout(&p);
    DriveState x = {.instant = 0};
    double lines[64];
    for (int k = 0; k < 100; ++k) {
        const bool on = k >= 50;
        const DriveInputs in = {.n_a = 50.0, .M_add = 3.0, .release = on};
        drive_instant(&p, &x, lines, &in);
        const double phi = 50.0 * T_C * k, next = phi + 50.0 * T_C, M = on ? 3.0 : 0.0;
        CHECK_NEAR(x.left.M_a, M * (1.0 + 0.1 * sin(phi + 0.5)) + 0.5 * sin(4.0 * phi), 1e-12);
        CHECK_NEAR(x.right.M_a, M * (1.0 + 0.1 * sin(next + 0.5)) + 0.5 * sin(4.0 * next), 1e-12);
    }
}

static void pulse_has_the_characteristic_of_the_manual(void) {
    FrictionPulse p = {.used = true, .adaptation = true, .amplitude = 3e-4, .min = 8e-4};
    p.acceleration[0] = 0.02;
    p.acceleration[1] = 0.1;
    p.acceleration[2] = 0.5;
    CHECK_NEAR(pulse_amplitude(&p, 0.005), 3e-4 / 4.0, 1e-18);
    CHECK_EQUAL(pulse_amplitude(&p, 0.02), 3e-4);
    CHECK_EQUAL(pulse_amplitude(&p, 0.07), 3e-4);
    CHECK_NEAR(pulse_amplitude(&p, 0.3), 5.5e-4, 1e-18);
    CHECK_EQUAL(pulse_amplitude(&p, 0.5), 8e-4);
    CHECK_EQUAL(pulse_amplitude(&p, 9.0), 8e-4);
    p.adaptation = false;
    CHECK_EQUAL(pulse_amplitude(&p, 0.005), 3e-4);
}

/* Of a constant acceleration through standstill: the pulse begins `wait` behind the first sample of the other
 * sign, and not ahead of when the reversal is known. */
static void pulse_begins_at_the_reversal_and_decays(void) {
    const double I_P = 0.003, T_pos = 1e-3, T = 0.02;
    for (int late = 0; late < 8; ++late) {
        const double wait = 0.7e-3 * (late / 2), resolution = late % 2 > 0 ? 1e-7 : 0.0;
        const int known = late % 2 > 0 ? 19 : 18; /* behind 0.03 um, or 0.12 um */
        const FrictionPulse p = {.used = true,
                                 .resolution = resolution,
                                 .I_P = I_P,
                                 .T_pos = T_pos,
                                 .amplitude = 6e-4,
                                 .T = T,
                                 .wait = wait};
        PulseState x = {.n = 0.0};
        for (int k = 0; k < 100; ++k) {
            const double n = 0.35 - 0.02 * k; /* reverses between 17 and 18 */
            const double value = pulse_step(&p, &x, n), since = (k - 18) * T_pos - wait;
            const double expected = since < -1e-12 || k < known ? 0.0 : -0.2 * exp(-since / T);
            CHECK_NEAR(value, expected, 1e-12);
        }
    }
}

static void pulse_needs_a_reversal(void) {
    const FrictionPulse p = {
        .used = true, .resolution = 1e-7, .I_P = 0.003, .T_pos = 1e-3, .amplitude = 6e-4, .T = 0.02};
    PulseState x = {.n = 0.0};
    const double n[] = {0.0, 1.0, 2.0, 0.0, 1e-6, -1e-6, 0.0, 3.0}; /* what a spline leaves of a stop is none */
    for (int k = 0; k < 8; ++k) {
        CHECK_EQUAL(pulse_step(&p, &x, n[k]), 0.0);
    }
    CHECK_NEAR(pulse_step(&p, &x, -1.0), -0.2, 1e-15);
    CHECK_NEAR(pulse_step(&p, &x, 1.0), 0.2, 1e-15); /* in the place of the one before */
}

static void torque_follows_the_table_over_the_speed(void) {
    TorqueTable p = {.points = 3, .I_P = 0.01, .T_pos = 1e-3, .distance = 2e-5};
    const double speed[] = {0.0, 0.01, 0.03}, torque[] = {1.0, 3.0, 2.0};
    for (int i = 0; i < 3; ++i) {
        p.speed[i] = speed[i];
        p.torque[i] = torque[i];
    }
    CHECK_EQUAL(torque_table_value(&p, 0.0), 1.0);
    CHECK_NEAR(torque_table_value(&p, 0.005), 2.0, 1e-15);
    CHECK_NEAR(torque_table_value(&p, 0.02), 2.5, 1e-15);
    CHECK_EQUAL(torque_table_value(&p, 1.0), 2.0);
    p.delay = delay_linear(2.0);
    TorqueTableState x;
    double ring[8];
    torque_table_start(&p, &x, ring);
    double way = 0.0;
    for (int k = 0; k < 40; ++k) {
        const double n = k < 20 ? 0.5 : -0.5; /* 5 mm/s: 2 N.m */
        torque_table_step(&p, &x, ring, n);
        const double sign = k < 2 ? 0.0 : k < 22 ? 1.0 : -1.0;
        way = k < 2 ? 0.0 : k == 22 ? 5e-6 : way + 5e-6;
        CHECK_NEAR(x.M, sign * 2.0 * fmin(1.0, way / 2e-5), 1e-12);
    }
}

/* Both act in the drive: the pulse behind the position controller, the torque behind the speed controller. */
static void compensations_act_in_the_drive(void) {
    Drive p = {.T_c = T_C, .ticks = 8, .K_t = 2.0, .ideal_current_loop = true};
    const PositionParameters position = {.T_pos = 1e-3, .I_P = 0.003, .K_v = 0.0, .k_ffw = 0.0};
    p.position = position_of(&position);
    p.ramp = (SetpointRamp){.ticks = 8, .ramped = false};
    p.reference_model = reference_model_of(false, 900.0, 1.0, 0.0, T_C);
    p.speed = speed_of(5.0, 0.012, false, 80.0, T_C);
    p.pulse = (FrictionPulse){.used = true, .I_P = 0.003, .T_pos = 1e-3, .amplitude = 6e-4, .T = 0.02};
    p.table = (TorqueTable){.points = 1, .I_P = 0.003, .T_pos = 1e-3, .delay = delay_linear(0.0)};
    p.table.torque[0] = 1.5;
    drive_layout(&p);
    DriveState x = {.instant = 0};
    double lines[64];
    for (int k = 0; k < 80; ++k) {
        const DriveInputs in = {.n_ffw = k < 40 ? 1.0 : -1.0, .release = true};
        drive_instant(&p, &x, lines, &in);
        const double pulse = k < 40 ? 0.0 : -0.2 * exp(-((k - 40) / 8) * 1e-3 / 0.02);
        CHECK_NEAR(x.n_s, pulse, 1e-12);
        CHECK_NEAR(x.M_s, 5.0 * pulse + (k < 40 ? 1.5 : -1.5), 1e-12);
    }
}

int main(void) {
    angle_is_the_integral_of_the_speed();
    angle_stays_within_its_turn();
    points_are_linear_and_hold_beyond();
    errors_are_zero_at_the_start();
    indirect_is_the_angle_of_the_motor();
    resolution_and_noise();
    backlash_compensation_follows_the_setpoint();
    a_way_back_within_the_resolution_is_no_reversal();
    cogging_needs_no_current();
    pulse_has_the_characteristic_of_the_manual();
    pulse_begins_at_the_reversal_and_decays();
    pulse_needs_a_reversal();
    torque_follows_the_table_over_the_speed();
    compensations_act_in_the_drive();
    return CHECK_RESULT;
}

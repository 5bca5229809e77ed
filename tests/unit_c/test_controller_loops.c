/* Speed, current and position controller: laws, limits and anti-windup. */
#include "check.h"
#include "current.h"
#include "position.h"
#include "setpoint_ramp.h"
#include "speed.h"

static const double T_C = 125e-6;

static void speed_is_a_pi_controller(void) {
    SpeedController p = speed_of(6.18, 0.012, true, 80.0, T_C);
    SpeedState x = {0.0, false};
    double sum = 0.0;
    for (int k = 0; k < 50; ++k) {
        double n_s = 3.0 + 0.01 * k;
        double n_ref = 2.5 + 0.01 * k;
        double n_a = 0.02 * k;
        sum += n_ref - n_a; /* the integral includes this instant */
        double expected = 6.18 * (n_s - n_a) + 6.18 * T_C / 0.012 * sum + 0.5;
        CHECK_NEAR(speed_step(&p, &x, n_s, n_ref, n_a, 0.5), expected, 1e-13); /* rounding at 25, 50 times */
        CHECK(!x.limited);
    }
}

static void speed_without_integrator(void) {
    SpeedController p = speed_of(2.0, 1e-6, false, 5.0, T_C);
    SpeedState x = {0.0, false};
    CHECK(speed_step(&p, &x, 1.0, 7.0, 0.0, 0.0) == 2.0);
    CHECK(speed_step(&p, &x, 9.0, 7.0, 0.0, 0.0) == 5.0); /* limited: no memory of it either */
    CHECK(x.limited);
    CHECK(speed_step(&p, &x, 1.0, 7.0, 0.0, 0.0) == 2.0);
    CHECK(!x.limited);
    CHECK(x.I == 0.0);
}

static void speed_limit_includes_the_excitation(void) {
    SpeedController p = speed_of(2.0, 0.01, true, 5.0, T_C);
    SpeedState x = {0.0, false};
    CHECK(speed_step(&p, &x, 0.0, 0.0, 0.0, 6.0) == 5.0);
    CHECK(x.limited);
    SpeedState y = {0.0, false};
    CHECK(speed_step(&p, &y, 0.0, 0.0, 0.0, -6.0) == -5.0);
    CHECK(y.limited);
    SpeedState z = {0.0, false};
    CHECK(speed_step(&p, &z, 0.0, 0.0, 0.0, 5.0) == 5.0); /* just reached is not limited */
    CHECK(!z.limited);
}

/* What is no number is not taken for one at the limit: nobody would see it. */
static void speed_limit_lets_no_number_pass(void) {
    SpeedController p = speed_of(2.0, 0.01, true, 5.0, T_C);
    SpeedState x = {NAN, false};
    CHECK(isnan(speed_step(&p, &x, 0.0, 0.0, 0.0, 0.0)));
    CHECK(isnan(x.I));
}

/* A setpoint far above what the torque limit reaches, for 0.2 s; then it falls to just below the speed. */
static void speed_integrator_does_not_wind_up(void) {
    const double K_p = 6.18;
    const double T_n = 0.012;
    const double M_max = 80.0;
    SpeedController p = speed_of(K_p, T_n, true, M_max, T_C);
    SpeedState x = {0.0, false};
    double last = 0.0;
    for (int k = 0; k < 1600; ++k) {
        last = speed_step(&p, &x, 100.0, 100.0, 0.0, 0.0);
        CHECK(x.limited && last == M_max);
    }
    /* I(t_k) = I + K_p c e + c (M_max - K_p e - I - K_p c e), c = T_c/T_n, settles at M_max - K_p e + K_p e (1 - c):
     * the tracking's fixed point, M_max - c K_p e, reached within 17 T_n. Without anti-windup I would be 10300 N.m. */
    double c = T_C / T_n;
    CHECK_NEAR(x.I, M_max - c * K_p * 100.0, 1e-4 * M_max);
    /* As soon as the error turns round, the torque leaves its limit: in the first instant. */
    double M = speed_step(&p, &x, -0.5, -0.5, 0.0, 0.0);
    CHECK(!x.limited && M < M_max);
    /* What M was at the limit is not forgotten by a stronger tracking than 1 either: T_n below T_c. */
    SpeedController fast = speed_of(K_p, 0.1 * T_C, true, M_max, T_C);
    SpeedState y = {0.0, false};
    for (int k = 0; k < 100; ++k) {
        CHECK(speed_step(&fast, &y, 100.0, 100.0, 0.0, 0.0) == M_max);
        CHECK(fabs(y.I) < 1e4);
    }
    CHECK(speed_step(&fast, &y, -20.0, -20.0, 0.0, 0.0) < M_max);
}

static const Pmsm MOTOR = {.R = 0.45, .L_d = 4e-3, .L_q = 6e-3, .psi = 0.25, .p = 5.0};

static void current_law(void) {
    CurrentController p = current_of(17.0, 0.011, 350.0, T_C);
    CurrentState x = {0.0, 0.0, 0.0, 0.0, false};
    PmsmState i = {-2.0, 6.0};
    const double omega = 5.0 * 30.0;
    for (int k = 1; k <= 3; ++k) {
        current_step(&p, &x, &MOTOR, &i, 9.0, 30.0);
        double share = 1.0 + k * T_C / 0.011; /* P part and k integrator steps */
        CHECK_NEAR(x.u_d, 17.0 * 2.0 * share - omega * 6e-3 * 6.0, 1e-13);
        CHECK_NEAR(x.u_q, 17.0 * 3.0 * share + omega * (4e-3 * -2.0 + 0.25), 1e-13);
        CHECK(!x.limited);
    }
}

static void current_limit_keeps_the_direction(void) {
    CurrentController p = current_of(17.0, 0.011, 50.0, T_C);
    CurrentController free = current_of(17.0, 0.011, 1e9, T_C);
    CurrentState x = {0.0, 0.0, 0.0, 0.0, false};
    CurrentState y = x;
    PmsmState i = {-2.0, 6.0};
    current_step(&p, &x, &MOTOR, &i, 20.0, 30.0);
    current_step(&free, &y, &MOTOR, &i, 20.0, 30.0);
    CHECK(x.limited && !y.limited);
    CHECK_NEAR(hypot(x.u_d, x.u_q), 50.0, 1e-14 * 50.0);
    CHECK_NEAR(x.u_d * y.u_q - x.u_q * y.u_d, 0.0, 1e-11); /* rounding of products of 1e4 */
    CHECK(x.u_q > 0.0 && x.u_d * y.u_d > 0.0);
    CurrentController none = current_of(17.0, 0.011, 0.0, T_C);
    current_step(&none, &x, &MOTOR, &i, 20.0, 30.0);
    CHECK(x.limited && x.u_d == 0.0 && x.u_q == 0.0);
}

static void current_integrators_do_not_wind_up(void) {
    CurrentController p = current_of(17.0, 0.011, 50.0, T_C);
    CurrentState x = {0.0, 0.0, 0.0, 0.0, false};
    PmsmState rest = {0.0, 0.0};
    for (int k = 0; k < 2000; ++k) { /* 0.25 s at the limit: without anti-windup I_q would be 17 * 40 * 23 = 15 kV */
        current_step(&p, &x, &MOTOR, &rest, 40.0, 0.0);
        CHECK(x.limited);
    }
    CHECK(fabs(x.I_q) < 60.0);
    current_step(&p, &x, &MOTOR, &rest, -0.5, 0.0);
    CHECK(!x.limited);
}

static void ramp_and_hold(void) {
    const SetpointRamp ramped = {8, true};
    const SetpointRamp held = {8, false};
    const SetpointRamp one = {1, true};
    SetpointRampState x = {0.0, 0.0};
    setpoint_ramp_take(&x, 4.0);
    setpoint_ramp_take(&x, 12.0);
    for (int j = 0; j < 8; ++j) {
        CHECK(setpoint_ramp_value(&ramped, &x, j) == 4.0 + j + 1.0);
        CHECK(setpoint_ramp_value(&held, &x, j) == 12.0);
    }
    CHECK(setpoint_ramp_value(&one, &x, 0) == 12.0);
}

static PositionParameters neutral(void) {
    const PositionParameters q = {
        .T_pos = 1e-3, .I_P = 0.003, .K_v = 60.0, .k_ffw = 1.0, .T_dyn = 0.0, .T_sym = 0.0, .symmetry_lag = false};
    return q;
}

static void position_is_p_with_feedforward(void) {
    PositionParameters q = neutral();
    q.k_ffw = 0.9;
    Position p = position_of(&q);
    PositionState x = {.x_e = 0.0};
    double x_ring[1];
    double n_ring[1];
    CHECK(p.x_delay.length == 1 && p.n_delay.length == 1);
    position_start(&p, &x, x_ring, n_ring, 0.1);
    double n = position_step(&p, &x, x_ring, n_ring, 0.1005, 7.0, 0.1);
    CHECK_NEAR(n, 60.0 * 0.0005 / 0.003 + 0.9 * 7.0, 1e-12); /* 0.1005 - 0.1 is good to 3e-17 * 2e4 */
    CHECK_NEAR(x.x_e, 0.0005, 3e-17);
}

/* T y' + y = t^2/2 settles at ((t - T)^2 + T^2)/2. The first-order hold drives with the parabola's chords, which lie
 * u (h - u)/2 above it within a sampling time h: this is what the lag makes of them, at the samples. */
static double chords(double T, double h) {
    double E = exp(-h / T);
    double first = T - E * (T + h);                                        /* integral of u exp(-u/T)/T */
    double second = 2.0 * T * T - E * (h * h + 2.0 * h * T + 2.0 * T * T); /* of u^2 exp(-u/T)/T */
    return (h * first - second) / 2.0 / (1.0 - E);
}

/* At constant acceleration a: setpoint delayed by T_dyn and the symmetry filter, feedforward by T_dyn alone. */
static void position_delays(void) {
    const double a = 10.0;
    for (int lag = 0; lag < 2; ++lag) {
        PositionParameters q = neutral();
        q.T_dyn = 1.326e-3;
        q.T_sym = 3.528e-3;
        q.symmetry_lag = lag != 0;
        Position p = position_of(&q);
        PositionState x = {.x_e = 0.0};
        double x_ring[16];
        double n_ring[16];
        CHECK(p.x_delay.length <= 16 && p.n_delay.length <= 16);
        position_start(&p, &x, x_ring, n_ring, 0.0);
        for (int k = 0; k < 200; ++k) {
            double t = k * 1e-3;
            double n = position_step(&p, &x, x_ring, n_ring, a * t * t / 2.0, a * t / q.I_P, 0.0);
            double late = t - q.T_dyn;
            double x_delayed = a * (late - q.T_sym) * (late - q.T_sym) / 2.0;
            if (k > 120) {
                if (lag) {
                    x_delayed += a * q.T_sym * q.T_sym / 2.0 + a * chords(q.T_sym, q.T_pos);
                }
                CHECK_NEAR(x.x_e, x_delayed, 1e-14); /* transient exp(-34) of 1e-4; rounding at 0.2 */
                CHECK_NEAR(n, (q.K_v * x_delayed + a * late) / q.I_P, 1e-9);
            }
        }
    }
}

int main(void) {
    speed_is_a_pi_controller();
    speed_without_integrator();
    speed_limit_includes_the_excitation();
    speed_limit_lets_no_number_pass();
    speed_integrator_does_not_wind_up();
    current_law();
    current_limit_keeps_the_direction();
    current_integrators_do_not_wind_up();
    ramp_and_hold();
    position_is_p_with_feedforward();
    position_delays();
    return CHECK_RESULT;
}

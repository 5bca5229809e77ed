/* Delay line and first-order lag of the controller against closed forms. */
#include "check.h"
#include "delay.h"
#include "lag.h"
#include "measured_speed.h"

#define RING 64

static double cubic(double t) {
    return 0.7 - 1.3 * t + 0.4 * t * t - 0.05 * t * t * t;
}

/* Largest deviation of a delayed signal from the signal at the delayed instant, once the ring is full. */
static double worst(Delay p, double (*signal)(double), double h, double samples) {
    double ring[RING];
    int32_t newest;
    double deviation = 0.0;
    CHECK(p.length <= RING);
    delay_fill(&p, ring, &newest, 0.0);
    for (int k = 0; k < 3 * RING; ++k) {
        double y = delay_step(&p, ring, &newest, signal(k * h));
        if (k >= p.length) {
            deviation = fmax(deviation, fabs(y - signal((k - samples) * h)));
        }
    }
    return deviation;
}

static void cubics_are_exact(void) {
    static const double delays[] = {0.0, 1e-6, 0.3, 0.999999, 1.0, 1.25, 1.326, 2.0, 2.5, 4.854, 7.0, 30.75};
    for (size_t i = 0; i < sizeof delays / sizeof delays[0]; ++i) {
        /* rounding of values up to cubic(9.6) = 20, amplified by weights below 4 (inside the first interval) */
        CHECK_NEAR(worst(delay_cubic(delays[i]), cubic, 0.05, delays[i]), 0.0, 2e-14);
    }
}

static double line(double t) {
    return 3.0 - 2.0 * t;
}

static void lines_are_exact(void) {
    static const double delays[] = {0.0, 0.3, 1.0, 2.75};
    for (size_t i = 0; i < sizeof delays / sizeof delays[0]; ++i) {
        CHECK_NEAR(worst(delay_linear(delays[i]), line, 0.05, delays[i]), 0.0, 1e-14); /* rounding of values to 17 */
    }
}

static void order_is_that_of_the_polynomial(double samples, Delay (*delay)(double), double order) {
    /* Error c h^order: two samplings a factor 2 apart; the next term leaves 2 % at these steps. */
    double coarse = worst(delay(samples), sin, 0.02, samples);
    double fine = worst(delay(samples), sin, 0.01, samples);
    CHECK_NEAR(log2(coarse / fine), order, 0.03);
}

static void whole_delays_are_exact(void) {
    static const int delays[] = {0, 1, 2, 5, 17};
    for (size_t i = 0; i < sizeof delays / sizeof delays[0]; ++i) {
        int m = delays[i];
        /* quotients of times: 3.528e-3 / 1e-3 and the like are off by an ulp or two */
        const Delay lines[] = {delay_cubic(m * (1.0 + 4e-16)), delay_linear(m * (1.0 - 4e-16))};
        for (int j = 0; j < 2; ++j) {
            double ring[RING];
            int32_t newest;
            delay_fill(&lines[j], ring, &newest, -7.0);
            for (int k = 0; k < 100; ++k) {
                double y = delay_step(&lines[j], ring, &newest, sin(k));
                CHECK(y == (k >= m ? sin(k - m) : -7.0));
            }
        }
    }
}

static void a_constant_past_stays(void) {
    /* before the start the setpoint stood at its first value: nothing moves, and nothing arrives before the delay is
     * over */
    Delay p = delay_cubic(4.854);
    double ring[RING];
    int32_t newest;
    delay_fill(&p, ring, &newest, 0.625);
    for (int k = 0; k < 20; ++k) {
        /* weights sum to 1 within 2 ulp */
        CHECK_NEAR(delay_step(&p, ring, &newest, 0.625), 0.625, 3e-16);
    }
    CHECK(p.length == 7); /* 3, 4, 5, 6: the interval 4..5 lies in the middle */
    CHECK(p.first == 3);
}

static void lag_follows_a_ramp(void) {
    const double h = 1e-3;
    static const double times[] = {1e-7, 3.528e-3, 0.2};
    for (size_t i = 0; i < sizeof times / sizeof times[0]; ++i) {
        double T = times[i];
        Lag p = lag_of(T, h);
        LagState x;
        lag_settle(&x, 0.3);
        for (int k = 0; k < 400; ++k) {
            double t = k * h;
            /* T y' + y = 0.3 + 2 t, y(0) = 0.3 */
            double exact = 0.3 + 2.0 * (t - T + T * exp(-t / T));
            CHECK_NEAR(lag_step(&p, &x, 0.3 + 2.0 * t), exact, 1e-13); /* rounding, summed over 400 samples */
        }
    }
}

static void lag_settles_on_the_input(void) {
    Lag p = lag_of(3.528e-3, 1e-3);
    LagState x;
    lag_settle(&x, 0.0);
    double y = 0.0;
    for (int k = 0; k < 300; ++k) {
        y = lag_step(&p, &x, 0.1);
    }
    /* Unit gain: it stops where c_0 (u - y) falls below half an ulp, that is at ulp/(2 c_0) = 2 ulp of 0.1. */
    CHECK_NEAR(y, 0.1, 3e-17);
    Lag none = lag_of(0.0, 1e-3);
    CHECK_NEAR(lag_step(&none, &x, 5.0), 5.0, 1e-15);
}

static void speed_is_the_mean_of_the_window(void) {
    /* x = x_0 + v t + a t^2/2: the mean speed of the last 3 cycles is v + a (t - 1.5 h); n = that over the lead */
    const double h = 1e-3, lead = 2e-3, v = 0.4, a = 3.0;
    const MeasuredSpeed p = measured_speed_of(3, h, lead);
    double ring[RING];
    int32_t newest;
    CHECK(p.window.length <= RING);
    measured_speed_start(&p, &newest, ring, 0.7);
    for (int k = 0; k < 20; ++k) {
        const double t = k * h;
        const double n = measured_speed_step(&p, &newest, ring, 0.7 + v * t + a * t * t / 2, 1e9);
        if (k == 0) {
            CHECK_NEAR(n, 0.0, 0.0); /* the axis stood before */
        } else if (k >= 3) {
            /* positions near 0.7 m are rounded to 1e-16; over 3 h of 2 mm/rad that is 2e-11 rad/s */
            CHECK_NEAR(n, (v + a * (t - 1.5 * h)) / lead, 1e-10);
        }
    }
}

static void without_a_window_the_motor_speed_is_taken(void) {
    const MeasuredSpeed p = measured_speed_of(0, 1e-3, 2e-3);
    double ring[RING];
    int32_t newest;
    measured_speed_start(&p, &newest, ring, 0.7);
    CHECK_NEAR(measured_speed_step(&p, &newest, ring, 0.9, 12.25), 12.25, 0.0);
}

int main(void) {
    cubics_are_exact();
    lines_are_exact();
    order_is_that_of_the_polynomial(2.4, delay_cubic, 4.0);
    order_is_that_of_the_polynomial(0.4, delay_cubic, 4.0);
    order_is_that_of_the_polynomial(2.4, delay_linear, 2.0);
    whole_delays_are_exact();
    a_constant_past_stays();
    lag_follows_a_ramp();
    lag_settles_on_the_input();
    speed_is_the_mean_of_the_window();
    without_a_window_the_motor_speed_is_taken();
    return CHECK_RESULT;
}

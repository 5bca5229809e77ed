/* Synchronous motor of the controller against closed forms and against its differential equations integrated finely. */
#include <stdlib.h>

#include "check.h"
#include "pmsm.h"

static const double T_C = 125e-6;
static const Pmsm Z_MOTOR = {.R = 0.45, .L_d = 5e-3, .L_q = 5e-3, .psi = 2.0 / 7.5, .p = 5.0};
static const Pmsm SALIENT = {.R = 0.45, .L_d = 3e-3, .L_q = 8e-3, .psi = 0.2, .p = 4.0};

typedef struct Rates {
    long double d, q;
} Rates;

static Rates rates(const Pmsm *m, long double i_d, long double i_q, double u_d, double u_q, double n) {
    long double omega = (long double)m->p * n;
    Rates r = {(u_d - m->R * i_d + omega * m->L_q * i_q) / m->L_d,
               (u_q - m->R * i_q - omega * m->L_d * i_d - omega * m->psi) / m->L_q};
    return r;
}

/* Classical Runge-Kutta in long double; eigenvalue times step below 0.01 leaves (0.01)^4/120 per unit of time: 1e-10 of
 * the change. `steps` is chosen by the caller to get below its tolerance. */
static PmsmState integrate(const Pmsm *m, PmsmState x, double u_d, double u_q, double n, double time, int steps) {
    long double d = x.i_d;
    long double q = x.i_q;
    long double h = (long double)time / steps;
    for (int k = 0; k < steps; ++k) {
        Rates a = rates(m, d, q, u_d, u_q, n);
        Rates b = rates(m, d + h / 2 * a.d, q + h / 2 * a.q, u_d, u_q, n);
        Rates c = rates(m, d + h / 2 * b.d, q + h / 2 * b.q, u_d, u_q, n);
        Rates e = rates(m, d + h * c.d, q + h * c.q, u_d, u_q, n);
        d += h / 6 * (a.d + 2 * b.d + 2 * c.d + e.d);
        q += h / 6 * (a.q + 2 * b.q + 2 * c.q + e.q);
    }
    PmsmState y = {(double)d, (double)q};
    return y;
}

static void compare(const Pmsm *m, PmsmState x, double u_d, double u_q, double n, double time, double tolerance) {
    PmsmState y = integrate(m, x, u_d, u_q, n, time, 4000);
    pmsm_step(m, &x, u_d, u_q, n, time);
    double size = fmax(1.0, hypot(y.i_d, y.i_q));
    CHECK_NEAR(x.i_d, y.i_d, tolerance * size);
    CHECK_NEAR(x.i_q, y.i_q, tolerance * size);
}

static double uniform(double low, double high) {
    return low + (high - low) * rand() / (double)RAND_MAX;
}

static void agrees_with_the_equations(void) {
    PmsmState x = {-3.0, 12.0};
    static const double speeds[] = {0.0, 1e-9, 26.0, -157.0, 900.0}; /* [rad/s] */
    for (size_t i = 0; i < sizeof speeds / sizeof speeds[0]; ++i) {
        /* Runge-Kutta: at most 5 * 900 * 1e-3/4000 = 1e-3 rad a step leave 1e-15; rounding 1e-15 */
        compare(&Z_MOTOR, x, 20.0, -45.0, speeds[i], T_C, 1e-14);
        compare(&SALIENT, x, 20.0, -45.0, speeds[i], T_C, 1e-14);
        compare(&SALIENT, x, 20.0, -45.0, speeds[i], 1e-3, 1e-14); /* several halvings */
    }
    srand(1);
    for (int k = 0; k < 200; ++k) {
        const Pmsm m = {.R = pow(10.0, uniform(-3, 0.5)),
                        .L_d = pow(10.0, uniform(-3.5, -2)),
                        .L_q = pow(10.0, uniform(-3.5, -2)),
                        .psi = uniform(0.05, 0.5),
                        .p = 5.0};
        PmsmState y = {uniform(-50, 50), uniform(-50, 50)};
        /* eigenvalues times cycle up to 10; Runge-Kutta leaves (10/4000)^4/120 * 10 = 3e-12 */
        compare(&m, y, uniform(-300, 300), uniform(-300, 300), uniform(-600, 600), uniform(1e-5, 1e-3), 3e-12);
    }
}

static void equal_eigenvalues(void) {
    /* (R/L_q - R/L_d)^2/4 = omega_e^2 and its neighbourhood */
    const Pmsm *m = &SALIENT;
    double omega = fabs(m->R / m->L_q - m->R / m->L_d) / 2.0;
    PmsmState x = {5.0, -7.0};
    static const double near[] = {1.0, 1.0 + 1e-15, 1.0 - 1e-12, 1.0 + 1e-8, 1.0 - 1e-4};
    for (size_t i = 0; i < sizeof near / sizeof near[0]; ++i) {
        compare(m, x, 3.0, 4.0, omega / m->p * near[i], T_C, 1e-14);
        compare(m, x, 3.0, 4.0, omega / m->p * near[i], 20e-3, 1e-13); /* Runge-Kutta (3/4000)^4/120 * 3 = 1e-14 */
    }
}

static void standstill_is_two_lags(void) {
    const Pmsm *m = &SALIENT;
    PmsmState x = {1.0, -2.0};
    pmsm_step(m, &x, 6.0, 9.0, 0.0, T_C);
    CHECK_NEAR(x.i_d, 6.0 / 0.45 + (1.0 - 6.0 / 0.45) * exp(-0.45 / 3e-3 * T_C), 1e-14); /* rounding at 13 */
    CHECK_NEAR(x.i_q, 9.0 / 0.45 + (-2.0 - 9.0 / 0.45) * exp(-0.45 / 8e-3 * T_C), 1e-14);
}

static void no_resistance(void) {
    /* At standstill the current is the voltage integrated. */
    Pmsm m = SALIENT;
    m.R = 0.0;
    PmsmState x = {1.0, -2.0};
    pmsm_step(&m, &x, 6.0, 9.0, 0.0, T_C);
    CHECK_NEAR(x.i_d, 1.0 + 6.0 * T_C / 3e-3, 1e-15);
    CHECK_NEAR(x.i_q, -2.0 + 9.0 * T_C / 8e-3, 1e-15);
    /* Turning and short-circuited, the flux linkage (L_d i_d + psi, L_q i_q) turns backwards in rotor coordinates. */
    double omega = m.p * 130.0;
    double angle = omega * T_C;
    PmsmState y = {2.0, 3.0};
    pmsm_step(&m, &y, 0.0, 0.0, 130.0, T_C);
    double flux_d = m.L_d * 2.0 + m.psi;
    double flux_q = m.L_q * 3.0;
    CHECK_NEAR(m.L_d * y.i_d + m.psi, flux_d * cos(angle) + flux_q * sin(angle), 1e-16); /* rounding at 0.2 */
    CHECK_NEAR(m.L_q * y.i_q, flux_q * cos(angle) - flux_d * sin(angle), 1e-16);
}

static void steady_state(void) {
    /* 0 = u_d - R i_d + omega L_q i_q,  0 = u_q - R i_q - omega (L_d i_d + psi); from any start, and in one long step.
     */
    const Pmsm *m = &SALIENT;
    double n = 60.0;
    double omega = m->p * n;
    double e = 35.0 - omega * m->psi;
    double det = m->R * m->R + omega * omega * m->L_d * m->L_q;
    double i_d = (m->R * 10.0 + omega * m->L_q * e) / det;
    double i_q = (m->R * e - omega * m->L_d * 10.0) / det;
    PmsmState x = {0.0, 0.0};
    for (int k = 0; k < 8000; ++k) { /* slowest time constant 17 ms: 1 s leaves nothing */
        pmsm_step(m, &x, 10.0, 35.0, n, T_C);
    }
    CHECK_NEAR(x.i_d, i_d, 1e-12); /* rounding at 30, gathered over 1/(R T_c/L) = 140 steps */
    CHECK_NEAR(x.i_q, i_q, 1e-12);
    PmsmState y = {100.0, -100.0};
    pmsm_step(m, &y, 10.0, 35.0, n, 10.0); /* ten seconds: 3000 rad */
    CHECK_NEAR(y.i_d, i_d, 1e-10);         /* 14 doublings amplify rounding */
    CHECK_NEAR(y.i_q, i_q, 1e-10);
    /* and there it stays */
    PmsmState z = {i_d, i_q};
    pmsm_step(m, &z, 10.0, 35.0, n, T_C);
    CHECK_NEAR(z.i_d, i_d, 2e-14);
    CHECK_NEAR(z.i_q, i_q, 2e-14);
}

static void stiff_windings(void) {
    /* eigenvalue times cycle 4500: the current is at its end value, no overflow on the way */
    const Pmsm m = {.R = 4.5, .L_d = 1e-6, .L_q = 2e-6, .psi = 0.1, .p = 5.0};
    PmsmState x = {40.0, 40.0};
    pmsm_step(&m, &x, 9.0, 18.0, 0.0, 1e-3);
    CHECK_NEAR(x.i_d, 2.0, 1e-10);
    CHECK_NEAR(x.i_q, 4.0, 1e-10);
}

static void two_half_steps_are_one(void) {
    PmsmState one = {3.0, -11.0};
    PmsmState two = one;
    pmsm_step(&SALIENT, &one, 20.0, 50.0, 150.0, T_C);
    pmsm_step(&SALIENT, &two, 20.0, 50.0, 150.0, 0.3 * T_C);
    pmsm_step(&SALIENT, &two, 20.0, 50.0, 150.0, 0.7 * T_C);
    CHECK_NEAR(one.i_d, two.i_d, 1e-14); /* rounding at 11 */
    CHECK_NEAR(one.i_q, two.i_q, 1e-14);
}

static void torque(void) {
    CHECK_NEAR(pmsm_flux_linkage(2.0, 5.0), 0.26666666666666666, 1e-16);
    PmsmState x = {0.0, 10.0};
    CHECK_NEAR(pmsm_torque(&Z_MOTOR, &x), 20.0, 1e-14); /* K_t i_q */
    PmsmState y = {-4.0, 10.0};
    /* reluctance adds 3/2 p (L_d - L_q) i_d i_q = 6 * -5e-3 * -40 = 1.2 */
    CHECK_NEAR(pmsm_torque(&SALIENT, &y), 6.0 * 0.2 * 10.0 + 1.2, 1e-14);
    /* Power: u i = heat + shaft + magnetic. In steady state u_d i_d + u_q i_q = R i^2 + (2/3) M n. */
    double n = 80.0;
    double omega = SALIENT.p * n;
    double u_d = SALIENT.R * y.i_d - omega * SALIENT.L_q * y.i_q;
    double u_q = SALIENT.R * y.i_q + omega * (SALIENT.L_d * y.i_d + SALIENT.psi);
    double shaft = u_d * y.i_d + u_q * y.i_q - SALIENT.R * (y.i_d * y.i_d + y.i_q * y.i_q);
    CHECK_NEAR(1.5 * shaft, pmsm_torque(&SALIENT, &y) * n, 1e-11); /* rounding at 1e3 W */
}

int main(void) {
    agrees_with_the_equations();
    equal_eigenvalues();
    standstill_is_two_lags();
    no_resistance();
    steady_state();
    stiff_windings();
    two_half_steps_are_one();
    torque();
    return CHECK_RESULT;
}

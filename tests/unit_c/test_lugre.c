/* LuGre friction (src/friction_fmu/lugre.c) against closed forms in long double and fine fixed-step integration. */
#include <float.h>
#include <math.h>

#include "check.h"
#include "lugre.h"

static const Lugre Z_AXIS = {.sigma_0 = 300,
                             .sigma_1 = 0.8,
                             .sigma_2 = 0.006,
                             .F_C = 1.6,
                             .F_S = 2.1,
                             .v_s = 0.6,
                             .beta = 1,
                             .F_log = 0.4,
                             .v_log = 3,
                             .asymmetry = 0};

static Lugre varied(double beta, double asymmetry, double F_log) {
    Lugre p = Z_AXIS;
    p.beta = beta;
    p.asymmetry = asymmetry;
    p.F_log = F_log;
    return p;
}

static long double sign_of(long double n) {
    return n > 0 ? 1 : n < 0 ? -1 : 0;
}

/* Eq. 7, written a second time. */
static long double level(const Lugre *p, long double n) {
    long double speed = fabsl(n), stribeck = expl(-powl(speed / p->v_s, p->beta));
    return (1 + p->asymmetry * sign_of(n)) *
           (p->F_C + (p->F_S - p->F_C) * stribeck + p->F_log * logl(speed / p->v_log + 1)) / p->sigma_0;
}

static const double speeds[] = {0,   1e-12,  1e-6,  0.01,  0.3,  0.6, 5,      104.7,
                                1e4, -1e-12, -1e-6, -0.01, -0.3, -5,  -104.7, -1e4};
enum { SPEEDS = sizeof speeds / sizeof speeds[0] };

static void level_is_equation_7(void) {
    const Lugre cases[] = {Z_AXIS, varied(0.5, 0, 0.4), varied(2, 0.1, 0.4), varied(2, -0.5, 0)};
    for (size_t c = 0; c < sizeof cases / sizeof cases[0]; c++) {
        for (size_t i = 0; i < SPEEDS; i++) {
            const double expected = (double)level(&cases[c], speeds[i]);
            CHECK_NEAR(lugre_level(&cases[c], speeds[i]), expected, 8 * DBL_EPSILON * expected); /* a few roundings */
        }
    }
    CHECK_NEAR(lugre_level(&Z_AXIS, 0), 2.1 / 300, 1e-18);                    /* static torque at standstill */
    CHECK_NEAR(lugre_level(&Z_AXIS, 1e300), lugre_level(&Z_AXIS, -1e300), 0); /* even without asymmetry */
    const Lugre flat = varied(1, 0, 0);
    CHECK_NEAR(lugre_level(&flat, 1e308), 1.6 / 300, 1e-17); /* Coulomb level; no 0 times infinity */
    const Lugre skew = varied(1, 0.25, 0.4);
    CHECK_NEAR(lugre_level(&skew, 2) / lugre_level(&skew, -2), 1.25 / 0.75, 1e-15);
}

static void level_slope_is_the_derivative(void) {
    const Lugre cases[] = {Z_AXIS, varied(0.5, 0, 0.4), varied(2, 0.1, 0.4)};
    for (size_t c = 0; c < sizeof cases / sizeof cases[0]; c++) {
        for (size_t i = 0; i < SPEEDS; i++) {
            const long double n = speeds[i], d = n * 1e-5L;
            const long double wide = (level(&cases[c], n + 2 * d) - level(&cases[c], n - 2 * d)) / 4;
            const long double narrow = (level(&cases[c], n + d) - level(&cases[c], n - d)) / 2;
            const long double expected = n == 0 ? 0 : (4 * narrow - wide) / 3 / 1e-5L; /* n dg/dn, to order d^4 */
            /* differences of g ~ 7e-3 in long double over a relative distance of 1e-5 */
            CHECK_NEAR(lugre_level_slope(&cases[c], speeds[i]), (double)expected, 1e-15);
        }
    }
    CHECK_NEAR(lugre_level_slope(&Z_AXIS, 1e300), 0.4 / 300, 1e-17); /* F_log alone is left, finite */
}

/* Eq. 6 at constant speed by classical Runge-Kutta with steps far inside its stability limit. */
static long double integrate(const Lugre *p, long double z, long double n, long double h, int steps) {
    const long double a = fabsl(n) / level(p, n), d = h / steps;
    for (int i = 0; i < steps; i++) {
        const long double k1 = n - a * z, k2 = n - a * (z + d / 2 * k1), k3 = n - a * (z + d / 2 * k2),
                          k4 = n - a * (z + d * k3);
        z += d / 6 * (k1 + 2 * k2 + 2 * k3 + k4);
    }
    return z;
}

static double advance(double z, double n, double h) {
    return lugre_advance(z, n, lugre_level(&Z_AXIS, n), h);
}

static void advance_solves_equation_6(void) {
    const double starts[] = {0, 5e-3, -7e-3};
    const double moderate[] = {0.01, -0.3, 5, -20, 60};
    for (size_t i = 0; i < sizeof starts / sizeof starts[0]; i++) {
        for (size_t j = 0; j < sizeof moderate / sizeof moderate[0]; j++) {
            const long double expected = integrate(&Z_AXIS, starts[i], moderate[j], 1e-3L, 4000);
            /* |n| h/g <= 8: 4000 steps of order 4 leave (8/4000)^4 of 7e-3, below the rounding of z */
            CHECK_NEAR(advance(starts[i], moderate[j], 1e-3), (double)expected, 1e-16);
        }
        CHECK_NEAR(advance(starts[i], 0, 1e-3), starts[i], 0); /* standstill changes nothing */
    }
    /* The least step counts in full: z = n h to first order, relative error |n| h/(2 g). */
    CHECK_NEAR(advance(0, 1e-10, 1e-6) / 1e-16, 1, 1e-13);
}

static void advance_is_stable(void) {
    const double steps[] = {1e-9, 1e-4, 1, 1e6};
    for (size_t i = 0; i < SPEEDS; i++) {
        for (size_t j = 0; j < sizeof steps / sizeof steps[0]; j++) {
            const double n = speeds[i], g = lugre_level(&Z_AXIS, n), end = n > 0 ? g : -g;
            const double z = advance(1e-3, n, steps[j]);
            const double low = fmin(1e-3, end), high = fmax(1e-3, end);
            CHECK(z >= low - 1e-18 && z <= high + 1e-18); /* between start and end, a rounding apart */
        }
    }
    /* rapid traverse: on g, but for the rounding of z + (g - z) */
    CHECK_NEAR(advance(-5e-3, 100, 1), lugre_level(&Z_AXIS, 100), 4e-18);
}

static void torque_is_equation_1(void) {
    const double n = -0.4, z = 2.5e-3, k = 0.6;
    const long double rate = n - fabsl((long double)n) / level(&Z_AXIS, n) * z;
    CHECK_NEAR(lugre_rate(z, n, lugre_level(&Z_AXIS, n)), (double)rate, 1e-15);
    CHECK_NEAR(lugre_torque(&Z_AXIS, k, z, n, lugre_level(&Z_AXIS, n)),
               (double)(0.6L * 300 * z + 0.8L * rate + 0.006L * n), 1e-15);
    for (size_t i = 0; i < SPEEDS; i++) { /* constant speed: Eq. 7 and the viscous part, nothing of sigma_1 */
        const double v = speeds[i], end = (double)(sign_of(v) * level(&Z_AXIS, v));
        CHECK_NEAR(lugre_torque(&Z_AXIS, 1, end, v, lugre_level(&Z_AXIS, v)), 300 * end + 0.006 * v,
                   1e-12 * (1 + fabs(v)));
    }
}

static void torque_by_speed_is_the_derivative(void) {
    const Lugre cases[] = {Z_AXIS, varied(0.5, 0, 0.4), varied(2, 0.2, 0.4)};
    for (size_t c = 0; c < sizeof cases / sizeof cases[0]; c++) {
        for (size_t i = 0; i < SPEEDS; i++) {
            const double n = speeds[i], z = -3e-3;
            if (n == 0) {
                continue;
            }
            const long double d = 1e-6L * n; /* from the torque's own terms, in long double */
            const long double up = (n + d) - fabsl(n + d) / level(&cases[c], n + d) * z;
            const long double down = (n - d) - fabsl(n - d) / level(&cases[c], n - d) * z;
            const double expected = (double)(cases[c].sigma_1 * (up - down) / (2 * d) + cases[c].sigma_2);
            CHECK_NEAR(lugre_torque_by_speed(&cases[c], z, n), expected, 1e-11 * fabs(expected)); /* order d^2 */
        }
    }
    CHECK_NEAR(lugre_torque_by_speed(&Z_AXIS, 5e-3, 0), 0.806, 1e-15); /* both sides' mean: sigma_1 + sigma_2 */
    CHECK(isfinite(lugre_torque_by_speed(&cases[1], 5e-3, 0)));        /* beta < 1: g has a cusp at n = 0 */
}

int main(void) {
    level_is_equation_7();
    level_slope_is_the_derivative();
    advance_solves_equation_6();
    advance_is_stable();
    torque_is_equation_1();
    torque_by_speed_is_the_derivative();
    return CHECK_RESULT;
}

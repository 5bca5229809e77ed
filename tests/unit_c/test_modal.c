/* Modal structure (src/plant_fmu/modal.c) against the matrix exponential in long double and analytic responses. */
#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "check.h"
#include "modal.h"

/* --- coefficients of one mode ------------------------------------------------------------------------------------- */

enum { N = 4 };
typedef long double Matrix[N][N];

static void multiply(Matrix product, Matrix a, Matrix b) {
    Matrix result;
    for (int i = 0; i < N; i++) {
        for (int j = 0; j < N; j++) {
            result[i][j] = 0;
            for (int k = 0; k < N; k++) {
                result[i][j] += a[i][k] * b[k][j];
            }
        }
    }
    memcpy(product, result, sizeof result);
}

/* exp(M) - 1 by a Taylor series of M / 2^s, squared s times in the form E <- 2 E + E^2, which keeps small parts whole.
 */
static void exponential_less_one(Matrix e, Matrix m) {
    long double norm = 0;
    int s = 0;
    for (int i = 0; i < N; i++) {
        for (int j = 0; j < N; j++) {
            norm = fmaxl(norm, fabsl(m[i][j]));
        }
    }
    for (; norm > 0.25L; norm /= 2) {
        s++;
    }
    Matrix scaled, term;
    for (int i = 0; i < N; i++) {
        for (int j = 0; j < N; j++) {
            scaled[i][j] = ldexpl(m[i][j], -s);
        }
    }
    memcpy(e, scaled, sizeof(Matrix));
    memcpy(term, scaled, sizeof(Matrix));
    for (int order = 2; order < 20; order++) {
        multiply(term, term, scaled);
        for (int i = 0; i < N; i++) {
            for (int j = 0; j < N; j++) {
                term[i][j] /= order;
                e[i][j] += term[i][j];
            }
        }
    }
    for (; s > 0; s--) {
        Matrix square;
        multiply(square, e, e);
        for (int i = 0; i < N; i++) {
            for (int j = 0; j < N; j++) {
                e[i][j] = 2 * e[i][j] + square[i][j];
            }
        }
    }
}

/* Time in steps, states (q, h v, h^2 f, h^2 df): everything dimensionless. */
static ModeUpdate reference(double omega, double zeta, double h) {
    const long double x = (long double)omega * h;
    Matrix e, m = {{0, 1, 0, 0}, {-x * x, -2 * zeta * x, 1, 0}, {0, 0, 0, 1}, {0, 0, 0, 0}};
    exponential_less_one(e, m);
    return (ModeUpdate){.q_q = (double)(1 + e[0][0]),
                        .q_v = (double)(h * e[0][1]),
                        .q_f = (double)(e[0][2] * h * h),
                        .q_df = (double)(e[0][3] * h * h),
                        .v_q = (double)(e[1][0] / h),
                        .v_v = (double)(1 + e[1][1]),
                        .v_f = (double)(e[1][2] * h),
                        .v_df = (double)(e[1][3] * h)};
}

static void mode_equals_matrix_exponential(double x, double zeta, double h) {
    const double omega = x / h;
    const ModeUpdate a = mode_update(omega, zeta, h), e = reference(omega, zeta, h);
    /* Rounding of x alone turns the phase by x/2 ulp; the rest is a few digits' units of the last place. */
    const double relative = 1e-14 + x * DBL_EPSILON;
    /* Oscillating terms are compared with their envelope, the others, which are positive, with themselves. */
    const double fast = zeta < 1 ? 1 : zeta + sqrt(zeta * zeta - 1);
    const double envelope = zeta < 1 ? exp(-zeta * x) * fmin(1, 1 / (x * sqrt(1 - zeta * zeta))) : fabs(e.q_v) / h;
    const double hold = fmax(envelope * fmax(1, fast * x), fabs(e.q_q));
    /* After a full turn an undamped mode is back at rest: then only a few roundings of 1 - cos x are left of q_f. */
    const double turned = x > 2 ? 4 * DBL_EPSILON / (x * x) : 0;
    CHECK_NEAR(a.q_f, e.q_f, relative * e.q_f + turned * h * h);
    CHECK_NEAR(a.v_df, e.v_df, relative * e.v_df + turned * h);
    CHECK_NEAR(a.q_df, e.q_df, relative * e.q_df);
    /* What has decayed to nothing the reference knows only to its own rounding, about 1e-18 of the initial value. */
    const double floor = 1e-18;
    CHECK_NEAR(a.q_v, e.q_v, (relative * envelope + floor) * h);
    CHECK_NEAR(a.v_f, e.v_f, (relative * envelope + floor) * h);
    CHECK_NEAR(a.v_q, e.v_q, (relative * envelope + floor) * x * omega);
    CHECK_NEAR(a.q_q, e.q_q, relative * hold + floor);
    CHECK_NEAR(a.v_v, e.v_v, relative * hold + floor);
}

static void coefficients(void) {
    const double ratios[] = {0, 1e-9, 0.02, 0.3, 0.9, 1 - 1e-6, 1 - 1e-12, 1, 1 + 1e-12, 1 + 1e-6, 1.01, 1.5, 10, 300};
    for (size_t i = 0; i < sizeof ratios / sizeof ratios[0]; i++) {
        for (double x = 1e-8; x <= 1.001e3; x *= 1.7782794100389228 /* quarter decades */) {
            mode_equals_matrix_exponential(x, ratios[i], 125e-6);
        }
        for (double x = 0.5; x < 8; x += 0.0625) { /* where one form takes over from another */
            mode_equals_matrix_exponential(x, ratios[i], 1);
            mode_equals_matrix_exponential(x / fmax(1, 2 * ratios[i]), ratios[i], 1);
        }
    }
}

static void rigid_mode_is_a_double_integrator(void) {
    const double h = 0.3;
    const ModeUpdate a = mode_update(0, 0, h);
    CHECK_NEAR(a.q_q, 1, 0);
    CHECK_NEAR(a.q_v, h, 0);
    CHECK_NEAR(a.q_f, h * h / 2, 1e-17); /* one rounding */
    CHECK_NEAR(a.q_df, h * h / 6, 1e-17);
    CHECK_NEAR(a.v_q, 0, 0);
    CHECK_NEAR(a.v_v, 1, 0);
    CHECK_NEAR(a.v_f, h, 0);
    CHECK_NEAR(a.v_df, h / 2, 1e-17);
}

/* --- structure ---------------------------------------------------------------------------------------------------- */

enum { MODES = 7, PORTS = 5, INPUTS = 3, SIZE = 8 };

static double pseudo_random(void) { /* -1 to 1, the same everywhere */
    static unsigned state = 12345;
    state = state * 1664525u + 1013904223u;
    return (double)(state >> 8) / 8388608.0 - 1;
}

static double *structure(Modal *modal) {
    double *memory = calloc(modal_memory(MODES, PORTS), sizeof *memory);
    const double omegas[MODES] = {0, 0, 130, 700, 2500, 6000, 90}, zetas[MODES] = {0, 0, 0.06, 0.02, 0, 1, 4};
    modal_place(modal, memory, MODES, PORTS);
    for (size_t k = 0; k < MODES; k++) {
        double shape[PORTS];
        for (size_t i = 0; i < PORTS; i++) {
            shape[i] = pseudo_random();
        }
        modal_set_mode(modal, k, omegas[k], zetas[k], shape);
    }
    return memory;
}

static void layout(void) {
    Modal modal;
    double *memory = structure(&modal);
    CHECK(modal_padded(MODES) == SIZE && modal.size == SIZE);
    CHECK(modal_padded(8) == 8 && modal_padded(1) % MODAL_LANES == 0);
    CHECK(modal.shape + PORTS * SIZE == memory + modal_memory(MODES, PORTS));
    modal_prepare(&modal, 1e-3);
    double q[SIZE] = {1, 2, 3, 4, 5, 6, 7, 0}, v[SIZE] = {7, 6, 5, 4, 3, 2, 1, 0}, q_end[SIZE], v_end[SIZE];
    const double u[INPUTS] = {1, -2, 3}, du[INPUTS] = {0.5, 0, -4};
    modal_advance(&modal, INPUTS, u, du, q, v, q_end, v_end);
    for (size_t k = 0; k < SIZE; k++) { /* mode by mode with mode_update() */
        const ModeUpdate c = mode_update(modal.omega[k], modal.zeta[k], 1e-3);
        long double f = 0, df = 0;
        for (size_t i = 0; i < INPUTS; i++) {
            f += (long double)modal.shape[i * SIZE + k] * u[i];
            df += (long double)modal.shape[i * SIZE + k] * du[i];
        }
        /* roundings of sums up to |v| = 7 and |v_q q| = 7 * 6000 */
        CHECK_NEAR(q_end[k], (double)(c.q_q * q[k] + c.q_v * v[k] + c.q_f * f + c.q_df * df), 1e-14);
        CHECK_NEAR(v_end[k], (double)(c.v_q * q[k] + c.v_v * v[k] + c.v_f * f + c.v_df * df), 1e-11);
    }
    CHECK(q_end[SIZE - 1] == 0 && v_end[SIZE - 1] == 0); /* padding stays still */
    for (size_t port = 0; port < PORTS; port++) {
        long double sum = 0;
        for (size_t k = 0; k < SIZE; k++) {
            sum += (long double)modal.shape[port * SIZE + k] * q[k];
        }
        CHECK_NEAR(modal_sum(&modal, port, q), (double)sum, 1e-14); /* 8 terms up to 7 */
    }
    free(memory);
}

static void steps_split(void) {
    Modal modal;
    double *memory = structure(&modal);
    double q[SIZE] = {0}, v[SIZE] = {0}, q_1[SIZE], v_1[SIZE], q_2[SIZE], v_2[SIZE], half_q[SIZE], half_v[SIZE];
    for (size_t k = 0; k < MODES; k++) {
        q[k] = pseudo_random();
        v[k] = 300 * pseudo_random();
    }
    const double u[INPUTS] = {3, -2, 1}, slope[INPUTS] = {200, 500, -900};
    const double steps[] = {1e-7, 125e-6, 1e-3, 0.05}, cuts[] = {0.5, 0.1, 0.99};
    for (size_t s = 0; s < sizeof steps / sizeof steps[0]; s++) {
        for (size_t c = 0; c < sizeof cuts / sizeof cuts[0]; c++) {
            const double h = steps[s], first = cuts[c] * h, second = h - first;
            double du[INPUTS], du_1[INPUTS], u_2[INPUTS], du_2[INPUTS];
            for (size_t i = 0; i < INPUTS; i++) {
                du[i] = slope[i] * h;
                du_1[i] = slope[i] * first;
                u_2[i] = u[i] + du_1[i];
                du_2[i] = slope[i] * second;
            }
            modal_prepare(&modal, h);
            modal_advance(&modal, INPUTS, u, du, q, v, q_1, v_1);
            modal_prepare(&modal, first);
            modal_advance(&modal, INPUTS, u, du_1, q, v, half_q, half_v);
            modal_prepare(&modal, second);
            modal_advance(&modal, INPUTS, u_2, du_2, half_q, half_v, q_2, v_2);
            for (size_t k = 0; k < MODES; k++) { /* relative to the mode's amplitude */
                const double omega = modal.omega[k], amplitude = fabs(q[k]) + fabs(v[k]) * fmin(h, 1 / (omega + 1e-9));
                CHECK_NEAR(q_2[k], q_1[k], 1e-12 * amplitude);
                CHECK_NEAR(v_2[k], v_1[k], 1e-12 * (omega * amplitude + fabs(v[k])));
            }
        }
    }
    free(memory);
}

static void coefficients_do_not_depend_on_history(void) {
    Modal modal;
    double *memory = structure(&modal), first[10 * SIZE];
    modal_prepare(&modal, 125e-6);
    memcpy(first, memory, sizeof first);
    modal_prepare(&modal, 125e-6 * (1 + DBL_EPSILON));
    CHECK(memcmp(first, memory, sizeof first) != 0);
    modal_prepare(&modal, 125e-6);
    CHECK(memcmp(first, memory, sizeof first) == 0);
    free(memory);
}

/* Under a constant force a mode at rest rings about f / omega^2: half a second of it. */
static void step_response(void) {
    const double omega = 2 * 3.14159265358979323846 * 21, zeta = 0.06, h = 125e-6, shape[1] = {1}, force = 2;
    double memory[(10 + 1) * MODAL_LANES] = {0}, q[MODAL_LANES] = {0}, v[MODAL_LANES] = {0}, q_end[MODAL_LANES],
                             v_end[MODAL_LANES];
    const double du = 0;
    Modal modal;
    modal_place(&modal, memory, 1, 1);
    modal_set_mode(&modal, 0, omega, zeta, shape);
    modal_prepare(&modal, h);
    const long double damped = omega * sqrtl(1 - (long double)zeta * zeta), still = force / (omega * omega);
    for (int i = 1; i <= 4000; i++) {
        modal_advance(&modal, 1, &force, &du, q, v, q_end, v_end);
        memcpy(q, q_end, sizeof q);
        memcpy(v, v_end, sizeof v);
        const long double t = i * (long double)h, decay = expl(-zeta * omega * t);
        const long double expected =
            still * (1 - decay * (cosl(damped * t) + zeta * omega / damped * sinl(damped * t)));
        CHECK_NEAR(q[0], (double)expected, 1e-12 * (double)still);
        CHECK_NEAR(v[0], (double)(force / damped * decay * sinl(damped * t)), 1e-12 * (double)(still * omega));
    }
}

static void acceleration_is_the_rate_of_speed(void) {
    Modal modal;
    double *memory = structure(&modal), q[SIZE] = {0}, v[SIZE] = {0}, q_end[SIZE], v_up[SIZE], v_down[SIZE];
    const double u[INPUTS] = {3, -2, 1}, du[INPUTS] = {0}, h = 1e-7;
    for (size_t k = 0; k < MODES; k++) {
        q[k] = 1e-3 * pseudo_random();
        v[k] = pseudo_random();
    }
    modal_prepare(&modal, h);
    modal_advance(&modal, INPUTS, u, du, q, v, q_end, v_up);
    for (size_t port = 0; port < PORTS; port++) {
        memcpy(v_down, v, sizeof v);
        const double expected = (modal_sum(&modal, port, v_up) - modal_sum(&modal, port, v_down)) / h;
        const double actual = modal_acceleration(&modal, port, INPUTS, u, q, v);
        /* difference quotient: h/2 times the jerk, about (6000/s)^2 * 2 * v; rounding 1e-15/h */
        CHECK_NEAR(actual, expected, 1e-7 / 2 * 4e8);
        CHECK(fabs(actual) > 200); /* so that the comparison says something */
    }
    free(memory);
}

/* What modal_forecast() says of a step is what the step does, ports in any order. */
static void forecasts_are_what_steps_do(void) {
    Modal modal;
    double *memory = structure(&modal), q[SIZE] = {0}, v[SIZE] = {0}, q_end[SIZE], v_end[SIZE];
    const double u[] = {3, -200}, du[] = {40, 5}, h = 125e-6;
    const size_t ports[] = {PORTS - 1, 1};
    for (size_t k = 0; k < MODES; k++) {
        q[k] = 1e-3 * pseudo_random();
        v[k] = pseudo_random();
    }
    modal_prepare(&modal, h);
    const double *const shapes[] = {modal.shape + (PORTS - 1) * SIZE, modal.shape + SIZE};
    modal_advance_at(&modal, 2, shapes, u, du, NULL, q, v, q_end, v_end);
    double whole[PORTS] = {0}, change[PORTS] = {0}, q_prefix[SIZE], v_prefix[SIZE];
    whole[PORTS - 1] = u[0];
    whole[1] = u[1];
    change[PORTS - 1] = du[0];
    change[1] = du[1];
    modal_advance(&modal, PORTS, whole, change, q, v, q_prefix, v_prefix);
    for (size_t port = 0; port < PORTS; port++) {
        for (int speed = 0; speed < 2; speed++) {
            double by_q[SIZE], by_v[SIZE], by_f[SIZE], held[PORTS], ramp[PORTS];
            Forecast forecast = {by_q, by_v, by_f, held, ramp};
            modal_forecast(&modal, port, speed == 1, &forecast);
            double y = modal_foretold(&forecast, modal.size, q, v);
            for (size_t i = 0; i < 2; i++) {
                y += held[ports[i]] * u[i] + ramp[ports[i]] * du[i];
            }
            CHECK_NEAR(y, modal_sum(&modal, port, speed == 1 ? v_end : q_end), speed == 1 ? 1e-13 : 1e-16);
            CHECK_NEAR(y, modal_sum(&modal, port, speed == 1 ? v_prefix : q_prefix), speed == 1 ? 1e-13 : 1e-16);
        }
    }
    double u_all[PORTS] = {0}, f[SIZE], none[PORTS] = {0}, q_held[SIZE], v_held[SIZE], by[3][SIZE], numbers[2][PORTS];
    for (size_t port = 0; port < PORTS; port++) {
        u_all[port] = 100 * pseudo_random();
    }
    modal_force(&modal, u_all, f); /* as one, forces at ports are what they are at each */
    modal_advance(&modal, PORTS, u_all, none, q, v, q_end, v_end);
    modal_advance_held(&modal, 0, u_all, none, f, q, v, q_held, v_held);
    modal_advance_at(&modal, 0, shapes, u, du, f, q, v, q_prefix, v_prefix);
    Forecast forecast = {by[0], by[1], by[2], numbers[0], numbers[1]};
    modal_forecast(&modal, 1, true, &forecast);
    double foretold = modal_foretold(&forecast, modal.size, q, v);
    for (size_t k = 0; k < SIZE; k++) {
        CHECK_NEAR(q_held[k], q_end[k], 1e-15);
        CHECK_NEAR(v_held[k], v_end[k], 1e-12);
        CHECK_EQUAL(v_prefix[k], v_held[k]);
        foretold += forecast.f[k] * f[k];
    }
    CHECK_NEAR(foretold, modal_sum(&modal, 1, v_held), 1e-12);
    for (size_t first = 0; first < PORTS; first++) { /* sums at once are single ones, to the bit */
        double sums[PORTS];
        modal_sums(&modal, first, PORTS - first, q_end, sums);
        for (size_t port = first; port < PORTS; port++) {
            CHECK_EQUAL(sums[port - first], modal_sum(&modal, port, q_end));
        }
    }
    free(memory);
}

int main(void) {
    coefficients();
    rigid_mode_is_a_double_integrator();
    layout();
    steps_split();
    coefficients_do_not_depend_on_history();
    step_response();
    acceleration_is_the_rate_of_speed();
    forecasts_are_what_steps_do();
    return CHECK_RESULT;
}

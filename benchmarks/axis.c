/* One rigid axis under a cascaded drive, with LuGre friction and an engaging zone: where logs with known truth come
 * from.
 *
 * The equations are those of docs/identification.md and of M. Wiesauer, F. Bleicher (2021), Eqs. 1 to 7, written and
 * integrated a second time: classical Runge-Kutta with steps that resolve the bristles. No code of the units is in it.
 *
 * axis RAMPED... < setpoints > rows, with the numbers in the order of `enum given`. Setpoints: angle [rad] at every
 * position cycle. Rows, 16 per position cycle: angle [rad], speed [rad/s], motor torque [N.m]. All doubles.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

enum given {
    INERTIA,
    F_C,
    F_S,
    V_S,
    F_LOG,
    V_LOG,
    SIGMA_0,
    SIGMA_1,
    SIGMA_2,
    ZONE,
    GAMMA,
    M_0, /* the axis */
    WARM,
    BEGUN,
    SPAN, /* share that sigma_2 loses, when this log begins, how long all logs last [s] */
    K_V,
    K_P,
    T_N,
    LAG,
    LIMIT, /* 1/s, N.m.s/rad, s; of the current loop [s]; torque limit [N.m] */
    COUNT
};

#define CYCLE 1e-3 /* position controller [s] */
#define TICKS 8    /* of the speed controller in a position cycle */
#define ROWS 2     /* in a tick */
#define FINE 0.25  /* longest step over the time in which bristles settle */

static double p[COUNT];

typedef struct {
    double angle, speed, bristle;
} State;

/* Deflection that sliding at a speed would have [rad]. */
static double settled(double n) {
    const double size = fabs(n);
    return (p[F_C] + (p[F_S] - p[F_C]) * exp(-size / p[V_S]) + p[F_LOG] * log1p(size / p[V_LOG])) / p[SIGMA_0];
}

static double bounded(double value, double limit) {
    return fmin(fmax(value, -limit), limit);
}

static double viscous(double t) {
    return p[SIGMA_2] * (1 - p[WARM] * (1 - exp(-2 * (t + p[BEGUN]) / p[SPAN])) / (1 - exp(-2.0)));
}

/* Rates of a state `y` under the motor torque M; `zone`: the travel within the engaging zone. */
static State rates(State y, double zone, double M, double t) {
    State rate;
    double k = 1;
    rate.bristle = y.speed - fabs(y.speed) / settled(y.speed) * y.bristle;
    if (p[ZONE] > 0) {
        k = p[GAMMA] + (1 - p[GAMMA]) * (0.5 + (y.bristle >= 0 ? zone : -zone) / p[ZONE]);
    }
    rate.angle = y.speed;
    rate.speed =
        (M - p[M_0] - k * p[SIGMA_0] * y.bristle - p[SIGMA_1] * rate.bristle - viscous(t) * y.speed) / p[INERTIA];
    return rate;
}

static State moved(State y, State rate, double h) {
    State found = {y.angle + h * rate.angle, y.speed + h * rate.speed, y.bristle + h * rate.bristle};
    return found;
}

int main(int count, char **texts) {
    State y = {0, 0, 0};
    double zone = 0, now, next, before, M = 0, integral, ramp, wanted = 0, t = 0;
    const double tick = CYCLE / TICKS, row = tick / ROWS;
    int i, j, r, first = 1;
    if (count != COUNT + 1) {
        fprintf(stderr, "axis: %d numbers are needed\n", COUNT);
        return 2;
    }
    for (i = 0; i < COUNT; i++) {
        p[i] = strtod(texts[i + 1], NULL);
    }
    if (fread(&now, sizeof now, 1, stdin) != 1) {
        return 2;
    }
    y.angle = now;
    M = p[M_0]; /* at rest, the weight held and the bristles relaxed */
    integral = M;
    while (fread(&next, sizeof next, 1, stdin) == 1) {
        before = first ? 0 : wanted;
        first = 0;
        wanted = p[K_V] * (now - y.angle) + (next - now) / CYCLE;
        for (j = 0; j < TICKS; j++) {
            double away, torque;
            ramp = before + (wanted - before) * (j + 1) / TICKS;
            away = ramp - y.speed;
            torque = p[K_P] * away + integral + p[K_P] * tick / p[T_N] * away;
            if (fabs(torque) < p[LIMIT]) {
                integral += p[K_P] * tick / p[T_N] * away;
            }
            torque = bounded(torque, p[LIMIT]);
            for (r = 0; r < ROWS; r++) {
                const double out[3] = {y.angle, y.speed, M};
                double left = row;
                fwrite(out, sizeof out, 1, stdout);
                while (left > 1e-12) {
                    const double rate = fabs(y.speed) / settled(y.speed);
                    const double h = fmin(left, left / ceil(left * rate / FINE + 1e-9));
                    const double middle = torque + (M - torque) * exp(-h / 2 / p[LAG]);
                    const double end = torque + (M - torque) * exp(-h / p[LAG]);
                    const double half = p[ZONE] / 2, start = y.angle;
                    State a, b, c, d, at;
                    a = rates(y, zone, M, t);
                    at = moved(y, a, h / 2);
                    b = rates(at, bounded(zone + at.angle - start, half), middle, t + h / 2);
                    at = moved(y, b, h / 2);
                    c = rates(at, bounded(zone + at.angle - start, half), middle, t + h / 2);
                    at = moved(y, c, h);
                    d = rates(at, bounded(zone + at.angle - start, half), end, t + h);
                    y.angle += h / 6 * (a.angle + 2 * b.angle + 2 * c.angle + d.angle);
                    y.speed += h / 6 * (a.speed + 2 * b.speed + 2 * c.speed + d.speed);
                    y.bristle += h / 6 * (a.bristle + 2 * b.bristle + 2 * c.bristle + d.bristle);
                    zone = bounded(zone + y.angle - start, half);
                    M = end;
                    t += h;
                    left -= h;
                }
            }
        }
        now = next;
    }
    return 0;
}

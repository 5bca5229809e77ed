#include "transmission.h"

#include <math.h>

static const double TRANSMISSION_SETTLED = 1e-13;  /* of the largest torque, or angle: rounding */
static const double TRANSMISSION_UNSETTLED = 1e-6; /* of the largest torque */
enum { TRANSMISSION_PASSES = 30, TRANSMISSION_TRIALS = 100 };

/* e of delta. */
static double transmission_dead_zone(double half, double delta) {
    return delta > half ? delta - half : delta < -half ? delta + half : 0;
}

/* Mean of C over a step from delta to delta_end. */
static double transmission_mean(const Transmission *p, double delta, double delta_end, double h) {
    const double e = transmission_dead_zone(p->half, delta), e_end = transmission_dead_zone(p->half, delta_end);
    const bool one_side = !(p->half > 0) || (e > 0 && e_end > 0) || (e < 0 && e_end < 0);
    /* Into contact, out of it, or across the play: the ends differ, by more than their e. */
    const double spring = one_side                         ? (e + e_end) / 2
                          : fabs(e) > 0 || fabs(e_end) > 0 ? (e_end - e) * (e_end + e) / (2 * (delta_end - delta))
                                                           : 0;
    return p->c * spring + p->d * (e_end - e) / h;
}

/* The delta at the end of a step that agrees with its mean torque: delta_free less `give` times it. Both sides rise
 * with delta, so that there is one. */
static double transmission_solve(const Transmission *p, double delta, double delta_free, double give, double h) {
    const double e = transmission_dead_zone(p->half, delta);
    if (!(fabs(e) > 0) && fabs(delta_free) <= p->half) {
        return delta_free;
    }
    const double side = e > 0 || (!(e < 0) && delta_free > 0) ? p->half : -p->half;
    const double inside = (delta_free - side - give * e * (p->c / 2 - p->d / h)) / (1 + give * (p->c / 2 + p->d / h));
    if (!(p->half > 0) || inside * e > 0) {
        return side + inside; /* in contact all the time: linear */
    }
    /* Between delta_free and where it would be if no torque grew on the way: false position, Illinois. */
    double a = delta_free, f_a = give * transmission_mean(p, delta, a, h);
    double b = delta_free - f_a, f_b = b + give * transmission_mean(p, delta, b, h) - delta_free;
    const double enough = TRANSMISSION_SETTLED * (fabs(delta_free - delta) + fabs(f_a));
    for (int trial = 0; trial < TRANSMISSION_TRIALS && fabs(f_b) > enough && fabs(f_b - f_a) > 0; trial++) {
        const double next = b - f_b * (b - a) / (f_b - f_a);
        const double f = next + give * transmission_mean(p, delta, next, h) - delta_free;
        if ((f > 0) == (f_b > 0)) {
            f_a /= 2;
        } else {
            a = b;
            f_a = f_b;
        }
        b = next;
        f_b = f;
    }
    return b;
}

/* One axis, with what the torques of the others do to the structure in angle_free and n_free. */
static void transmission_settle(const Transmission *p, double u, double du, double angle_free, double n_free,
                                double by_angle, double by_n, const TransmissionState *a, TransmissionState *b,
                                double h) {
    const double share = 1 - p->J * by_n / h, drag = p->J * (n_free - a->n_s) / h / share;
    const double delta = a->angle - a->angle_s;
    const double angle = a->angle + h * a->n + h * h / p->J * (u / 2 + du / 6);
    const double give = h * h / (2 * p->J) + by_angle / share;
    const double delta_end = transmission_solve(p, delta, angle - (angle_free + by_angle * drag), give, h);
    const double C = transmission_mean(p, delta, delta_end, h);
    const double e = transmission_dead_zone(p->half, delta), e_end = transmission_dead_zone(p->half, delta_end);
    b->T = drag + C / share;
    b->angle = angle - h * h / (2 * p->J) * C;
    b->n = a->n + h / p->J * (u + du / 2 - C);
    b->u = u + du;
    b->angle_s = angle_free + by_angle * b->T;
    b->n_s = n_free + by_n * b->T;
    b->C = p->c * e_end + (fabs(e_end) > 0 ? p->d * (b->n - b->n_s) : 0);
    b->heat = a->heat + p->d * (e_end - e) / h * (delta_end - delta);
}

bool transmission_step(size_t axes, const Transmission *p, const double *u, const double *du, const double *angle_free,
                       const double *n_free, const double *by_angle, const double *by_n, const TransmissionState *start,
                       TransmissionState *end, double h, bool *settled) {
    double probe = 0;
    size_t joined = 0;
    for (size_t i = 0; i < axes; i++) {
        end[i] = start[i]; /* T as a first guess of what the others do */
        joined += p[i].on;
    }
    double change = 1, most = 0;
    for (int pass = 0; pass < TRANSMISSION_PASSES && change > TRANSMISSION_SETTLED * most; pass++) {
        change = most = 0;
        for (size_t i = 0; i < axes; i++) {
            double angle = angle_free[i], n = n_free[i];
            for (size_t j = 0; p[i].on && j < axes; j++) {
                angle += p[j].on && j != i ? by_angle[i * axes + j] * end[j].T : 0;
                n += p[j].on && j != i ? by_n[i * axes + j] * end[j].T : 0;
            }
            const double T = end[i].T;
            if (p[i].on) {
                transmission_settle(&p[i], u[i], du[i], angle, n, by_angle[i * axes + i], by_n[i * axes + i], &start[i],
                                    &end[i], h);
                change = joined > 1 ? fmax(change, fabs(end[i].T - T)) : 0; /* one alone is settled at once */
                most = fmax(most, fabs(end[i].T));
            }
        }
    }
    *settled = !(change > TRANSMISSION_UNSETTLED * most);
    for (size_t i = 0; i < axes; i++) {
        probe += end[i].T + end[i].n + end[i].angle - (end[i].T + end[i].n + end[i].angle);
    }
    return !isnan(probe);
}

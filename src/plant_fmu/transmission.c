#include "transmission.h"

#include <float.h>
#include <math.h>

static const double TRANSMISSION_SETTLED = 1e-13;  /* of the largest torque: rounding */
static const double TRANSMISSION_UNSETTLED = 1e-6; /* of the largest torque */
enum { TRANSMISSION_PASSES = 60, TRANSMISSION_TRIALS = 60 };

double transmission_rate(const Transmission *p, double J_s) {
    const double per_J = 1 / p->J + 1 / J_s;
    return fmax(sqrt(p->c * per_J), p->d / 2 * per_J);
}

/* delta over a step, as delta + s (b + s (a + s k)), s from 0 to 1. */
typedef struct Cubic {
    double delta, b, a, k;
} Cubic;

static double cubic_at(const Cubic *x, double s) {
    return x->delta + s * (x->b + s * (x->a + s * x->k));
}

/* Where it passes `level` between the shares low and high, upwards or not: Newton, halving where that leaves them. */
static double cubic_pass(const Cubic *x, double level, double low, double high, bool upwards) {
    double s = (low + high) / 2, before = high;
    for (int trial = 0; trial < TRANSMISSION_TRIALS && fabs(s - before) > DBL_EPSILON; trial++) {
        const double y = cubic_at(x, s) - level;
        if ((y < 0) == upwards) {
            low = s;
        } else {
            high = s;
        }
        const double next = s - y / (x->b + s * (2 * x->a + s * 3 * x->k));
        before = s;
        s = next > low && next < high ? next : (low + high) / 2;
    }
    return s;
}

/* The shares between which it does not turn, from 0 to 1; their number, 2 to 4. */
static int cubic_pieces(const Cubic *x, double at[4]) {
    const double root = x->a * x->a - 3 * x->k * x->b;
    int count = 0;
    at[count++] = 0;
    if (root > 0) {
        const double q = -(x->a + copysign(sqrt(root), x->a)); /* b + 2 a s + 3 k s^2 = 0, without cancellation */
        const double one = q / (3 * x->k), other = x->b / q;   /* no number, or far out, where there is none */
        const double turns[2] = {one < other ? one : other, one < other ? other : one};
        for (int i = 0; i < 2; i++) {
            if (turns[i] > 0 && turns[i] < 1) {
                at[count++] = turns[i];
            }
        }
    }
    at[count++] = 1;
    return count;
}

/* What the contact sees of a step. */
typedef struct Seen {
    double e, e_end;     /* [rad] */
    double mean, change; /* of the line with mean and first moment of e [rad] */
} Seen;

/* Add delta - level between the shares s_0 and s_1 of the step. */
static void seen_add(Seen *seen, const Cubic *x, double level, double s_0, double s_1) {
    const double p[4] = {x->delta - level, x->b, x->a, x->k};
    double area = 0, moment = 0, power_0 = s_0, power_1 = s_1;
    for (int n = 0; n < 4; n++) {
        area += p[n] / (n + 1) * (power_1 - power_0);
        power_0 *= s_0;
        power_1 *= s_1;
        moment += p[n] / (n + 2) * (power_1 - power_0);
    }
    seen->mean += area;
    seen->change += 12 * (moment - area / 2);
}

/* e of delta. */
static double transmission_dead_zone(double half, double delta) {
    return delta > half ? delta - half : delta < -half ? delta + half : 0;
}

static Seen transmission_see(const Transmission *p, const Cubic *x) {
    const double delta_end = x->delta + (x->b + x->a + x->k);
    Seen seen = {.e = transmission_dead_zone(p->half, x->delta), .e_end = transmission_dead_zone(p->half, delta_end)};
    if (!(p->half > 0)) {
        seen_add(&seen, x, 0, 0, 1);
        return seen;
    }
    double at[4];
    const int count = cubic_pieces(x, at);
    for (int side = -1; side <= 1; side += 2) {
        const double level = side * p->half;
        bool after = side * (x->delta - level) > 0;
        for (int i = 1; i < count; i++) {
            const bool before = after;
            after = side * (cubic_at(x, at[i]) - level) > 0;
            if (before || after) {
                const double s = before && after ? at[i] : cubic_pass(x, level, at[i - 1], at[i], (side > 0) == after);
                seen_add(&seen, x, level, before ? at[i - 1] : s, after ? at[i] : s);
            }
        }
    }
    return seen;
}

/* What a step's end is by the torque's mean C and its change: the way of delta, and the end speed times h. */
typedef struct Slopes {
    double way_by_C, way_by_change, v_by_C, v_by_change;
} Slopes;

/* The step of Newton's method by what the contact's torque is above C, and what its line is steeper than the change. */
typedef struct Newton {
    double C_by_more, C_by_steeper, change_by_more, change_by_steeper;
} Newton;

/* In contact all along: e has the mean way/2 - v/12, the line's change 6/5 way - v/10 and the end `way` beside what is
 * known at the start. */
static Newton transmission_newton(const Transmission *p, const Slopes *x, double h) {
    const double d = p->d / h;
    const double more_by_C = p->c * (x->way_by_C / 2 - x->v_by_C / 12) + d * x->way_by_C - 1;
    const double more_by_change = p->c * (x->way_by_change / 2 - x->v_by_change / 12) + d * x->way_by_change;
    const double steeper_by_C = p->c * (1.2 * x->way_by_C - 0.1 * x->v_by_C) + d * x->v_by_C;
    const double steeper_by_change = p->c * (1.2 * x->way_by_change - 0.1 * x->v_by_change) + d * x->v_by_change - 1;
    const double per = 1 / (more_by_C * steeper_by_change - more_by_change * steeper_by_C);
    return (Newton){.C_by_more = -steeper_by_change * per,
                    .C_by_steeper = more_by_change * per,
                    .change_by_more = steeper_by_C * per,
                    .change_by_steeper = -more_by_C * per};
}

/* One axis, with what the torques of the others do to the structure in way_free and n_free; by_...: its own. */
static bool transmission_settle(const Transmission *p, double u, double du, double way_free, double n_free,
                                double by_way, double by_n, double by_way_ramp, double by_n_ramp,
                                const TransmissionState *a, TransmissionState *b, double h) {
    /* J dn_s/dt as a line: its mean is that of n_s, its first moment that of n_s and the way. */
    const double moment = 12 * p->J / (h * h), own = 1 - moment * (h * by_n_ramp / 2 - by_way_ramp);
    const double by_T = moment * (h * by_n / 2 - by_way) / own;
    const double ramp_free = moment * (h / 2 * (a->n_s + n_free) - way_free) / own;
    const double way_by_T = by_way + by_way_ramp * by_T, n_by_T = by_n + by_n_ramp * by_T;
    const double share = 1 - p->J * n_by_T / h, per_J = h * h / p->J;
    const double way_motor = h * a->n + per_J * (u / 2 + du / 6), n = a->n + h / p->J * (u + du / 2);
    const double T_by_change = p->J / h * by_n_ramp / (own * share);
    const Slopes slopes = {.way_by_C = -per_J / 2 - way_by_T / share,
                           .way_by_change = per_J / 12 - by_way_ramp / own - way_by_T * T_by_change,
                           .v_by_C = -h * (h / p->J + n_by_T / share),
                           .v_by_change = -h * (by_n_ramp / own + n_by_T * T_by_change)};
    const Newton newton = transmission_newton(p, &slopes, h);
    const double stiff = (per_J / 2 + way_by_T / share) * (p->c / 2 + p->d / h);
    /* What the last places of delta make of C; of its change a dozen times as much. */
    const double last = 2 * DBL_EPSILON * (fabs(a->delta) + fabs(way_motor) + fabs(way_free));
    const double rounding = last * (p->c + p->d / h);
    double C = a->C, change = 0, off = INFINITY;
    Seen seen = {0};
    Cubic path = {.delta = a->delta, .b = h * (a->n - a->n_s)};
    for (int pass = 0; pass < TRANSMISSION_PASSES; pass++) {
        const double ramp = ramp_free + change / own, n_s = n_free + by_n_ramp * ramp;
        b->T = (C + p->J * (n_s - a->n_s) / h) / share;
        b->ramp = ramp + by_T * b->T;
        b->n = n - h / p->J * C;
        b->n_s = n_s + n_by_T * b->T;
        const double way_s = way_free + by_way_ramp * ramp + way_by_T * b->T;
        const double way = way_motor - per_J * (C / 2 - change / 12) - way_s, v_end = h * (b->n - b->n_s);
        b->delta = a->delta + way;
        if (!(off > TRANSMISSION_SETTLED * (fabs(C) + fabs(change)) + rounding)) {
            break;
        }
        path.a = 3 * way - 2 * path.b - v_end;
        path.k = path.b + v_end - 2 * way;
        seen = transmission_see(p, &path);
        const double more = p->c * seen.mean + p->d * (seen.e_end - seen.e) / h - C;
        const double steeper = p->c * seen.change + 12 * p->d / h * ((seen.e + seen.e_end) / 2 - seen.mean) - change;
        if (!(p->half > 0) || seen.e * seen.e_end > 0) { /* in contact all along, mostly */
            C += newton.C_by_more * more + newton.C_by_steeper * steeper;
            change += newton.change_by_more * more + newton.change_by_steeper * steeper;
        } else {
            C += more / (1 + (fabs(seen.e_end) > 0 ? stiff : 0));
            change += steeper;
        }
        off = fabs(more) + fabs(steeper) / 12;
    }
    const double damping = p->d * (seen.e_end - seen.e) / h;
    const double damping_change = 12 * p->d / h * ((seen.e + seen.e_end) / 2 - seen.mean);
    b->u = u + du;
    const double e_end = transmission_dead_zone(p->half, b->delta);
    b->C = p->c * e_end + (fabs(e_end) > 0 ? p->d * (b->n - b->n_s) : 0);
    b->heat = a->heat + damping * (path.b + path.a + path.k) + damping_change * (2 * path.a + 3 * path.k) / 12;
    return !(off > TRANSMISSION_UNSETTLED * (fabs(C) + fabs(change)) + rounding);
}

bool transmission_step(size_t axes, const Transmission *p, const double *u, const double *du,
                       const TransmissionPorts *ports, const TransmissionState *start, TransmissionState *end, double h,
                       bool *settled) {
    double probe = 0;
    size_t joined = 0;
    for (size_t i = 0; i < axes; i++) {
        end[i] = start[i]; /* T as a first guess of what the others do */
        joined += p[i].on;
    }
    double change = 1, most = 0;
    bool own = true;
    for (int pass = 0; pass < TRANSMISSION_PASSES && change > TRANSMISSION_SETTLED * most; pass++) {
        change = most = 0;
        own = true;
        for (size_t i = 0; i < axes; i++) {
            const size_t row = i * axes;
            double way = ports->way_free[i], n = ports->n_free[i];
            for (size_t j = 0; p[i].on && j < axes; j++) {
                if (p[j].on && j != i) {
                    way += ports->by_way[row + j] * end[j].T + ports->by_way_ramp[row + j] * end[j].ramp;
                    n += ports->by_n[row + j] * end[j].T + ports->by_n_ramp[row + j] * end[j].ramp;
                }
            }
            const double T = end[i].T, ramp = end[i].ramp;
            if (p[i].on) {
                own = transmission_settle(&p[i], u[i], du[i], way, n, ports->by_way[row + i], ports->by_n[row + i],
                                          ports->by_way_ramp[row + i], ports->by_n_ramp[row + i], &start[i], &end[i],
                                          h) &&
                      own;
                const double moved = fabs(end[i].T - T) + fabs(end[i].ramp - ramp);
                change = joined > 1 ? fmax(change, moved) : 0; /* one alone is settled at once */
                most = fmax(most, fabs(end[i].T));
            }
        }
    }
    *settled = own && !(change > TRANSMISSION_UNSETTLED * most);
    for (size_t i = 0; i < axes; i++) {
        probe += end[i].T + end[i].n + end[i].delta - (end[i].T + end[i].n + end[i].delta);
    }
    return !isnan(probe);
}

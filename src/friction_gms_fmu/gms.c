#include "gms.h"

#include <float.h>
#include <math.h>
#include <stdbool.h>

static double direction(double n) {
    return (double)((n > 0) - (n < 0));
}

Contact contact_make(const Lugre *lugre, double spread, double skew, double C) {
    Contact p = {
        .curve = *lugre, .sigma_0 = lugre->sigma_0, .sigma_1 = lugre->sigma_1, .sigma_2 = lugre->sigma_2, .C = C};
    p.curve.sigma_0 = 1;
    const double ratio = log(spread) / (GMS_ELEMENTS - 1);
    double shares = 0, stiffnesses = 0;
    for (int i = 0; i < GMS_ELEMENTS; i++) {
        p.share[i] = exp(skew * ratio * i);
        shares += p.share[i];
    }
    for (int i = 0; i < GMS_ELEMENTS; i++) {
        p.share[i] /= shares;
        p.stiffness[i] = p.share[i] * exp(-ratio * i);
        stiffnesses += p.stiffness[i];
    }
    for (int i = 0; i < GMS_ELEMENTS; i++) {
        p.stiffness[i] *= p.sigma_0 / stiffnesses;
    }
    return p;
}

/* s [N.m] at a speed of the size |n| in the direction d: at n = 0 that of this side. */
static double level(const Contact *p, double n, double d) {
    return lugre_level(&p->curve, n != 0 ? n : d * DBL_MIN);
}

ContactState contact_at(const Contact *p, double z, double c) {
    (void)c;
    ContactState state = {.force = {0}};
    const double d = direction(z), s = level(p, 0, d), torque = p->sigma_0 * fabs(z);
    /* The way x at which elements bear that torque together: those that slip, in the order in which they begin to, bear
     * alpha s, the others k x. */
    double slipping = 0, sticking = p->sigma_0;
    int i = 0;
    while (i < GMS_ELEMENTS && slipping + sticking * (p->share[i] * s / p->stiffness[i]) < torque) {
        slipping += p->share[i] * s;
        sticking -= p->stiffness[i];
        i++;
    }
    for (int e = 0; e < GMS_ELEMENTS; e++) {
        const double most = p->share[e] * s;
        state.force[e] = d * (e < i ? most : fmin(p->stiffness[e] * ((torque - slipping) / sticking), most));
    }
    return state;
}

static void stick_all(ContactState *state) {
    for (int i = 0; i < GMS_ELEMENTS; i++) {
        state->slip[i] = 0;
    }
}

/* The first u in [0, 1] at which f_0 + f_1 u + f_2 u^2 has risen to 0; 1 where it does not. No product overflows that
 * is not beyond all torques, and no form of a root has a difference of like numbers. */
static double risen(double f_0, double f_1, double f_2) {
    if (f_0 >= 0) {
        return 0;
    }
    double u = 1;
    if (f_1 > 0) {
        const double discriminant = 1 - 4 * (f_2 / f_1) * (f_0 / f_1);
        u = discriminant >= 0 ? -2 * (f_0 / f_1) / (1 + sqrt(discriminant)) : 1;
    } else if (f_2 > 0) {
        u = (sqrt(f_1 * (f_1 / f_2) - 4 * f_0) - f_1 / sqrt(f_2)) / (2 * sqrt(f_2));
    }
    return u < 1 ? u : 1;
}

/* One part of a step: the speed goes from n_start to n_end without changing its sign. u: share of its time h. */
static void part(const Contact *p, ContactState *state, double n_start, double n_end, double h) {
    const double d = direction(n_start != 0 ? n_start : n_end);
    if (n_start == 0) {
        stick_all(state);
    }
    if (d == 0 || !(h > 0)) {
        return;
    }
    const double s_start = level(p, n_start, d), s_end = level(p, n_end, d), rise = s_end - s_start;
    /* way = speed u + faster u^2 [rad] */
    const double speed = fabs(n_start) * h, faster = (fabs(n_end) - fabs(n_start)) * h / 2;
    const double whole_decay = p->C * h / (s_start + rise / 2), whole_gone = -expm1(-whole_decay);
    for (int i = 0; i < GMS_ELEMENTS; i++) {
        const double k = p->stiffness[i], alpha = p->share[i];
        double force = d * state->force[i]; /* counted in the direction of the motion */
        double begun = 0;                   /* u at which the element begins to slip */
        if (state->slip[i] != d) {
            state->slip[i] = 0;
            begun = risen(force - alpha * s_start, k * speed - alpha * rise, k * faster);
            force += k * begun * (speed + faster * begun);
            if (begun >= 1) {
                state->force[i] = d * force;
                continue;
            }
            state->slip[i] = d;
        }
        /* dF/dt = C/s (alpha s(t) - F), s linear; in the factor C/s its mean */
        double decay = whole_decay, gone = whole_gone;
        const double s_begun = s_start + rise * begun;
        if (begun > 0) {
            decay = p->C * h * (1 - begun) / ((s_begun + s_end) / 2);
            gone = -expm1(-decay);
        }
        const double lag = rise * (1 - begun) * (decay > 0 ? gone / decay : 1);
        force = alpha * (s_end - lag) + (force - alpha * s_begun) * (1 - gone);
        state->force[i] = d * force;
    }
    if (n_end == 0) {
        stick_all(state);
    }
}

ContactState contact_advance(const Contact *p, ContactState state, double n_start, double n_end, double h) {
    if ((n_start < 0 && n_end > 0) || (n_start > 0 && n_end < 0)) {
        const double crossing = h * (n_start / (n_start - n_end));
        part(p, &state, n_start, 0, crossing);
        part(p, &state, 0, n_end, h - crossing);
    } else {
        part(p, &state, n_start, n_end, h);
    }
    return state;
}

double contact_torque(const Contact *p, ContactState state, double n, double *share) {
    const double d = direction(n), s = lugre_level(&p->curve, n);
    double force = 0, rate = 0, sticking = 0;
    bool slips = false;
    for (int i = 0; i < GMS_ELEMENTS; i++) {
        force += state.force[i];
        rate += p->stiffness[i] * (n - fabs(n) * (state.force[i] / (p->share[i] * s)));
        if (d != 0 && state.slip[i] == d) {
            slips = true;
        } else {
            sticking += p->stiffness[i];
        }
    }
    if (share != NULL) {
        *share = slips ? sticking / p->sigma_0 : 1; /* a sum of shares is not 1 to the last bit */
    }
    return force + p->sigma_1 / p->sigma_0 * rate + p->sigma_2 * n;
}

double contact_deflection(const Contact *p, const ContactState *state) {
    double force = 0;
    for (int i = 0; i < GMS_ELEMENTS; i++) {
        force += state->force[i];
    }
    return force / p->sigma_0;
}

double contact_engaged(const Contact *p, const ContactState *state) {
    (void)p;
    (void)state;
    return 0;
}

double contact_torque_by_speed(const Contact *p, const ContactState *state, double n) {
    const double d = direction(n), s = lugre_level(&p->curve, n);
    /* n ds/dn, which stays finite at n = 0 */
    const double s_by_speed = lugre_level_slope(&p->curve, n);
    double rate = 0;
    for (int i = 0; i < GMS_ELEMENTS; i++) {
        rate += p->stiffness[i] * (1 - d * (state->force[i] / (p->share[i] * s)) * (1 - s_by_speed / s));
    }
    return p->sigma_1 / p->sigma_0 * rate + p->sigma_2;
}

void contacts_relate(ContactInRow row[], size_t count) {
    (void)row;
    (void)count;
}

void contacts_advance(ContactInRow row[], size_t count, double n_start, double n_end, double h) {
    for (size_t i = 0; i < count; i++) {
        row[i].state = contact_advance(&row[i].contact, row[i].state, n_start, n_end, h);
    }
}

void contacts_torque(ContactInRow row[], size_t count, double n, double M_fr[], size_t stride) {
    for (size_t i = 0; i < count; i++) {
        M_fr[i * stride] = contact_torque(&row[i].contact, row[i].state, n, NULL);
    }
}

#include "guide.h"

#include <math.h>

/* A force counts as settled within this share of the static force. Where the force changes evenly, what the last step
 * foretells is that near, and the law is worked once. */
static const double SETTLED = 1e-6;
enum { PASSES = 20, TRIALS = 40 };

static double guide_place(const Guide *guide, double x) {
    const double at = (x - guide->place_first) / guide->place_spacing;
    if (!(at > 0)) {
        return guide->place[0];
    }
    if (at >= GUIDE_PLACES - 1) {
        return guide->place[GUIDE_PLACES - 1];
    }
    const size_t k = (size_t)at;
    return guide->place[k] + (at - (double)k) * (guide->place[k + 1] - guide->place[k]);
}

/* The law where and as warm as the guide is. */
static Contact guide_contact(const Guide *guide, const GuideState *state) {
    Contact contact = guide->contact;
    if (guide->placed) {
        const double factor = 1 + guide_place(guide, state->x);
        contact.lugre.F_C *= factor;
        contact.lugre.F_S *= factor;
        contact.lugre.F_log *= factor;
    }
    if (guide->warm_time > 0) {
        const double factor = exp(-state->warmth);
        contact.lugre.sigma_2 *= factor;
        contact.lugre.F_log *= factor;
    }
    return contact;
}

/* Speed of a slide at the end of a step with the forces that `end` holds. */
static double guide_speed(size_t axes, const Guide *guides, const double *held, const double *ramp,
                          const GuideState *start, const GuideState *end, double v_free) {
    double v = v_free;
    for (size_t j = 0; j < axes; j++) {
        if (guides[j].on) {
            v -= held[j] * start[j].F + ramp[j] * (end[j].F - start[j].F);
        }
    }
    return v;
}

/* Force of one guide, the others held: a search along the law's slope, which is taken as steep as it can be at first,
 * so that it comes nearer with every trial, and by what the trials show then. `mobility`: of the slide by its own ramp.
 * Whether the force was other than foretold. */
static bool guide_settle(const Guide *guide, const GuideState *start, GuideState *end, double v, double mobility,
                         double h) {
    const Contact now = guide_contact(guide, start), *p = &now;
    const double enough = SETTLED * p->lugre.F_S;
    double F_before = end->F, rest_before = 0;
    for (int trial = 0; trial < TRIALS; trial++) {
        const ContactState contact = contact_advance(p, start->contact, start->v, v, h);
        const ContactForce law = contact_force(p, contact, v);
        const double rest = law.M_fr - end->F, steepest = p->lugre.sigma_1 + p->lugre.sigma_2 + p->lugre.sigma_0 * h;
        end->contact = contact;
        end->v = v;
        if (!(fabs(rest) > enough)) { /* no number ends it, too */
            end->F = law.M_fr;
            return trial > 0;
        }
        double slope = 1 + mobility * steepest;
        if (trial > 0 && fabs(end->F - F_before) > 0) {
            const double seen = (rest_before - rest) / (end->F - F_before);
            slope = seen >= 0.5 && seen <= slope ? seen : slope;
        }
        F_before = end->F;
        rest_before = rest;
        end->F += rest / slope;
        v -= mobility * (end->F - F_before);
    }
    return true;
}

bool guide_step(size_t axes, const Guide *guides, const double *v_free, const double *held, const double *ramp,
                const GuideState *start, GuideState *end, double h) {
    double probe = 0;
    for (size_t i = 0; i < axes; i++) {
        end[i].F = start[i].F + start[i].slope * h;
    }
    bool other = true;
    for (int pass = 0; other && pass < PASSES; pass++) {
        other = false;
        for (size_t i = 0; i < axes; i++) {
            if (guides[i].on) {
                const double v = guide_speed(axes, guides, held + i * axes, ramp + i * axes, start, end, v_free[i]);
                const bool moved = guide_settle(&guides[i], &start[i], &end[i], v, ramp[i * axes + i], h);
                other = moved || other;
            }
        }
    }
    for (size_t i = 0; i < axes; i++) {
        const GuideState *a = &start[i];
        GuideState *b = &end[i];
        b->slope = (b->F - a->F) / h;
        b->work = a->work + h / 6 * (a->F * (2 * a->v + b->v) + b->F * (a->v + 2 * b->v));
        b->x = a->x;
        b->warmth = a->warmth;
        if (guides[i].warm_time > 0) {
            const double power = (a->F + b->F) * (a->v + b->v) / 4;
            b->warmth -= (power / guides[i].warm_power - a->warmth) * expm1(-h / guides[i].warm_time);
        }
        probe += b->F + b->warmth - (b->F + b->warmth);
    }
    return !isnan(probe);
}

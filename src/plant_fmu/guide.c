#include "guide.h"

#include <math.h>

/* A force counts as settled within this share of the static force; beyond the second, it has not settled at all. */
static const double SETTLED = 1e-6, UNSETTLED = 1e-4;
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

/* The law where and as warm as the guide is; `changed` has room for it. */
static const Contact *guide_contact(const Guide *guide, const GuideState *state, Contact *changed) {
    if (!guide->placed && !(guide->warm_time > 0)) {
        return &guide->contact;
    }
    *changed = guide->contact;
    if (guide->placed) {
        const double factor = 1 + guide_place(guide, state->x);
        changed->lugre.F_C *= factor;
        changed->lugre.F_S *= factor;
        changed->lugre.F_log *= factor;
    }
    if (guide->warm_time > 0) {
        const double factor = exp(-state->warmth);
        changed->lugre.sigma_2 *= factor;
        changed->lugre.F_log *= factor;
    }
    return changed;
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

/* The law's slope over speed at the end of a step, as steep as it can be. */
static double guide_steepest(const Contact *p, double h) {
    const double engaging = p->W > 0 ? (1 - p->gamma) * p->lugre.F_S * h / p->W : 0;
    return p->lugre.sigma_1 + p->lugre.sigma_2 + p->lugre.sigma_0 * h + engaging;
}

/* Force of one guide, the others held: a search along the law's slope, which is taken as steep as it can be at first,
 * so that it comes nearer with every trial, and by what the trials show then. `mobility`: of the slide by its own ramp.
 * The speed is always that of the force, so that a trial is the last one as soon as the law cannot differ from the
 * force at it: mostly the first. Returns by how much of F_S it may differ. */
static double guide_settle(const Guide *guide, const GuideState *start, GuideState *end, double v, double mobility,
                           double h) {
    Contact changed;
    const Contact *p = guide_contact(guide, start, &changed);
    const double enough = SETTLED * p->lugre.F_S, steepest = guide_steepest(p, h);
    double F_before = end->F, rest_before = 0, open = 0;
    for (int trial = 0; trial < TRIALS; trial++) {
        end->contact = contact_advance(p, start->contact, start->v, v, h);
        const double rest = contact_force(p, end->contact, v).M_fr - end->F;
        double slope = 1 + mobility * steepest;
        if (trial > 0 && fabs(end->F - F_before) > 0) {
            const double seen = (rest_before - rest) / (end->F - F_before);
            slope = seen >= 0.5 && seen <= slope ? seen : slope;
        }
        F_before = end->F;
        rest_before = rest;
        end->F += rest / slope;
        end->v = v -= mobility * (end->F - F_before);
        open = fabs(rest) / slope * (fabs(slope - 1) + mobility * steepest);
        if (!(open > enough)) { /* no number ends it, too */
            break;
        }
    }
    return open / p->lugre.F_S;
}

bool guide_step(size_t axes, const Guide *guides, const double *v_free, const double *held, const double *ramp,
                const GuideState *start, GuideState *end, double h, bool *settled) {
    double probe = 0;
    for (size_t i = 0; i < axes; i++) {
        if (guides[i].on) {
            end[i].F = start[i].F + start[i].slope * h;
        }
    }
    bool other = true;
    *settled = true;
    for (int pass = 0; other && pass < PASSES; pass++) {
        double open = 0;
        for (size_t i = 0; i < axes; i++) {
            if (!guides[i].on) {
                continue;
            }
            const double F = end[i].F;
            const double v = guide_speed(axes, guides, held + i * axes, ramp + i * axes, start, end, v_free[i]);
            open = fmax(open, guide_settle(&guides[i], &start[i], &end[i], v, ramp[i * axes + i], h));
            for (size_t j = 0; j < axes; j++) { /* what the other slides have to follow */
                const double moved = guides[j].on && j != i ? ramp[j * axes + i] * (end[i].F - F) : 0;
                if (fabs(moved) > 0) {
                    open =
                        fmax(open, fabs(moved) * guide_steepest(&guides[j].contact, h) / guides[j].contact.lugre.F_S);
                }
            }
        }
        other = open > SETTLED;
        *settled = !(open > UNSETTLED);
    }
    for (size_t i = 0; i < axes; i++) {
        const GuideState *a = &start[i];
        GuideState *b = &end[i];
        if (!guides[i].on) {
            continue;
        }
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

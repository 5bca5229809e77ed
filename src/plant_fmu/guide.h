/* Friction between the slides and their rails: the friction law of the unit `friction` (lugre.h, tem.h, contact.h) in
 * N and m/s in place of N.m and rad/s, solved together with the structure.
 *
 *   v_i+ = v_free_i - sum over j of (held_ij F_j + ramp_ij (F_j+ - F_j))      F_j linear over the step
 *   F_i+ = law(speed linear from v_i to v_i+)
 *
 * Over position F_C, F_S and F_log are multiplied by 1 + place(x), a table, linear between its entries and held beyond.
 * Warming, sigma_2 and F_log are multiplied by exp(-theta), tau dtheta/dt = F v / P_w - theta; both of the step's
 * start.
 *
 * v_free: speeds at the end of the step without these forces; held, ramp: modal_forecast(). The step is implicit, so
 * that stiff guides set no limit to it, and no energy is lost between structure and friction. Pure functions; the
 * memory is the caller's. */
#ifndef FEEDSIM_GUIDE_H
#define FEEDSIM_GUIDE_H

#include <stdbool.h>
#include <stddef.h>

#include "../friction_fmu/contact.h"
#include "prefix.h"

#define guide_step PREFIXED(guide_step)

enum { GUIDE_PLACES = 11 };

typedef struct Guide {
    bool on;
    Contact contact;                                        /* [m], [m/s], [N] */
    bool placed;                                            /* the table has entries that are not 0 */
    double place_first, place_spacing, place[GUIDE_PLACES]; /* [m], [m], [1] */
    double warm_time, warm_power;                           /* tau [s], 0: none; P_w [W] */
} Guide;

/* All numbers, so that it lies among those of a state. */
typedef struct GuideState {
    ContactState contact;
    double v;     /* speed of slide against rail [m/s] */
    double F;     /* friction force, sign of v [N] */
    double slope; /* change of F over the last step, per second [N/s] */
    double work;  /* done against it since the start [J] */
    double x;     /* position [m], which the caller writes */
    double warmth;
} GuideState;

/* Advance the guides over h [s] > 0, from start[axes] to end[axes]; held, ramp: [axes][axes] [m/s/N]. False where a
 * force is no finite number. *settled: each force is that of its law, to 1e-6 of F_S where it can be, to 1e-4 at
 * least. */
bool guide_step(size_t axes, const Guide *guides, const double *v_free, const double *held, const double *ramp,
                const GuideState *start, GuideState *end, double h, bool *settled);

#endif

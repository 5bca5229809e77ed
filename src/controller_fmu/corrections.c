#include "corrections.h"

#include <math.h>

double corrections_step(const Corrections *p, CorrectionsState *x, double x_s) {
    if (x->started) {
        reversal_step(&x->reversal, p->resolution, x_s - x->x_s);
    }
    x->x_s = x_s;
    x->started = 1;
    const double direction = x->reversal.direction, remaining = direction - x->s;
    x->s = fabs(remaining) <= p->change ? direction : x->s + (remaining > 0.0 ? p->change : -p->change);
    double corrected = x_s + 0.5 * x->s * p->backlash;
    if (p->leadscrew.used) {
        const double plus = points_value(&p->leadscrew, x_s);
        const double minus = p->leadscrew_minus.used ? points_value(&p->leadscrew_minus, x_s) : plus;
        corrected += 0.5 * (plus + minus) + 0.5 * x->s * (plus - minus);
    }
    return corrected;
}

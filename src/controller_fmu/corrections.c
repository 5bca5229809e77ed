#include "corrections.h"

#include <math.h>

static const double STANDSTILL = 1e-12; /* m: what rounding makes of a setpoint that stands */

double corrections_step(const Corrections *p, CorrectionsState *x, double x_s) {
    if (x->started && fabs(x_s - x->x_s) > STANDSTILL) {
        x->direction = x_s > x->x_s ? 1.0 : -1.0;
    }
    x->x_s = x_s;
    x->started = 1;
    const double remaining = x->direction - x->s;
    x->s = fabs(remaining) <= p->change ? x->direction : x->s + (remaining > 0.0 ? p->change : -p->change);
    double corrected = x_s + 0.5 * x->s * p->backlash;
    if (p->leadscrew.used) {
        const double plus = points_value(&p->leadscrew, x_s);
        const double minus = p->leadscrew_minus.used ? points_value(&p->leadscrew_minus, x_s) : plus;
        corrected += 0.5 * (plus + minus) + 0.5 * x->s * (plus - minus);
    }
    return corrected;
}

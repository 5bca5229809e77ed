#include "free_axis.h"

#include <math.h>
#include <stdbool.h>

#ifndef LAW_PARAMETERS /* another law brings its own, with the same functions */
#define LAW_PARAMETERS "parameters.h"
#endif
#include LAW_PARAMETERS

typedef struct Axis {
    double angle, n;         /* [rad], [rad/s] */
    double M_fr, M_fr_slope; /* now [N.m], over the last step [N.m/s] */
    ContactState contact;
} Axis;

/* A step of h [s] under the torque M [N.m], the constant load taken off. */
static void advance(const Contact *p, double J, Axis *x, double M, double h) {
    const double a = (M - x->M_fr) / J, jerk = -x->M_fr_slope / J;
    const double n = x->n + h * (a + h / 2 * jerk);
    x->angle += h * (x->n + h / 2 * (a + h / 3 * jerk));
    x->contact = contact_advance(p, x->contact, x->n, n, h);
    x->n = n;
    const double M_fr = contact_torque(p, x->contact, n, NULL);
    x->M_fr_slope = (M_fr - x->M_fr) / h;
    x->M_fr = M_fr;
}

size_t free_axis(const double parameters[], double J, double M_0, const double M_a[], size_t steps, double h,
                 size_t substeps, double n, double z, double angle[], double speed[]) {
    Scalars v;
    const bool sized = isfinite(J) && J > 0 && isfinite(h) && h > 0 && substeps > 0;
    if (!sized || !parameters_take(parameters, &v) || !parameters_agree(&v)) {
        return 0;
    }
    const Contact p = parameters_contact(&v);
    const double d = h / (double)substeps;
    Axis x = {.n = n, .contact = contact_at(&p, z, 0)};
    x.M_fr = contact_torque(&p, x.contact, n, NULL);
    for (size_t i = 0;; i++) {
        if (!isfinite(x.angle) || !isfinite(x.n)) {
            return i;
        }
        angle[i] = x.angle;
        if (speed != NULL) {
            speed[i] = x.n;
        }
        if (i == steps) {
            return i + 1;
        }
        for (size_t k = 0; k < substeps; k++) {
            advance(&p, J, &x, M_a[i] - M_0, d);
        }
    }
}

/* The arithmetic between the units, on n entries: one rounding per operation, in the order that the formula shows, so
 * that the master's own arithmetic gives the same bits. y may be one of the operands. */
#ifndef FEEDSIM_VECTORS_H
#define FEEDSIM_VECTORS_H

#include <math.h>
#include <stddef.h>

static inline void vector_copy(size_t n, double y[], const double a[]) {
    for (size_t i = 0; i < n; i++) {
        y[i] = a[i];
    }
}

static inline void vector_line(size_t n, double y[], const double a[], double s, const double b[]) {
    for (size_t i = 0; i < n; i++) {
        y[i] = a[i] + s * b[i];
    }
}

static inline void vector_rate(size_t n, double y[], const double a[], const double b[], double s) {
    for (size_t i = 0; i < n; i++) {
        y[i] = (a[i] - b[i]) / s;
    }
}

/* Over a step h: what friction takes from the bond, what the plant has assumed that it would take, and the difference,
 * the residual, with the largest that was met (NaN where there is one). */
static inline void bond_exchange(size_t n, double h, const double M_fr[], const double speed[], const double slope[],
                                 const double assumed_torque[], const double n_end[], double residual[],
                                 double residual_peak[], double dissipated[]) {
    for (size_t i = 0; i < n; i++) {
        const double taken = M_fr[i] * (speed[i] + h * slope[i]);
        residual[i] += 0.5 * h * (assumed_torque[i] * n_end[i] - taken);
        dissipated[i] += h * taken;
        const double size = fabs(residual[i]);
        if (size > residual_peak[i] || isnan(size)) {
            residual_peak[i] = size;
        }
    }
}

#endif

/* The arithmetic between the units, on n entries: one rounding per operation, in the order that the formula shows, so
 * that the master's own arithmetic gives the same bits. y may be one of the operands. */
#ifndef FEEDSIM_VECTORS_H
#define FEEDSIM_VECTORS_H

#include <math.h>
#include <stddef.h>

static inline void vector_copy(size_t n, double y[], const double a[]) {
    for (size_t i = 0; i < n; i++)
        y[i] = a[i];
}

static inline void vector_line(size_t n, double y[], const double a[], double s, const double b[]) {
    for (size_t i = 0; i < n; i++)
        y[i] = a[i] + s * b[i];
}

static inline void vector_rate(size_t n, double y[], const double a[], const double b[], double s) {
    for (size_t i = 0; i < n; i++)
        y[i] = (a[i] - b[i]) / s;
}

static inline void vector_product(size_t n, double y[], const double a[], const double b[]) {
    for (size_t i = 0; i < n; i++)
        y[i] = a[i] * b[i];
}

static inline void vector_peak(size_t n, double y[], const double a[]) {
    for (size_t i = 0; i < n; i++) {
        const double size = fabs(a[i]);
        if (size > y[i] || isnan(size))
            y[i] = size;
    }
}

#endif

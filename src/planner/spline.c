#include "spline.h"

#include <math.h>

size_t spline_memory(size_t points, size_t axes) {
    return points * (3 * axes + 6);
}

void spline_lay_out(Spline *spline, size_t points, size_t axes, double *memory) {
    spline->points = points;
    spline->axes = axes;
    double **const arrays[] = {&spline->h,        &spline->distance, &spline->weight,
                               &spline->diagonal, &spline->next,     &spline->after};
    for (size_t k = 0; k < sizeof arrays / sizeof *arrays; k++) {
        *arrays[k] = memory;
        memory += points;
    }
    spline->corner = memory;
    spline->value = memory + points * axes;
    spline->second = memory + 2 * points * axes;
}

/* (R + smoothing Q' D Q) second = Q' corner, value = corner - smoothing D Q second: R is tridiagonal, the whole has two
 * bands above its diagonal. D is the reciprocal of the weights of the squares, 0 at both ends. */
static void solve(Spline *s, double smoothing) {
    const size_t last = s->points - 1, axes = s->axes;
    const double *h = s->h, *D = s->weight;
    double *d = s->diagonal, *e = s->next, *f = s->after; /* L D L', entries of rows 1..last - 1 */
    for (size_t k = 1; k < last; k++) {
        const double below = 1 / h[k - 1], above = 1 / h[k], middle = -below - above;
        d[k] = (h[k - 1] + h[k]) / 3 +
               smoothing * (below * below * D[k - 1] + middle * middle * D[k] + above * above * D[k + 1]);
        e[k] = f[k] = 0;
        if (k + 1 < last) {
            const double next = 1 / h[k + 1];
            e[k] = h[k] / 6 + smoothing * above * (middle * D[k] + (-above - next) * D[k + 1]);
        }
        if (k + 2 < last) {
            f[k] = smoothing * above * D[k + 1] / h[k + 1];
        }
        for (size_t i = 0; i < axes; i++) {
            const double *y = s->corner + k * axes + i;
            s->second[k * axes + i] = (y[axes] - y[0]) * above - (y[0] - *(y - axes)) * below;
        }
    }
    for (size_t k = 1; k < last; k++) {
        const double first = k > 1 ? e[k - 1] : 0, far = k > 2 ? f[k - 2] : 0;
        if (k > 1) {
            d[k] -= first * first * d[k - 1];
        }
        if (k > 2) {
            d[k] -= far * far * d[k - 2];
        }
        if (k > 1) {
            e[k] -= first * f[k - 1] * d[k - 1];
        }
        for (size_t i = 0; i < axes; i++) {
            double *b = s->second + k * axes + i;
            *b -= (k > 1 ? first * *(b - axes) : 0) + (k > 2 ? far * *(b - 2 * axes) : 0);
        }
        e[k] /= d[k];
        f[k] /= d[k];
    }
    for (size_t i = 0; i < axes; i++) {
        s->second[i] = s->second[last * axes + i] = 0;
    }
    for (size_t k = last - 1; k > 0; k--) {
        for (size_t i = 0; i < axes; i++) {
            double *x = s->second + k * axes + i;
            *x = *x / d[k] - (k + 1 < last ? e[k] * x[axes] : 0) - (k + 2 < last ? f[k] * x[2 * axes] : 0);
        }
    }
    for (size_t k = 0; k <= last; k++) {
        const double below = k > 0 ? 1 / h[k - 1] : 0, above = k < last ? 1 / h[k] : 0;
        for (size_t i = 0; i < axes; i++) {
            const double *x = s->second + k * axes + i;
            const double bend = (k < last ? (x[axes] - x[0]) * above : 0) - (k > 0 ? (x[0] - *(x - axes)) * below : 0);
            s->value[k * axes + i] = s->corner[k * axes + i] - smoothing * D[k] * bend;
        }
    }
}

/* Distance of a point from a side of the polygon. */
static double from_side(const Spline *s, size_t k, const double *point) {
    const double *a = s->corner + k * s->axes, *b = a + s->axes;
    double along = 0, length = 0, sum = 0;
    for (size_t i = 0; i < s->axes; i++) {
        along += (point[i] - a[i]) * (b[i] - a[i]);
        length += (b[i] - a[i]) * (b[i] - a[i]);
    }
    const double share = fmin(fmax(along / length, 0), 1);
    for (size_t i = 0; i < s->axes; i++) {
        const double d = point[i] - a[i] - share * (b[i] - a[i]);
        sum += d * d;
    }
    return sqrt(sum);
}

#define POINTS 4 /* of a piece that are looked at */

static double measure_distances(Spline *s, size_t *worst) {
    double largest = 0;
    double point[16];
    for (size_t k = 0; k + 1 < s->points; k++) {
        const double h = s->h[k];
        s->distance[k] = 0;
        for (int at = 0; at < POINTS; at++) {
            const double u = (double)at / POINTS;
            for (size_t i = 0; i < s->axes; i++) {
                const double *g = s->value + k * s->axes + i, *x = s->second + k * s->axes + i;
                point[i] =
                    g[0] + u * (g[s->axes] - g[0]) - h * h / 6 * u * (1 - u) * ((2 - u) * x[0] + (1 + u) * x[s->axes]);
            }
            double nearest = from_side(s, k, point);
            if (k > 0) {
                nearest = fmin(nearest, from_side(s, k - 1, point));
            }
            if (k + 2 < s->points) {
                nearest = fmin(nearest, from_side(s, k + 1, point));
            }
            s->distance[k] = fmax(s->distance[k], nearest);
        }
        if (s->distance[k] > largest) {
            largest = s->distance[k];
            *worst = k;
        }
    }
    return largest;
}

double fit_spline(Spline *s, double tolerance, size_t *worst) {
    const size_t last = s->points - 1;
    double mean = 0;
    for (size_t k = 0; k < last; k++) {
        double sum = 0;
        for (size_t i = 0; i < s->axes; i++) {
            const double d = s->corner[(k + 1) * s->axes + i] - s->corner[k * s->axes + i];
            sum += d * d;
        }
        s->h[k] = sqrt(sum);
        mean += s->h[k] / (double)last;
    }
    s->weight[0] = s->weight[last] = 0;
    for (size_t k = 1; k < last; k++) {
        s->weight[k] = 2 * mean / (s->h[k - 1] + s->h[k]);
    }
    /* The weight in units of h^3: from interpolation to nearly a straight line. */
    double low = 1e-4, high = 1e14;
    const double unit = mean * mean * mean;
    solve(s, unit * low);
    const double least = measure_distances(s, worst);
    if (least > tolerance) {
        return least;
    }
    while (high > 1.05 * low) {
        const double middle = sqrt(low * high);
        solve(s, unit * middle);
        if (measure_distances(s, worst) <= tolerance) {
            low = middle;
        } else {
            high = middle;
        }
    }
    solve(s, unit * low);
    return measure_distances(s, worst);
}

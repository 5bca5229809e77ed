#include "corner.h"

#include <math.h>

static double distance(size_t axes, const double *a, const double *b) {
    double sum = 0;
    for (size_t i = 0; i < axes; i++) {
        sum += (a[i] - b[i]) * (a[i] - b[i]);
    }
    return sqrt(sum);
}

/* First derivative by u at both ends. 2 L makes a straight line run evenly and is the fastest up to 120 degrees or so;
 * where the path turns back, less is. */
static double first_derivative(double L, double cosine) {
    return L * (2 + 0.7 * fmin(cosine, 0));
}

void corner_curve(const Element *e1, const Element *e2, size_t axes, double L, double cosine, Curve *curve,
                  double s[2]) {
    double x0[3][PLANNER_AXES], x1[3][PLANNER_AXES];
    s[0] = element_at(e1, axes, e1->length - L, 2, x0);
    s[1] = element_at(e2, axes, L, 2, x1);
    const double c = first_derivative(L, cosine);
    *curve = (Curve){.degree = 5, .c = c};
    for (size_t i = 0; i < axes; i++) {
        const double D = x1[0][i] - x0[0][i], d0 = c * x0[1][i], d1 = c * x1[1][i];
        const double a0 = c * c * x0[2][i], a1 = c * c * x1[2][i];
        curve->p[0][i] = x0[0][i];
        curve->p[1][i] = d0;
        curve->p[2][i] = a0 / 2;
        curve->p[3][i] = 10 * D - 6 * d0 - 4 * d1 - 1.5 * a0 + 0.5 * a1;
        curve->p[4][i] = -15 * D + 8 * d0 + 7 * d1 + 1.5 * a0 - a1;
        curve->p[5][i] = 6 * D - 3 * d0 - 3 * d1 - 0.5 * a0 + 0.5 * a1;
    }
}

/* Distance of a point from the stretch q0..q1 of an element, by Newton's method from q. */
static double distance_from(const Element *e, size_t axes, const double *point, double q0, double q1, double q) {
    double x[3][PLANNER_AXES];
    for (int step = 0; step < 8; step++) {
        element_at(e, axes, q, 2, x);
        double slope = 0, curvature = 0;
        for (size_t i = 0; i < axes; i++) {
            const double d = x[0][i] - point[i];
            slope += d * x[1][i];
            curvature += x[1][i] * x[1][i] + d * x[2][i];
        }
        const double wanted = curvature > 0 ? q - slope / curvature : (slope > 0 ? q0 : q1);
        const double next = wanted < q0 ? q0 : (wanted > q1 ? q1 : wanted);
        if (fabs(next - q) < 1e-12) {
            break;
        }
        q = next;
    }
    element_at(e, axes, q, 0, x);
    return distance(axes, point, x[0]);
}

#define DEVIATION_POINTS 16

/* Largest distance between the corner and the elements that it replaces. */
static double deviation(const Element *e1, const Element *e2, size_t axes, double L, double cosine) {
    Curve curve;
    double s[2], x[1][PLANNER_AXES], vertex[1][PLANNER_AXES];
    corner_curve(e1, e2, axes, L, cosine, &curve, s);
    element_at(e2, axes, 0, 0, vertex);
    curve_at(&curve, axes, 0.5, 0, x);
    double largest = distance(axes, x[0], vertex[0]);
    for (int k = 1; k < DEVIATION_POINTS; k++) {
        const double u = (double)k / DEVIATION_POINTS;
        curve_at(&curve, axes, u, 0, x);
        const double along = (2 * u - 1) * L;
        const double first = distance_from(e1, axes, x[0], e1->length - L, e1->length, e1->length + fmin(along, 0));
        const double second = distance_from(e2, axes, x[0], 0, L, fmax(along, 0));
        largest = fmax(largest, fmin(first, second));
    }
    return largest;
}

/* Largest distance of the stretch q0..q1 of an element from the programmed path. */
static double strays(const Element *e, double q0, double q1) {
    double largest = 0, q = 0;
    for (size_t k = 0; k < e->count; q += e->piece[k++].length) {
        if (q < q1 && q + e->piece[k].length > q0) {
            largest = fmax(largest, e->piece[k].strays);
        }
    }
    return largest;
}

double corner_leg(const Element *e1, const Element *e2, size_t axes, double longest, double tolerance, double jump,
                  double cosine) {
    if (element_is_straight(e1) && element_is_straight(e2)) {
        const double c = first_derivative(1, cosine);
        return fmin(longest, tolerance / (jump * (0.5 - 5 * c / 32)));
    }
    if (e1->count > 1 || e2->count > 1) {
        /* Splines stray from the programmed path already. */
        const double half = tolerance / 2;
        if (strays(e1, e1->length - longest, e1->length) > 0 || strays(e2, 0, longest) > 0) {
            tolerance = half;
            while (fmax(strays(e1, e1->length - longest, e1->length), strays(e2, 0, longest)) > half) {
                longest /= 2;
            }
        }
    }
    /* The deviation grows with the leg, with its square where the directions agree: then along the chord through the
     * last two, which a curve that bends upwards crosses on the safe side. */
    const double wanted = 0.98 * tolerance;
    double L = longest, d = deviation(e1, e2, axes, L, cosine);
    double shorter = L * (jump > 0.01 ? wanted / d : sqrt(wanted / d));
    for (int step = 0; step < 20 && d > tolerance; step++) {
        const double reached = deviation(e1, e2, axes, shorter, cosine), slope = (d - reached) / (L - shorter);
        L = shorter;
        d = reached;
        shorter = fmin(fmax(slope > 0 ? L - (d - wanted) / slope : 0, L / 4), 0.98 * L);
    }
    return d > tolerance ? 0 : L;
}

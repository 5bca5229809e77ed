/* Smoothing splines: the smoothest natural cubic within a tolerance of a polygon. */
#ifndef FEEDSIM_PLANNER_SPLINE_H
#define FEEDSIM_PLANNER_SPLINE_H

#include <stddef.h>

/* A polygon of `points` corners, `axes` numbers each, and its spline: a cubic over each side's length h, from value[k]
 * with second derivatives second[k] and second[k + 1] by the length. */
typedef struct Spline {
    size_t points, axes;
    double *h;                                /* [points - 1] */
    double *corner, *value, *second;          /* [points][axes] */
    double *distance;                         /* [points - 1]: the largest of each piece from the polygon */
    double *weight, *diagonal, *next, *after; /* [points] for the solver */
} Spline;

/* Doubles that a spline needs. */
size_t spline_memory(size_t points, size_t axes);

/* Let the spline's arrays lie in this memory. */
void spline_lay_out(Spline *spline, size_t points, size_t axes, double *memory);

/* Fit the spline to its corners. They are met at both ends; between, sum of squares plus weight times integral of the
 * squared second derivative is least, one weight for all axes, as large as keeps the spline within `tolerance` of the
 * polygon (C. H. Reinsch, Smoothing by spline functions, Numerische Mathematik 10, 1967). Returns the largest distance:
 * above `tolerance` where no weight keeps it, with *worst the piece that strays most. */
double fit_spline(Spline *spline, double tolerance, size_t *worst);

#endif

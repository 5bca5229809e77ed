/* A quantity over position, given at points in equal distances; linear between them, beyond the ends as there. No FMI.
 */
#ifndef FEEDSIM_POINTS_H
#define FEEDSIM_POINTS_H

#include <stdbool.h>

#include "prefix.h"

#define points_of PREFIXED(points_of)
#define points_value PREFIXED(points_value)

enum { POINTS = 11 };

typedef struct Points {
    bool used;
    double first, spacing; /* [m] */
    double at[POINTS];
} Points;

/* spacing 0: no table. at[POINTS]. */
Points points_of(double first, double spacing, const double *at);

/* Of a table that is used, at x [m]. */
double points_value(const Points *p, double x);

#endif

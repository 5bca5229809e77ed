/* The nearest points of a programmed path: where on it an axis position lies, and how far off.
 *
 * A path is a row of elements, lines and arcs, one after the other over the length s [m] of the path. Points of an
 * element, over its share u in 0 to 1:
 *
 *     line  x = begin + u line
 *     arc   x = begin + u line + cosine (cos(u angle) - 1) + sine sin(u angle)
 *
 * with `cosine` from the centre to the begin and `sine` a quarter of a turn further; `line` of an arc is the way along
 * its normal (helix), 0 else. All vectors have `axes` components [m]. */
#ifndef FEEDSIM_PLANNER_NEAREST_H
#define FEEDSIM_PLANNER_NEAREST_H

#include <stdint.h>

#include "planner.h"

typedef struct {
    int64_t axes, elements;
    const double *begin, *line, *cosine, *sine; /* (elements, axes) */
    const double *angle;                        /* (elements): 0 of lines */
    const double *s;                            /* (elements + 1): length of the path at their ends */
} ProgrammedPath;                               /* PLANNER_AXES at most */

/* The nearest points of `path` to `count` positions x (count, axes), each within the window of its length `at` -
 * `reach` to `at` + `reach` (count). Of points equally near to 1 nm, the one nearer to `at`. Leaves element (count), s
 * (count), point (count, axes) and the direction of the path there (count, axes). */
PLANNER_API void planner_nearest(const ProgrammedPath *path, int64_t count, const double *x, const double *at,
                                 const double *reach, int64_t *element, double *s, double *point, double *direction);

#endif

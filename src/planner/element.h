/* Rows of a program, and the lines, arcs and splines that they stand for. Inside the path. */
#ifndef FEEDSIM_PLANNER_ELEMENT_H
#define FEEDSIM_PLANNER_ELEMENT_H

#include "path.h"

#define LEAST_LEG 1e-9 /* of a corner [m] */

enum { RAPID, LINE, ARC, DWELL };
enum { EXACT_STOP, CONTINUOUS, DISTANCE, TOLERANCE };

/* Memory for `wanted` entries of that size, with *room for more. False without memory. */
bool make_room(void **memory, size_t *room, size_t wanted, size_t size);

/* --- rows */

const double *row_start(const Program *p, int64_t row);
bool axis_is_geometric(const Program *p, int64_t axis);

/* Lengths of a straight displacement: over all axes, and over those that the programmed speed is for. */
void row_lengths(const Program *p, const double *from, const double *to, double *all, double *fed);

/* Whether the row moves X, Y or Z, to which the programmed speed then belongs. */
bool row_moves_tool(const Program *p, int64_t row);

/* Programmed speed; infinite of a rapid. */
double row_feed(const Program *p, int64_t row);

/* Whether the motion stops between `row` and `next`, the row that moves or dwells after it. */
bool rows_stop_between(const Program *p, int64_t row, int64_t next);

/* Whether a row may be part of a spline. */
bool row_is_short(const Program *p, int64_t row);

/* --- elements */

/* Read the row, and as many as belong to its spline; *s: place of the begin, then of the end on the programmed path.
 * False without memory. */
bool element_read(Builder *builder, int64_t row, double *s, Element *e);

/* Position and derivatives by q at q from the element's begin, and the place on the programmed path. */
double element_at(const Element *e, size_t axes, double q, int order, double x[][PLANNER_AXES]);

bool element_is_straight(const Element *e);

#endif

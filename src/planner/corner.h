/* Corners: curves that go on from one element to the next with the same direction and curvature. Inside the path. */
#ifndef FEEDSIM_PLANNER_CORNER_H
#define FEEDSIM_PLANNER_CORNER_H

#include "element.h"

/* The quintic that goes on from the elements with position and two derivatives by q, a leg L before and behind the
 * corner; cosine: of the angle there. s: places of its begin and end on the programmed path. */
void corner_curve(const Element *e1, const Element *e2, size_t axes, double L, double cosine, Curve *curve,
                  double s[2]);

/* The longest leg up to `longest` with which the corner stays within `tolerance`; jump: of the direction there. */
double corner_leg(const Element *e1, const Element *e2, size_t axes, double longest, double tolerance, double jump,
                  double cosine);

#endif

/* Errors between rotor, slide and tool that no force comes from: play of the drive, geometry of the guides.
 *
 *   hysteresis y = x - (h/2) e/w, e moved along with x within -w and w            stop operator, no dynamics
 *   play      y = x moved by less than b/2, or dragged along: |y - x| <= b/2        play operator, no dynamics
 *   tool, X   E_XX s_X + S_XY s_Y + S_XZ s_Z + E_XY(s_Y) + E_XZ(s_Z)
 *         Y   E_YY s_Y + S_YZ s_Z + E_YX(s_X) + E_YZ(s_Z)
 *         Z   E_ZZ s_Z + E_ZX(s_X) + E_ZY(s_Y)              E_ij(s) = a s^2 + b s^3
 *
 *   angles    E_Aj ... E_Cj of axis j, of s and s^2, times the arms r: + E_j x r
 *
 * s_A: way of the slide of axis A since the start, so that all errors are 0 there. Letters as in ISO 230-1:2012, first
 * the direction of the error, then the axis that moves. Pure functions, no FMI. */
#ifndef FEEDSIM_GEOMETRY_H
#define FEEDSIM_GEOMETRY_H

#include "prefix.h"

#define geometry_play PREFIXED(geometry_play)
#define geometry_hysteresis PREFIXED(geometry_hysteresis)
#define geometry_arms PREFIXED(geometry_arms)
#define geometry_errors PREFIXED(geometry_errors)
#define geometry_slopes PREFIXED(geometry_slopes)

typedef struct Geometry {
    double linear[3][3];              /* [direction][axis]: positioning, squareness [1] */
    double second[3][3], third[3][3]; /* straightness [1/m], [1/m2] */
} Geometry;

/* Where a slide is that was at y when x was elsewhere; play b [m] >= 0. */
double geometry_play(double y, double x, double b);

/* The wind-up e [m] of a hysteresis of way w [m] > 0 that was e before x moved by dx. */
double geometry_hysteresis(double e, double dx, double w);

/* Add to p what angles of axis j make by the arms r[3] [m]: angle[3] about X, Y, Z, of the way [1/m] and its square
 * [1/m2]. */
void geometry_arms(Geometry *p, int j, const double *first, const double *second, const double *r);

/* error[3] [m] at s[3] [m]. */
void geometry_errors(const Geometry *p, const double *s, double *error);

/* Its rate, slope[3] [m/s], at s[3] with speeds v[3]. */
void geometry_slopes(const Geometry *p, const double *s, const double *v, double *slope);

#endif

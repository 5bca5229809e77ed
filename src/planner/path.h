/* The path: rows of a program as lines, arcs and splines, with corners between them, cut into zones with their limits.
 */
#ifndef FEEDSIM_PLANNER_PATH_H
#define FEEDSIM_PLANNER_PATH_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "planner.h"

/* x(u) = p[0] + p[1] u + .. + p[degree] u^degree + a cos(w u) + b sin(w u) over u in 0..1, w = 0 without an arc; the
 * path's parameter is q = c u. */
typedef struct Curve {
    int degree;
    double c, w;
    double p[6][PLANNER_AXES];
    double a[PLANNER_AXES], b[PLANNER_AXES];
} Curve;

/* Values and derivatives by u of orders 0 to `order` (at most 5). */
void curve_at(const Curve *curve, size_t axes, double u, int order, double x[][PLANNER_AXES]);

typedef enum ZoneKind { ZONE_ELEMENT, ZONE_CORNER, ZONE_VERTEX } ZoneKind;

/* Speeds dq/dt that a zone permits, and of each the axis that it is for (-1: the path). Those of acceleration and jerk
 * are to be multiplied by the root and the cubic root of the share. */
typedef enum Bound { BOUND_FEED, BOUND_SPEED, BOUND_ACCELERATION, BOUND_JERK, BOUND_STEP, BOUND_COUNT } Bound;

typedef struct Zone {
    Curve curve;
    double u0, u1;        /* the part of the curve */
    double q;             /* where it begins, in the window */
    double length;        /* c (u1 - u0) */
    double s0, s1;        /* place on the programmed path at u0 and u1 */
    double s_vertex;      /* of the corner that is rounded, which is passed in the middle */
    int64_t row, row_end; /* before and behind the middle of a corner; else the same */
    ZoneKind kind;
    int64_t element;  /* row that a builder begins with to make this zone again.. */
    double element_s; /* ..at this place on the programmed path.. */
    int64_t index;    /* ..as this piece of the element, or the corner behind them */
    bool restarts;    /* it is then the same, though the corner ahead of the element is not made again */
    double V[BOUND_COUNT];
    int8_t V_axis[BOUND_COUNT];
    double strays;         /* largest distance of a piece of a spline from the programmed path */
    double a_path, j_path; /* limits on the second and third derivative of q by time that are for the path */
    size_t intervals;      /* 0: straight, a_line and j_line say all */
    size_t derivatives;    /* where its [intervals][3][axes] largest derivatives by q stand */
    double a_line, j_line;
    int8_t a_axis, j_axis;
} Zone;

/* Zones of a stretch as far as they are made; derivatives of all. */
typedef struct Zones {
    Zone *zone;
    size_t count, room;
    double *derivatives;
    size_t used, derivatives_room;
    int64_t skipped, skipped_pieces; /* the first pieces of this element are left out.. */
    size_t enough;                   /* ..and those beyond so many zones; 0: none */
} Zones;

/* A line, an arc or a spline: its pieces in order, zones without limits. */
typedef struct Element {
    Zone *piece;
    size_t count, room;
    double length;
    int64_t row, last; /* first and last row */
    double s, behind;  /* place of its begin and end on the programmed path */
    double trim;       /* how much the corner at its begin takes */
} Element;

/* A row that a spline follows. */
typedef struct Side {
    int64_t row;
    double length, programmed; /* over all axes, and as the place on the programmed path counts */
    double turn;               /* from the side before */
    size_t parts;
} Side;

/* Makes zones, one element with the corner behind it at a time. */
typedef struct Builder {
    const Program *program;
    Element element, next;
    double s;        /* behind `element` */
    int64_t row;     /* the next one to be read */
    double *scratch; /* of splines */
    Side *side;
    size_t scratch_room, side_room;
} Builder;

void builder_free(Builder *builder);
void zones_free(Zones *zones);

/* Begin at a row that moves, which the motion begins from rest (or is taken to), at s [m] on the programmed path. */
bool builder_begin(Builder *builder, int64_t row, double s);

/* Append the zones of the next element and of the corner behind it. *stops: the motion rests there, builder->row is
 * the next row. False without memory. */
bool builder_next(Builder *builder, Zones *zones, bool *stops);

/* Append the zones of the element that is the next one to be appended, as if there were stops at both of its ends. */
bool builder_alone(Builder *builder, Zones *zones);

/* The row at the place s of a corner, and where it ends; a corner may take in several rows of a spline. */
int64_t row_in_corner(const Program *program, const Zone *corner, double s, double *end);

/* The first row from `row` on that moves or dwells; program->rows without one. */
int64_t next_row(const Program *program, int64_t row);

#endif

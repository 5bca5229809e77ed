/* Zones -> speed along the path: the least limits of the zones around, steps of acceleration within them, a mean over
 * T. */
#ifndef FEEDSIM_PLANNER_SPEED_H
#define FEEDSIM_PLANNER_SPEED_H

#include "path.h"

/* Ahead of the filter the parameter s of the path moves at constant acceleration a from t on; S, in two parts of which
 * the first rounds the sum, is the integral of s. */
typedef struct Phase {
    double t, s, v, a;
    double S, S_rest;
} Phase;

/* Between two ends of widened zones: the least V^2 and A and whose they are; w: the largest v^2 at its begin. */
typedef struct Cell {
    double q, V2, A, w;
    int32_t V_zone, A_zone;
} Cell;

typedef struct Node {
    double s, w, a; /* w = v^2; a from here on */
} Node;

typedef struct End {
    double q;
    int32_t zone;
} End;

/* A stretch of zones with what is at its ends: speed 0, or that of the zone whose middle it begins or ends in. */
typedef struct Stretch {
    const Program *program;
    const Zone *zone;
    const double *derivatives;
    size_t count;
    double q0, q1;   /* its ends */
    double v0, v1;   /* speeds there; 0: rest */
    double T, share; /* filter time [s], 0: none; share of acceleration and jerk for the curvature */
    bool soft;       /* jerk is limited */
} Stretch;

/* Memory for planning a stretch, and what comes out: phases of the motion ahead of the filter. */
typedef struct Speed {
    double *V, *A;
    End *starts, *ends, *spare;
    int32_t *heap_V, *heap_A;
    Cell *cell;
    Node *node;
    Phase *phase;
    size_t room, cells, nodes, phases;
    double before, behind; /* how much the filter makes longer at either end: T/2 at rest, else 0 [s] */
    double T, v0, v1, q0, q1, unfiltered, duration;
} Speed;

void speed_free(Speed *speed);

/* Plan a stretch. Returns 1 where it holds; 0 where it does not keep the speeds at its ends for T/2; -1 without memory.
 */
int plan_speed(const Stretch *stretch, Speed *speed);

/* Largest V of a zone at the stretch's T and share, and the bound that says so. */
double zone_speed(const Stretch *stretch, const Zone *zone, Bound *bound);

/* Largest A of a zone at the speed V; *kind: 3 acceleration, 4 jerk; *axis, -1 for the path. */
double zone_acceleration(const Stretch *stretch, const Zone *zone, double V, int *kind, int *axis);

/* q and its derivatives by time at t from the begin of the motion; hint: a phase nearby, for each end of the window. */
void motion_at(const Speed *speed, double t, size_t hint[2], double q[4]);

/* When the motion comes to q. */
double time_at(const Speed *speed, double q, size_t hint[2]);

#endif

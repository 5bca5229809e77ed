/* What the control adds to its position setpoint to make up for errors of the machine, at the instants of T_pos.
 *
 *   x_s + s b/2 + table(x_s)
 *
 * b    backlash compensation (SINUMERIK: MD32450 BACKLASH), s = +1 or -1 with the direction in which x_s last moved; on
 *      a reversal (reversal.h) s runs linearly over the ramp; 0 until x_s moves for the first time
 * table  leadscrew error compensation over x_s; a second one serves the negative direction, blended by s
 *
 * Both are what is added, so that they take off an error of the opposite sign. Pure functions, no FMI. */
#ifndef FEEDSIM_CORRECTIONS_H
#define FEEDSIM_CORRECTIONS_H

#include <stdbool.h>
#include <stdint.h>

#include "points.h"
#include "prefix.h"
#include "reversal.h"

#define corrections_step PREFIXED(corrections_step)

typedef struct Corrections {
    bool used;
    double resolution; /* of a reversal [m] */
    double backlash;   /* b [m] */
    double change;     /* of s in T_pos, 2 T_pos / ramp; 2 without a ramp [1] */
    Points leadscrew, leadscrew_minus;
} Corrections;

typedef struct CorrectionsState {
    double x_s; /* at the last instant [m] */
    ReversalState reversal;
    double s;
    int64_t started; /* 0 or not */
} CorrectionsState;

/* One position instant: x_s [m] with what is added. */
double corrections_step(const Corrections *p, CorrectionsState *x, double x_s);

#endif

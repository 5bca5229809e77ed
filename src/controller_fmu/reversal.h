/* Where a setpoint turns back: what the control's compensations at reversals go by, at the instants of T_pos.
 *
 * A setpoint reverses where it has come back by more than the control's resolution from the furthest point of its
 * motion. A shorter way is none: splines overshoot the end of a motion by some 0.014 times jerk times the cube of the
 * interpolation cycle, to and fro. Pure functions, no FMI. */
#ifndef FEEDSIM_REVERSAL_H
#define FEEDSIM_REVERSAL_H

#include <stdint.h>

#include "prefix.h"

#define reversal_step PREFIXED(reversal_step)

/* All zero is a setpoint that has not moved yet. */
typedef struct ReversalState {
    double direction; /* of the motion: -1, 0, 1 */
    double back;      /* way back from the furthest point; ahead of the first motion, the way with its sign [m] */
    int64_t samples;  /* since the setpoint began to go back without a pause, this one included */
} ReversalState;

/* One position instant, the setpoint `way` [m] further than at the last one. Where it has reversed: the way back from
 * the furthest point [m]; else 0. */
double reversal_step(ReversalState *x, double resolution, double way);

#endif

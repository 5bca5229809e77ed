/* A rigid axis under a given motor torque, held back by its friction: what a recorded torque would have moved, had it
 * met the model. For fits in open loop; the coupling is that of the master's default scheme.
 *
 *   J dn/dt = M_a - M_0 - M_fr,   M_a held from one instant to the next
 *
 * Over a step M_fr goes on with the slope that it had in the last one; the speed is then known at both ends, and the
 * contact follows it. Second order in h/substeps, jumps of M_a from interval to interval included. Explicit: stable
 * while (sigma_1 + sigma_2) h/substeps is well below J and sigma_0 (h/substeps)^2 too. Keeps nothing between calls. */
#ifndef FEEDSIM_FREE_AXIS_H
#define FEEDSIM_FREE_AXIS_H

#include <stddef.h>

#include "prefix.h"
#include "response.h"

#define free_axis PREFIXED(free_axis) /* friction_free_axis */

/* Angle and speed at the instants 0 .. steps, h [s] apart.
 *
 *   parameters    every parameter of the unit, in the order of variables.def
 *   J, M_0        inertia [kg.m^2], > 0; constant load against the motor torque [N.m]
 *   M_a           (steps) motor torque [N.m], each held over its interval
 *   substeps      >= 1 equal steps from one instant to the next
 *   n, z          speed [rad/s] and bristle deflection [rad] at the first instant; the angle begins at 0, c at 0
 *   angle, speed  (steps + 1) [rad], [rad/s]; speed may be NULL
 *
 * Returns how many instants were written: steps + 1 where it went well; fewer where angle or speed is no finite number
 * at the next one; 0, besides, where the parameters are refused as the unit refuses them, where J or h is not finite
 * and above 0, or where substeps is 0. */
RESPONSE_EXPORT size_t free_axis(const double parameters[], double J, double M_0, const double M_a[], size_t steps,
                                 double h, size_t substeps, double n, double z, double angle[], double speed[]);

#endif

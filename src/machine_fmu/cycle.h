/* A control cycle, as data: how plant and friction may see each other (SCHEMES), and what is done in which order.
 *
 * Two programs read these rows: the unit machine, on its parts (exchange.c), and the master, on units of their own
 * (feedsim/simulation/cosim/schedule.py). Both do the same arithmetic in the same order, and so give the same bits. The
 * packager takes the rows as text (feedsim_packager/cycle.py): plain words, a row a line. */
#ifndef FEEDSIM_CYCLE_H
#define FEEDSIM_CYCLE_H

/* The controllers sample at t_k and run first; they add no error. The stiff bond is plant <-> friction. Columns:
 *
 *   number, name     as the parameter coupling.scheme and as scenarios have it
 *   stable_share     of 2 J_inf/h that the friction's slope sigma_1 + sigma_2 may reach; docs/theory.md derives it
 *   speed            friction: n_fr linear `within` the step, at its `end` or its `start`, or `extrapolated`
 *   torque_ramp      plant: M_a runs linearly over the control cycle; else M_a(t_k) is constant
 *   friction_ramp    plant: M_fr is extrapolated with the slope of its last step; else constant
 *   passes           2: plant and friction go back and take the step again, with the slope of M_fr of the first pass
 *   friction_first   friction steps ahead of the plant, which takes the resulting torque as constant */
#define LAST_SCHEME 6
#define SCHEMES(ROW)                                                                                                   \
    ROW(0, extrapolated, 0.25, within, true, true, 1, false)                                                           \
    ROW(1, iterated, 0.5, within, true, true, 2, false)                                                                \
    ROW(2, gauss_seidel, 0.5, end, true, false, 1, false)                                                              \
    ROW(3, gauss_seidel_friction_first, 0.5, start, true, false, 1, true)                                              \
    ROW(4, jacobi, 0.25, start, true, false, 1, false)                                                                 \
    ROW(5, jacobi_extrapolated, 0.1, extrapolated, true, true, 1, false)                                               \
    ROW(6, parallel, 0.25, start, false, false, 1, false)

/* Rows of a cycle: when (always, or for which schemes), what, on which vectors with an entry per axis.
 *
 *   copy(y, a)         y = a
 *   line(y, a, s, b)   y = a + s b
 *   rate(y, a, b, s)   y = (a - b) / s
 *   call(what)         drives, plant, friction step; states of plant and friction are kept or restored
 *
 *   M_a_start, M_a_end      motor torque at the ends of the control cycle, M_a_slope in between
 *   M_a_before              M_a_end of the cycle before
 *   M_a                     motor torque at the start of the exchange step
 *   M_fr                    friction torque at the start of the exchange step; M_fr_start: kept for a second pass
 *   n_start, n_end          speed at the friction contact at the ends of the exchange step
 *   n, n_slope              what friction is given of it; n_slope_last: slope over the step before
 *   h, since                length of the exchange step, its start after that of the cycle [s] */

/* From the end backwards: a drive whose torque jumps at t_k then acts as it does, without a cycle's delay. */
#define CYCLE_BEGINS(ROW)                                                                                              \
    ROW(always, call, drives)                                                                                          \
    ROW(torque_ramps, line, M_a_start, M_a_end, back_a_cycle, M_a_slope)                                               \
    ROW(torque_constant, copy, M_a_start, M_a_before)                                                                  \
    ROW(torque_constant, copy, M_a_before, M_a_end)

#define EXCHANGE_BEGINS(ROW)                                                                                           \
    ROW(always, line, M_a, M_a_start, since, M_a_slope)                                                                \
    ROW(always, copy, n_start, n_end)                                                                                  \
    ROW(two_passes, copy, M_fr_start, M_fr)                                                                            \
    ROW(two_passes, call, keep)

#define EXCHANGE_PASS(ROW)                                                                                             \
    ROW(second_pass, call, restore)                                                                                    \
    ROW(second_pass, copy, M_fr, M_fr_start)                                                                           \
    ROW(plant_first, call, plant)                                                                                      \
    ROW(always, call, speed)                                                                                           \
    ROW(always, call, friction)                                                                                        \
    ROW(friction_first, call, plant)

/* call(speed): what friction is given of the speed at its contact. */
#define SPEED_GIVEN(ROW)                                                                                               \
    ROW(speed_end, copy, n, n_end)                                                                                     \
    ROW(speed_start, copy, n, n_start)                                                                                 \
    ROW(speed_within, copy, n, n_start)                                                                                \
    ROW(speed_within, rate, n_slope, n_end, n_start, h)                                                                \
    ROW(speed_extrapolated, copy, n, n_start)                                                                          \
    ROW(speed_extrapolated, copy, n_slope, n_slope_last)                                                               \
    ROW(speed_extrapolated, rate, n_slope_last, n_end, n_start, h)

#endif

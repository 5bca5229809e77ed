/* The circle by the same algorithm without FMI: the units' model functions, linked together and called directly on what
 * the FMI units hold (coefficients, initial state), every exchange a plain assignment. What the FMI and the master cost
 * is measured against it; other instructions for the same arithmetic, as AVX2's, would make both faster. One room per
 * unit, since each unit's headers speak in its own names. */
#ifndef FEEDSIM_FLOOR_H
#define FEEDSIM_FLOOR_H

#include <stddef.h>

/* Each takes the address of an initialised FMI instance whose library was built from the same sources. */

/* Numbers that a controller, a friction unit and, per axis and in all, the plant leave in a row. */
#define CONTROLLER_ROW 11
#define FRICTION_ROW 5
#define PLANT_AXIS_ROW 2
#define PLANT_TOOL_ROW 6

/* Work one instant with x_s, n_ffw, x_a, n_a; M_a at the end of the cycle and its slope. */
void controller_floor_cycle(void *unit, const double setpoint[2], const double measured[2], double *M_a, double *slope);
void controller_floor_record(void *unit, double row[CONTROLLER_ROW]);

/* Where the plant's q and behind it v are, and where those at the end of a step go; the two change places. */
typedef struct PlantMotion {
    double *now, *next;
} PlantMotion;

void plant_floor_prepare(void *unit, double h, PlantMotion *motion);
/* Torques M_a and M_fr at the start of a step of h and their slopes; speeds n[axes] at its end. */
void plant_floor_step(void *unit, PlantMotion *motion, const double *M_a, const double *M_a_slope, const double *M_fr,
                      const double *M_fr_slope, double h, double *n);
/* x_a and n_a of every axis, where the speeds are n */
void plant_floor_measure(void *unit, const PlantMotion *motion, const double *n, double *x_a_n_a);
void plant_floor_record(void *unit, const PlantMotion *motion, const double *x_a_n_a, double *row);

/* From n_start to n_end over h; the torque at the end. */
double friction_floor_step(void *unit, double n_start, double n_end, double h);
double friction_floor_torque(void *unit);
void friction_floor_record(void *unit, double row[FRICTION_ROW]);

#endif

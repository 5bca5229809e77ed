/* The speed that the speed controller sees: the motor's, or the difference of the measured position over a window.
 *
 *   n = n_a                                                        window 0
 *   n = (x_a(t_k) - x_a(t_k - N T_c)) / (N T_c I_P)                window of N control cycles
 *
 * The difference is the mean speed of the window, N T_c/2 late. It is what a drive without a motor encoder has. Ahead
 * of the first instant the axis stood. No FMI. */
#ifndef FEEDSIM_MEASURED_SPEED_H
#define FEEDSIM_MEASURED_SPEED_H

#include <stdint.h>

#include "delay.h"
#include "prefix.h"

#define measured_speed_of PREFIXED(measured_speed_of)
#define measured_speed_start PREFIXED(measured_speed_start)
#define measured_speed_step PREFIXED(measured_speed_step)

typedef struct MeasuredSpeed {
    Delay window;        /* of N cycles; its ring holds x_a [m] */
    double per_distance; /* 1/(N T_c I_P) [rad/(s.m)]; 0: take n_a */
} MeasuredSpeed;

/* window N >= 0 [control cycles], cycle T_c [s], lead I_P [m/rad]. */
MeasuredSpeed measured_speed_of(int window, double T_c, double I_P);

/* Make the past: the axis stood at x_a [m]. */
void measured_speed_start(const MeasuredSpeed *p, int32_t *newest, double *ring, double x_a);

/* One instant: position [m] and motor speed [rad/s] -> the speed to control [rad/s]. */
double measured_speed_step(const MeasuredSpeed *p, int32_t *newest, double *ring, double x_a, double n_a);

#endif

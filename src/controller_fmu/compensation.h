/* Friction compensations as controls have them, at the instants of T_pos; n is the speed feedforward n_ffw.
 *
 * Pulse on the speed setpoint (SINUMERIK: MD32500 to MD32570). Where n changes its sign, at a reversal (reversal.h),
 * and T_dyn + delay later,
 *
 *   n_pulse = sign(n) dn/I_P exp(-t/T)
 *
 *   dn = amplitude                                        without adaptation
 *   dn = amplitude a/a_1                                  a < a_1, with the acceleration a = |n_k - n_k-1| I_P/T_pos
 *   dn = amplitude                                        a_1 <= a <= a_2
 *   dn = amplitude + (min - amplitude)(a - a_2)/(a_3 - a_2)   a_2 < a < a_3
 *   dn = min                                              a >= a_3
 *
 * A new pulse takes the place of what is left of the one before. Source: SINUMERIK, Extended Functions, K3.
 *
 * Torque over the commanded speed (TwinCAT CNC: P-COMP-00041 to 00047), added to the torque setpoint:
 *
 *   M = s table(|n| I_P) min(1, x/distance),   n of T_dyn + T_sym + delay ago
 *
 * s is the direction of the motion, and at rest the last one; x the way since its reversal. Linear between the points,
 * held beyond.
 *
 * Of real controls the order within a cycle, the exact shape of the pulse and the instant are not public: the instant
 * is the setting `delay`. Pure functions, no FMI. */
#ifndef FEEDSIM_COMPENSATION_H
#define FEEDSIM_COMPENSATION_H

#include <stdbool.h>
#include <stdint.h>

#include "delay.h"
#include "prefix.h"
#include "reversal.h"

#define pulse_amplitude PREFIXED(pulse_amplitude)
#define pulse_step PREFIXED(pulse_step)
#define torque_table_value PREFIXED(torque_table_value)
#define torque_table_start PREFIXED(torque_table_start)
#define torque_table_step PREFIXED(torque_table_step)

#define TABLE_POINTS 8

typedef struct FrictionPulse {
    bool used, adaptation;
    double resolution;      /* of a reversal [m] */
    double I_P;             /* lead [m/rad] */
    double T_pos;           /* cycle [s] */
    double amplitude, min;  /* [m/s] */
    double acceleration[3]; /* a_1 <= a_2 <= a_3 [m/s^2] */
    double T;               /* time constant [s]; 0: one cycle long */
    double wait;            /* T_dyn + delay >= 0 [s] */
} FrictionPulse;

/* All zero is a drive that has not moved yet. */
typedef struct PulseState {
    double n; /* at the last instant [rad/s] */
    double a; /* acceleration at the first sample of the other sign [m/s^2] */
    ReversalState reversal;
    double value; /* of the pulse [rad/s] */
    double next;  /* size of the pulse that waits [rad/s]; 0: none */
    double wait;  /* until it begins [s] */
} PulseState;

typedef struct TorqueTable {
    int32_t points;    /* 0: none */
    double resolution; /* of a reversal [m] */
    double I_P, T_pos;
    double speed[TABLE_POINTS];  /* rising [m/s] */
    double torque[TABLE_POINTS]; /* [N.m] */
    double distance;             /* over which the torque is built up [m] */
    Delay delay;                 /* of n, over T_pos samples */
} TorqueTable;

typedef struct TorqueTableState {
    ReversalState reversal;
    double way; /* since the last reversal [m] */
    double M;   /* [N.m], at the last instant */
    int32_t newest;
} TorqueTableState;

/* Size dn [m/s] of the pulse of a reversal with the acceleration a [m/s^2]. */
double pulse_amplitude(const FrictionPulse *p, double a);

/* One position instant: n_ffw [rad/s] -> addition to the speed setpoint [rad/s]. */
double pulse_step(const FrictionPulse *p, PulseState *x, double n_ffw);

/* Torque [N.m] at a speed [m/s] >= 0. */
double torque_table_value(const TorqueTable *p, double speed);

/* The past before the first instant: at rest. The ring holds p->delay.length samples [rad/s]. */
void torque_table_start(const TorqueTable *p, TorqueTableState *x, double *ring);

/* One position instant: n_ffw [rad/s] -> x->M. */
void torque_table_step(const TorqueTable *p, TorqueTableState *x, double *ring, double n_ffw);

#endif

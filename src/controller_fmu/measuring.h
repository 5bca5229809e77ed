/* What the control measures instead of position and speed as they are.
 *
 *   directly    x = x_a, the scale                indirectly  x = x_a(0) + I_P (phi + e sin(phi + psi)), the motor's
 * encoder x_m  = x + E(x) - E(x(0)),  E = eps x + sum a_j sin(2 pi x/p_j + psi_j) + table(x) x_m  with noise, to whole
 * steps of the resolution n_m  = n_a (1 + e cos(phi + psi))             an eccentric encoder of the motor
 *
 * phi: integral of n_a as in orders.h, from the first instant on. The control takes its place at the first instant for
 * right, as a machine that was referenced there; so errors are 0 where the axis starts. The noise has mean 0 and the
 * standard deviation given: the sum of four even 16-bit numbers (within 3.46 standard deviations), a hash (splitmix64)
 * of seed and number of the instant alone, so that every importer and platform finds the same. Pure functions, no FMI.
 */
#ifndef FEEDSIM_MEASURING_H
#define FEEDSIM_MEASURING_H

#include <stdbool.h>
#include <stdint.h>

#include "points.h"
#include "prefix.h"

#define measuring_add PREFIXED(measuring_add)
#define measuring_step PREFIXED(measuring_step)
#define noise_of_instant PREFIXED(noise_of_instant)

enum { PERIODIC_ERRORS = 3 };

typedef struct PeriodicError {
    double wave_number; /* 2 pi / period [1/m] */
    double amplitude;   /* [m] */
    double phase;       /* [rad] */
} PeriodicError;

typedef struct Measuring {
    bool used;
    bool indirect;
    double T_c, I_P;
    double linear;     /* eps [1] */
    double resolution; /* [m]; 0: none */
    double noise;      /* standard deviation [m] */
    uint64_t seed;
    double eccentricity, eccentric_phase; /* e, psi [rad] */
    int32_t periodic_errors;
    PeriodicError periodic[PERIODIC_ERRORS];
    Points table;
} Measuring;

typedef struct MeasuringState {
    double phi;      /* of the encoder, within a turn [rad] */
    double x_motor;  /* I_P times the angle turned since the first instant, and x_a there [m] */
    double n;        /* speed at the last instant [rad/s] */
    double offset;   /* E at the first instant [m] */
    int64_t started; /* 0 or not */
} MeasuringState;

/* Enter a periodic error; one whose amplitude is 0 is left out. */
void measuring_add(Measuring *p, double period, double amplitude, double phase);

/* Instant number `instant` with x_a [m] and n_a [rad/s]: both as they are measured, in their place. */
void measuring_step(const Measuring *p, MeasuringState *x, int64_t instant, double *x_a, double *n_a);

/* Noise of an instant, standard deviation 1. */
double noise_of_instant(uint64_t seed, int64_t instant);

#endif

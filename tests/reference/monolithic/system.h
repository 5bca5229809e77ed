/* Continuous part of the monolithic reference: modes of the structure and friction of every axis, integrated together.
 */
#ifndef MONOLITHIC_SYSTEM_H
#define MONOLITHIC_SYSTEM_H

#define MAX_AXES 4
#define MAX_MODES 512
#define DIRECTIONS 3

/* LuGre model (Eqs. 1, 6, 7) with the engaging model (Eqs. 2-4), motor side: rad, rad/s, N.m */
typedef struct {
    double sigma_0, sigma_1, sigma_2, F_C, F_S, v_s, beta, F_log, v_log, asymmetry, W, gamma;
} Friction;

typedef struct {
    int axes, modes; /* modes: padded to whole vectors with zero columns */
    Friction friction[MAX_AXES];
    double M_0[MAX_AXES];
    double stiffness[MAX_MODES], damping[MAX_MODES]; /* omega^2 [1/s^2], 2 D omega [1/s]; mass-normalised */
    double n_port[MAX_AXES][MAX_MODES];              /* torque in, speed out */
    double x_port[MAX_AXES][MAX_MODES];              /* linear scale */
    double tcp_port[DIRECTIONS][MAX_MODES];
} System;

typedef struct {
    double q[MAX_MODES], v[MAX_MODES]; /* modal displacement and its derivative */
    double z[MAX_AXES], c[MAX_AXES];
} State;

double dot(const double *a, const double *b, int count);

/* Eq. 1 at the speed n; writes dz/dt where dz is not NULL. */
double friction_torque(const Friction *p, double n, double z, double c, double *dz);

/* One control cycle of length T with `steps` classical Runge-Kutta steps; the torques run linearly from M_begin to
 * M_end. */
void advance(const System *system, State *state, double T, int steps, const double *M_begin, const double *M_end);

#endif

/* Continuous part of the monolithic reference: modes of the structure and friction of every axis, integrated together.
 */
#ifndef MONOLITHIC_SYSTEM_H
#define MONOLITHIC_SYSTEM_H

#define MAX_AXES 4
#define MAX_MODES 512
#define DIRECTIONS 3
#define MAX_MOUNTS 24

/* LuGre model (Eqs. 1, 6, 7) with the engaging model (Eqs. 2-4), motor side: rad, rad/s, N.m */
typedef struct {
    double sigma_0, sigma_1, sigma_2, F_C, F_S, v_s, beta, F_log, v_log, asymmetry, W, gamma;
} Friction;

/* A direction of a mount. The modes hold the spring K_lin; K_e x + F_f + F_v acts in its place. F_f as a differential
 * equation, by Berg's law between two reversals: dF_f/dx = (F_max -+ F_f)^2/(x_2 F_max (1 -+ F_s/F_max)^2) for x rising
 * (-) or falling (+), F_s: F_f at the last reversal. F_v: dF_v/dt = K_v (dx/dt - F_v/c). */
typedef struct {
    double K_lin, K_e, F_max, x_2, K_v, c;
    double port[MAX_MODES];
} Mount;

/* Between a motor of inertia J and the structure, which holds J: C = c e + d de/dt, e the dead zone of +-half of the
 * angle of the motor less that of the structure. J = 0: none. */
typedef struct {
    double J, c, d, half;
} Contact;

typedef struct {
    int axes, modes; /* modes: padded to whole vectors with zero columns */
    Friction friction[MAX_AXES];
    Contact contact[MAX_AXES]; /* of one axis at most */
    double M_0[MAX_AXES];
    double stiffness[MAX_MODES], damping[MAX_MODES]; /* omega^2 [1/s^2], 2 D omega [1/s]; mass-normalised */
    double n_port[MAX_AXES][MAX_MODES];              /* torque in, speed out */
    double x_port[MAX_AXES][MAX_MODES];              /* linear scale */
    double tcp_port[DIRECTIONS][MAX_MODES];
    int mounts;
    Mount mount[MAX_MOUNTS];
} System;

typedef struct {
    double q[MAX_MODES], v[MAX_MODES]; /* modal displacement and its derivative */
    double z[MAX_AXES], c[MAX_AXES];
    double motor_n[MAX_AXES], delta[MAX_AXES]; /* of motors with a contact: speed, angle ahead of the structure */
    double F_f[MAX_MOUNTS], F_v[MAX_MOUNTS];
    double F_s[MAX_MOUNTS], side[MAX_MOUNTS]; /* of mounts: force at the last reversal, sign of the speed since */
    double E[MAX_MOUNTS];                     /* work done against K_e x + F_f + F_v */
} State;

/* Speed of a motor. */
double motor_speed(const System *system, const State *state, int axis);

double dot(const double *a, const double *b, int count);

/* Eq. 1 at the speed n; writes dz/dt where dz is not NULL. */
double friction_torque(const Friction *p, double n, double z, double c, double *dz);

/* One control cycle of length T with `steps` classical Runge-Kutta steps; the torques run linearly from M_begin to
 * M_end. */
void advance(const System *system, State *state, double T, int steps, const double *M_begin, const double *M_end);

#endif

/* The whole cascade of one axis: what happens at one sample instant t_k, in its order, with the motor.
 *
 *   position (every T_pos) -> ramp, + n_add -> reference model -> speed PI, + M_add, limit -> up to four filters
 *     -> current PI -> one T_c of computing delay -> motor, + cogging and ripple -> M_a(t_k+1)
 *
 * M_a is linear over the cycle from M_a(t_k) to M_a(t_k+1). With an ideal current loop the filtered torque setpoint of
 * t_k acts at once and is held over the cycle.
 *
 * Without release there is no torque: M_a runs to 0 within the cycle (at once with an ideal current loop), integrators,
 * filters and speed setpoint are 0. When the release comes, the drive begins as at its first instant, whatever it did
 * before: x_s is taken to have stood at its present value. The position controller works at that very instant, in place
 * of the last one of its grid, which then goes on; so a release that comes a few cycles into a position cycle leaves no
 * trace but those cycles. Positions for the speed from the scale are kept on, as an encoder does.
 *
 * Memory is the caller's and pointer-free: a DriveState, and behind it
 * p->samples doubles for the delay lines. No FMI, no time: the caller counts the instants. */
#ifndef FEEDSIM_DRIVE_H
#define FEEDSIM_DRIVE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "biquad.h"
#include "compensation.h"
#include "corrections.h"
#include "current.h"
#include "measured_speed.h"
#include "measuring.h"
#include "orders.h"
#include "pmsm.h"
#include "position.h"
#include "prefix.h"
#include "reference_model.h"
#include "setpoint_ramp.h"
#include "speed.h"

#define drive_layout PREFIXED(drive_layout)
#define drive_instant PREFIXED(drive_instant)
#define drive_measured PREFIXED(drive_measured)

#define FILTERS 4

typedef struct Drive {
    double T_c;    /* cycle [s] */
    int32_t ticks; /* N = T_pos/T_c */
    Position position;
    SetpointRamp ramp;
    ReferenceModel reference_model;
    MeasuredSpeed measured_speed;
    SpeedController speed;
    int32_t filters; /* how many of the following are in use */
    Biquad filter[FILTERS];
    bool ideal_current_loop;
    double K_t; /* [N.m/A] */
    CurrentController current;
    Pmsm motor;
    Orders orders;           /* cogging and torque ripple of the motor */
    Measuring measuring;     /* what it reads instead of x_a and n_a */
    Corrections corrections; /* what it adds to x_s */
    FrictionPulse pulse;     /* what it adds to the speed setpoint at reversals */
    TorqueTable table;       /* what it adds to the torque setpoint */
    /* Where the delay lines begin among the `samples` doubles; filled in by drive_layout(). */
    size_t x_ring, n_ring, reference_ring, speed_ring, table_ring, samples;
} Drive;

typedef struct DriveInputs {
    double x_s;   /* position setpoint [m] */
    double n_ffw; /* speed feedforward [rad/s] */
    double x_a;   /* measured position [m] */
    double n_a;   /* measured motor speed [rad/s] */
    double n_add; /* excitation on the speed setpoint [rad/s] */
    double M_add; /* excitation on the torque setpoint [N.m] */
    bool release; /* controller enable */
} DriveInputs;

/* What holds at one end of a cycle. */
typedef struct DriveEnd {
    double M_a; /* [N.m] */
    PmsmState i;
} DriveEnd;

/* All zero is a drive at rest before its first instant. */
typedef struct DriveState {
    int64_t instant;   /* k of the next instant */
    int64_t tick;      /* of the next instant, within its position cycle */
    DriveEnd left;     /* at the beginning of the cycle that the last instant opened */
    DriveEnd right;    /* at its end */
    double u_d, u_q;   /* voltage during that cycle [V] */
    double n_s, n_ref; /* [rad/s], at the last instant */
    double M_s;        /* [N.m], at the last instant */
    PositionState position;
    SetpointRampState ramp;
    ReferenceModelState reference_model;
    int32_t speed_newest; /* of the positions that the speed is formed from */
    SpeedState speed;
    BiquadState filter[FILTERS];
    CurrentState current;
    int released; /* at the last instant; 0 or not, see speed.h */
    int measured; /* positions are kept for the speed: since the first release; 0 or not */
    OrdersState orders;
    MeasuringState measuring;
    CorrectionsState corrections;
    PulseState pulse;
    TorqueTableState table;
} DriveState;

/* Place the delay lines of a Drive whose blocks are filled in. */
void drive_layout(Drive *p);

/* Work the instant x->instant with the inputs of that time: opens the cycle [t_k, t_k+1] and computes its end. */
void drive_instant(const Drive *p, DriveState *x, double *lines, const DriveInputs *in);

/* The position [m] that the next instant measures, with x_a [m] and n_a [rad/s] there. */
double drive_measured(const Drive *p, const DriveState *x, double x_a, double n_a);

#endif

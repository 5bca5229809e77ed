/* A structure as a sum of modes, advanced exactly for inputs that are linear in time over the step.
 *
 *   q'' + 2 zeta omega q' + omega^2 q = f,   f = sum over ports of b u        per mode, mass-normalised
 *   at a port: displacement = sum over modes of b q, speed = sum over modes of b v, v = q'
 *
 * One step of a mode, with f at its start and df, the change of f over it:
 *   q+ = q_q q + q_v v + q_f f + q_df df
 *   v+ = v_q q + v_v v + v_f f + v_df df
 * These are the first-order-hold equivalents of the mode: no discretisation error and no stability limit for any step,
 * any damping ratio and for rigid modes (omega = 0).
 *
 * Modes are stored as a structure of arrays, padded with all-zero modes to a multiple of MODAL_LANES, and sums run in
 * that many partial sums, so that compilers vectorise without reordering arithmetic: every platform adds in the same
 * order. A step's coefficients lie in the order in which it needs them: twelve arrays side by side would take more
 * pointers than a processor has registers. Pure functions; the memory is the caller's. */
#ifndef FEEDSIM_MODAL_H
#define FEEDSIM_MODAL_H

#include <stdbool.h>
#include <stddef.h>

#include "prefix.h"

#define mode_update PREFIXED(mode_update)
#define modal_padded PREFIXED(modal_padded)
#define modal_memory PREFIXED(modal_memory)
#define modal_place PREFIXED(modal_place)
#define modal_set_mode PREFIXED(modal_set_mode)
#define modal_prepare PREFIXED(modal_prepare)
#define modal_advance PREFIXED(modal_advance)
#define modal_advance_held PREFIXED(modal_advance_held)
#define modal_advance_at PREFIXED(modal_advance_at)
#define modal_forecast PREFIXED(modal_forecast)
#define modal_foretold PREFIXED(modal_foretold)
#define modal_force PREFIXED(modal_force)
#define modal_sum PREFIXED(modal_sum)
#define modal_sums PREFIXED(modal_sums)
#define modal_acceleration PREFIXED(modal_acceleration)
#define modal_kinetic_energy PREFIXED(modal_kinetic_energy)
#define modal_elastic_energy PREFIXED(modal_elastic_energy)

#define MODAL_LANES 4

typedef struct ModeUpdate {
    double q_q, q_v, q_f, q_df;
    double v_q, v_v, v_f, v_df;
} ModeUpdate;

/* Coefficients of one mode for step h [s] > 0: omega [rad/s] >= 0, damping ratio zeta [1] >= 0 (1 and above allowed).
 */
ModeUpdate mode_update(double omega, double zeta, double h);

typedef struct Modal {
    size_t size; /* modes, padded */
    size_t ports;
    double h;             /* step that the coefficients below belong to; 0: none yet */
    double *omega, *zeta; /* [size] */
    double *update;       /* [size / MODAL_LANES][8][MODAL_LANES]: q_q, q_v, q_f, q_df, v_q, v_v, v_f, v_df */
    double *shape;        /* [ports][size]: mode shapes, inputs first */
} Modal;

/* `modes` rounded up to a multiple of MODAL_LANES. */
size_t modal_padded(size_t modes);

/* Number of doubles that modal_place() lays out. */
size_t modal_memory(size_t modes, size_t ports);

/* Lay the arrays out in zeroed memory. */
void modal_place(Modal *modal, double *memory, size_t modes, size_t ports);

/* Enter mode `mode` with its shape at the ports, shape[ports]. */
void modal_set_mode(Modal *modal, size_t mode, double omega, double zeta, const double *shape);

/* Coefficients for step h; computed anew whenever h is another number than last time, so that results depend on nothing
 * but h. No allocation. */
void modal_prepare(Modal *modal, double h);

/* From (q, v) to (q_end, v_end), all [size] and not overlapping, with inputs u[inputs] at the first `inputs` ports at
 * the start of the step and their change du[inputs] over it. */
void modal_advance(const Modal *modal, size_t inputs, const double *u, const double *du, const double *q,
                   const double *v, double *q_end, double *v_end);

/* The same with modal forces held[size] besides, which stay over the step. */
void modal_advance_held(const Modal *modal, size_t inputs, const double *u, const double *du, const double *held,
                        const double *q, const double *v, double *q_end, double *v_end);

/* The same with the inputs at any ports: shapes[inputs] of these, modal->shape + port * modal->size; held: modal forces
 * besides, or NULL. */
void modal_advance_at(const Modal *modal, size_t inputs, const double *const *shapes, const double *u, const double *du,
                      const double *held, const double *q, const double *v, double *q_end, double *v_end);

/* What a port shows at the end of a step, its displacement or its speed, without the step itself:
 *   y+ = sum over modes of (by_q q + by_v v) + sum over ports of (held u + ramp du) */
typedef struct Forecast {
    double *q, *v;       /* by_q, by_v [size] */
    double *f;           /* by modal forces that are held [size] */
    double *held, *ramp; /* [ports] */
} Forecast;

/* The forecast for the step that modal_prepare() has been called with. */
void modal_forecast(const Modal *modal, size_t port, bool speed, Forecast *forecast);

/* The sum over modes of it. */
double modal_foretold(const Forecast *forecast, size_t size, const double *q, const double *v);

/* Modal forces f[size] of forces u[ports] at all ports. */
void modal_force(const Modal *modal, const double *u, double *f);

/* Displacement at a port from q; with v in place of q the speed there. */
double modal_sum(const Modal *modal, size_t port, const double *q);

/* The same, to the bit, at `count` ports from `port` on: y[count]. */
void modal_sums(const Modal *modal, size_t port, size_t count, const double *q, double *y);

/* Acceleration at a port under inputs u[inputs] at the first `inputs` ports. */
double modal_acceleration(const Modal *modal, size_t port, size_t inputs, const double *u, const double *q,
                          const double *v);

/* [J] */
double modal_kinetic_energy(const Modal *modal, const double *v);
double modal_elastic_energy(const Modal *modal, const double *q);

#endif

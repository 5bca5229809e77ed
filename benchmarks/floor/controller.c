#include "drive.h"
#include "floor.h"
#include "shell.h"

typedef struct State { /* as in src/controller_fmu/model.c */
    DriveState drive;
    double lines[];
} State;

static State *state_of(void *unit) {
    const Unit *u = unit;
    return (void *)(u->block + u->state_at);
}

void controller_floor_cycle(void *unit, const double setpoint[2], const double measured[2], double *M_a,
                            double *slope) {
    const Drive *p = ((Unit *)unit)->derived;
    State *state = state_of(unit);
    const DriveInputs in = {.x_s = setpoint[0],
                            .n_ffw = setpoint[1],
                            .x_a = measured[0],
                            .n_a = measured[1],
                            .n_add = 0,
                            .M_add = 0,
                            .release = 1};
    drive_instant(p, &state->drive, state->lines, &in);
    *M_a = state->drive.right.M_a;
    *slope = (state->drive.right.M_a - state->drive.left.M_a) / p->T_c;
}

void controller_floor_record(void *unit, double row[CONTROLLER_ROW]) {
    const DriveState *x = &state_of(unit)->drive;
    row[0] = x->right.M_a;
    row[1] = x->position.x_e;
    row[2] = x->n_s;
    row[3] = x->n_ref;
    row[4] = x->M_s;
    row[5] = x->right.i.i_d;
    row[6] = x->right.i.i_q;
    row[7] = x->u_d;
    row[8] = x->u_q;
    row[9] = x->speed.limited;
    row[10] = x->current.limited;
}

#include "contact.h"
#include "floor.h"
#include "parameters.h"
#include "shell.h"

typedef struct State { /* as in src/friction_fmu/model.c */
    ContactState contact;
    double n;
    double M_fr_slope;
} State;

static State *state_of(void *unit) {
    const Unit *u = unit;
    return (void *)(u->block + u->state_at);
}

static const Scalars *scalars_of(void *unit) {
    return (const void *)(((Unit *)unit)->block + SCALARS_AT);
}

double friction_floor_step(void *unit, double n_start, double n_end, double h) {
    State *state = state_of(unit);
    const Contact p = parameters_contact(scalars_of(unit));
    state->contact = contact_advance(&p, state->contact, n_start, n_end, h);
    state->n = n_end;
    return contact_torque(&p, state->contact, n_end, NULL);
}

double friction_floor_torque(void *unit) {
    const State *state = state_of(unit);
    const Contact p = parameters_contact(scalars_of(unit));
    return contact_torque(&p, state->contact, state->n, NULL);
}

void friction_floor_record(void *unit, double row[FRICTION_ROW]) {
    const State *state = state_of(unit);
    const Contact p = parameters_contact(scalars_of(unit));
    row[0] = contact_torque(&p, state->contact, state->n, &row[3]);
    row[1] = state->contact.z;
    row[2] = state->contact.c;
    row[4] = contact_engagement(&p, state->contact);
}

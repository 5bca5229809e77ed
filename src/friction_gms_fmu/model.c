/* friction_gms: the friction torque of one feed axis by generalised Maxwell slip, seen from the motor shaft.
 *
 * Equations and source: gms.h. Over a step n is linear in time.
 *
 *   n = n_fr  speed at the contact [rad/s]         M_fr   friction torque, sign of n [N.m]
 *   z         mean deflection of the elements [rad]
 *   k         share of the stiffness that sticks [1]
 *   parameters: variables.def
 */
#include <math.h>

#include "gms_parameters.h"
#include "numbers.h"
#include "unit.h"

typedef struct State {
    ContactState contact;
    double n;          /* speed that M_fr belongs to: at the end of the last step [rad/s] */
    double M_fr_slope; /* change of M_fr over the last step, per second [N.m/s] */
} State;

/* Derived: the Contact of the present parameters. */
static bool gms_derive(Unit *unit) {
    const Scalars *v = unit_scalars(unit);
    if (!parameters_agree(v)) {
        char text[2][NUMBER_TEXT_SIZE];
        return unit_fail(
            unit,
            "parameter 'F_S' is %s N.m and 'F_C' is %s N.m; the static friction torque F_S must not be below "
            "the Coulomb friction torque F_C",
            number_text(text[0], v->F_S), number_text(text[1], v->F_C));
    }
    Contact *contact = unit_derived(unit);
    if (contact == NULL) {
        contact = unit_alloc(unit, 1, sizeof *contact);
        if (contact == NULL) {
            return false;
        }
        unit_set_derived(unit, contact);
    }
    *contact = parameters_contact(v);
    return true;
}

static void gms_release(Unit *unit) {
    unit_free(unit, unit_derived(unit));
    unit_set_derived(unit, NULL);
}

static size_t gms_state_size(const Unit *unit) {
    (void)unit;
    return sizeof(State);
}

/* Outputs and locals that go with the elements and n; returns M_fr. */
static void gms_show(Scalars *v, const Contact *p, const State *state, double M_fr, double share) {
    unit_show(&v->z, contact_deflection(p, &state->contact));
    unit_show(&v->k, share);
    unit_show(&v->M_fr, M_fr);
}

static void gms_start(Unit *unit) {
    Scalars *v = unit_scalars(unit);
    State *state = unit_state(unit);
    const Contact *p = unit_derived(unit);
    state->n = v->n_fr;
    double share;
    const double M_fr = contact_torque(p, state->contact, state->n, &share);
    gms_show(v, p, state, M_fr, share);
}

static bool gms_step(Unit *unit, double t, double h) {
    (void)t; /* the law does not change with time */
    Scalars *v = unit_scalars(unit);
    State *state = unit_state(unit);
    const Contact *p = unit_derived(unit);
    const double n_start = v->n_fr, n_end = n_start + unit_slope(unit, VR_n_fr) * h;
    const ContactState contact = contact_advance(p, state->contact, n_start, n_end, h);
    double share;
    const double M_fr = contact_torque(p, contact, n_end, &share);
    if (!isfinite(M_fr)) {
        char text[2][NUMBER_TEXT_SIZE];
        return unit_fail(
            unit, "M_fr would be no finite number at the end of the step, in which n_fr goes from %s to %s rad/s",
            number_text(text[0], n_start), number_text(text[1], n_end));
    }
    *state = (State){.contact = contact, .n = n_end, .M_fr_slope = (M_fr - v->M_fr) / h};
    gms_show(v, p, state, M_fr, share);
    return true;
}

static double gms_output_derivative(Unit *unit, unsigned vr) {
    const State *state = unit_state(unit);
    return vr == VR_M_fr ? state->M_fr_slope : 0;
}

static double gms_partial(Unit *unit, unsigned output, unsigned input, bool initial) {
    (void)initial; /* all elements stick then, and the law is the same */
    if (output != VR_M_fr || input != VR_n_fr) {
        return 0;
    }
    const State *state = unit_state(unit);
    return contact_torque_by_speed(unit_derived(unit), &state->contact, state->n);
}

const Model MODEL = {
    .identifier = "friction_gms",
    .load = NULL,
    .derive = gms_derive,
    .state_size = gms_state_size,
    .start = gms_start,
    .step = gms_step,
    .output_derivative = gms_output_derivative,
    .partial = gms_partial,
    .release = gms_release,
};

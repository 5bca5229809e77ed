/* friction: the friction torque of one feed axis, seen from the motor shaft.
 *
 * Equations: lugre.h (1, 6, 7), tem.h (2 to 4), contact.h (the step, over which n is linear in time).
 *
 *   n = n_fr  speed at the contact [rad/s]         M_fr   friction torque, sign of n [N.m]
 *   z         mean bristle deflection [rad]        c      position in the engaging zone [rad]
 *   k         engaged share of stiffness [1]       lambda engagement [1]
 *   parameters: variables.def
 *
 * Source: M. Wiesauer, F. Bleicher, "Parameterization method for non-linear friction models of machine tool feed
 * drives", 18th CIRP Conference on Modeling of Machining Operations (2021). What its print has wrong: README.md.
 */
#include <math.h>

#include "contact.h"
#include "numbers.h"
#include "parameters.h"
#include "unit.h"

typedef struct State {
    ContactState contact;
    double n;          /* speed that M_fr belongs to: at the end of the last step [rad/s] */
    double M_fr_slope; /* change of M_fr over the last step, per second [N.m/s] */
} State;

static bool friction_derive(Unit *unit) {
    const Scalars *v = unit_scalars(unit);
    char text[2][NUMBER_TEXT_SIZE];
    if (!parameters_agree(v)) {
        return unit_fail(
            unit,
            "parameter 'F_S' is %s N.m and 'F_C' is %s N.m; the static friction torque F_S must not be below "
            "the Coulomb friction torque F_C",
            number_text(text[0], v->F_S), number_text(text[1], v->F_C));
    }
    const double turnover = 2 * (1 + fabs(v->asymmetry)) * v->F_S / v->sigma_0;
    if (v->W > 0 && v->W <= turnover) {
        unit_warn(unit,
                  "parameter 'W' is %s rad; keep it well above 2 (1 + |asymmetry|) F_S / sigma_0 = %s rad, the angle "
                  "within which the bristles turn over, or at 0 (engaging model off)",
                  number_text(text[0], v->W), number_text(text[1], turnover));
    }
    return true;
}

static size_t friction_state_size(const Unit *unit) {
    (void)unit;
    return sizeof(State);
}

/* Outputs and locals that go with z, c and n. */
static void friction_show(Scalars *v, const State *state, ContactForce force) {
    unit_show(&v->z, state->contact.z);
    unit_show(&v->c, state->contact.c);
    unit_show(&v->lambda, force.lambda);
    unit_show(&v->k, force.k);
    unit_show(&v->M_fr, force.M_fr);
}

static void friction_start(Unit *unit) {
    Scalars *v = unit_scalars(unit);
    State *state = unit_state(unit);
    const Contact p = parameters_contact(v);
    state->n = v->n_fr;
    friction_show(v, state, contact_force(&p, state->contact, state->n));
}

static bool friction_step(Unit *unit, double t, double h) {
    (void)t; /* the law does not change with time */
    Scalars *v = unit_scalars(unit);
    State *state = unit_state(unit);
    const Contact p = parameters_contact(v);
    const double n_start = v->n_fr, n_end = n_start + unit_slope(unit, VR_n_fr) * h;
    const ContactState contact = contact_advance(&p, state->contact, n_start, n_end, h);
    const ContactForce force = contact_force(&p, contact, n_end);
    if (!isfinite(force.M_fr)) {
        char text[2][NUMBER_TEXT_SIZE];
        return unit_fail(
            unit, "M_fr would be no finite number at the end of the step, in which n_fr goes from %s to %s rad/s",
            number_text(text[0], n_start), number_text(text[1], n_end));
    }
    *state = (State){.contact = contact, .n = n_end, .M_fr_slope = (force.M_fr - v->M_fr) / h};
    friction_show(v, state, force);
    return true;
}

static double friction_output_derivative(Unit *unit, unsigned vr) {
    const State *state = unit_state(unit);
    return vr == VR_M_fr ? state->M_fr_slope : 0;
}

static double friction_partial(Unit *unit, unsigned output, unsigned input, bool initial) {
    (void)initial; /* z = 0 then, and the law is the same */
    if (output != VR_M_fr || input != VR_n_fr) {
        return 0;
    }
    const State *state = unit_state(unit);
    const Contact p = parameters_contact(unit_scalars(unit));
    return lugre_torque_by_speed(&p.lugre, state->contact.z, state->n);
}

const Model MODEL = {
    .identifier = "friction",
    .load = NULL,
    .derive = friction_derive,
    .state_size = friction_state_size,
    .start = friction_start,
    .step = friction_step,
    .output_derivative = friction_output_derivative,
    .partial = friction_partial,
    .release = NULL,
};

#include "contact.h"

#include <stddef.h>

#include "tem.h"

ContactState contact_at(const Contact *p, double z, double c) {
    return (ContactState){.z = z, .c = tem_advance(c, 0, p->W)};
}

double contact_deflection(const Contact *p, const ContactState *state) {
    (void)p;
    return state->z;
}

double contact_engaged(const Contact *p, const ContactState *state) {
    (void)p;
    return state->c;
}

/* One part of a step: mean speed n, which does not change its sign, over h. */
static ContactState contact_part(const Contact *p, ContactState state, double n, double h) {
    return (ContactState){.z = lugre_advance(&p->lugre, state.z, n, h), .c = tem_advance(state.c, n * h, p->W)};
}

ContactState contact_advance(const Contact *p, ContactState state, double n_start, double n_end, double h) {
    if ((n_start < 0 && n_end > 0) || (n_start > 0 && n_end < 0)) {
        const double crossing = h * (n_start / (n_start - n_end));
        state = contact_part(p, state, n_start / 2, crossing);
        return contact_part(p, state, n_end / 2, h - crossing);
    }
    return contact_part(p, state, n_start + (n_end - n_start) / 2, h);
}

double contact_engagement(const Contact *p, ContactState state) {
    return tem_engagement(state.z, state.c, p->W);
}

ContactForce contact_force(const Contact *p, ContactState state, double n) {
    const double lambda = contact_engagement(p, state), k = tem_share(lambda, p->gamma);
    return (ContactForce){.M_fr = lugre_torque(&p->lugre, k, state.z, n), .k = k, .lambda = lambda};
}

double contact_torque(const Contact *p, ContactState state, double n, double *share) {
    const ContactForce force = contact_force(p, state, n);
    if (share != NULL) {
        *share = force.k;
    }
    return force.M_fr;
}

#include "contact.h"

#include <stdbool.h>
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

/* One part of a step: mean speed n, which does not change its sign, over h; g = g(n). */
static ContactState contact_part(const Contact *p, ContactState state, double n, double g, double h) {
    return (ContactState){.z = lugre_advance(state.z, n, g, h), .c = tem_advance(state.c, n * h, p->W)};
}

static bool crosses_zero(double n_start, double n_end) {
    return (n_start < 0 && n_end > 0) || (n_start > 0 && n_end < 0);
}

/* When the speed crosses zero in a step of h [s]. */
static double crossing_time(double n_start, double n_end, double h) {
    return h * (n_start / (n_start - n_end));
}

ContactState contact_advance(const Contact *p, ContactState state, double n_start, double n_end, double h) {
    if (crosses_zero(n_start, n_end)) {
        const double crossing = crossing_time(n_start, n_end, h), before = n_start / 2, after = n_end / 2;
        state = contact_part(p, state, before, lugre_level(&p->lugre, before), crossing);
        return contact_part(p, state, after, lugre_level(&p->lugre, after), h - crossing);
    }
    const double mean = n_start + (n_end - n_start) / 2;
    return contact_part(p, state, mean, lugre_level(&p->lugre, mean), h);
}

double contact_engagement(const Contact *p, ContactState state) {
    return tem_engagement(state.z, state.c, p->W);
}

/* g = g(n). */
static ContactForce force_at_level(const Contact *p, ContactState state, double n, double g) {
    const double lambda = contact_engagement(p, state), k = tem_share(lambda, p->gamma);
    return (ContactForce){.M_fr = lugre_torque(&p->lugre, k, state.z, n, g), .k = k, .lambda = lambda};
}

ContactForce contact_force(const Contact *p, ContactState state, double n) {
    return force_at_level(p, state, n, lugre_level(&p->lugre, n));
}

double contact_torque(const Contact *p, ContactState state, double n, double *share) {
    const ContactForce force = contact_force(p, state, n);
    if (share != NULL) {
        *share = force.k;
    }
    return force.M_fr;
}

void contacts_relate(ContactInRow row[], size_t count) {
    for (size_t i = 0; i < count; i++) {
        row[i].like = 0;
        while (!lugre_shares_shape(&row[row[i].like].contact.lugre, &row[i].contact.lugre) && row[i].like < i) {
            row[i].like++;
        }
    }
}

/* g(n) of one of them; those before it have theirs. */
static double level_in_row(ContactInRow row[], size_t i, double n) {
    const Lugre *lugre = &row[i].contact.lugre;
    if (row[i].like == i) {
        row[i].shape = lugre_shape(lugre, n);
    }
    return lugre_level_of(lugre, n, row[row[i].like].shape);
}

static void parts_in_row(ContactInRow row[], size_t count, double n, double h) {
    for (size_t i = 0; i < count; i++) {
        row[i].state = contact_part(&row[i].contact, row[i].state, n, level_in_row(row, i, n), h);
    }
}

void contacts_advance(ContactInRow row[], size_t count, double n_start, double n_end, double h) {
    if (crosses_zero(n_start, n_end)) {
        const double crossing = crossing_time(n_start, n_end, h);
        parts_in_row(row, count, n_start / 2, crossing);
        parts_in_row(row, count, n_end / 2, h - crossing);
    } else {
        parts_in_row(row, count, n_start + (n_end - n_start) / 2, h);
    }
}

void contacts_torque(ContactInRow row[], size_t count, double n, double M_fr[], size_t stride) {
    for (size_t i = 0; i < count; i++) {
        M_fr[i * stride] = force_at_level(&row[i].contact, row[i].state, n, level_in_row(row, i, n)).M_fr;
    }
}

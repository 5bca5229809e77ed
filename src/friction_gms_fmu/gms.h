/* Generalised Maxwell slip (GMS) friction, motor side: rad, rad/s, N.m. The friction contact of friction_fmu/contact.h
 * by another law, with the same functions.
 *
 *   M_fr = sum F_i + sigma_1 sum k_i/sigma_0 (n - |n| F_i/(alpha_i s(n))) + sigma_2 n
 *   an element that sticks:  dF_i/dt = k_i n                                    until |F_i| reaches alpha_i s(n)
 *   an element that slips:   dF_i/dt = sgn(n) C (alpha_i - |F_i|/s(n))          until n passes zero
 *   s(n) = (1 + a sgn n) (F_C + (F_S - F_C) exp(-(|n|/v_s)^beta) + F_log ln(|n|/v_log + 1))      (lugre.h, Eq. 7)
 *
 * Source: Al-Bender, Lampaert, Swevers, "The generalized Maxwell-slip model: a novel model for friction simulation and
 * compensation", IEEE Transactions on Automatic Control 50 (2005) 1883-1887. They leave open how the elements differ
 * (two numbers an element); here two numbers say it for all: the deflections x_i at which they slip are in equal
 * ratios, x_N/x_1 = spread, and
 *
 *   alpha_i ~ x_i^skew, sum alpha_i = 1          k_i = sigma_0 (alpha_i/x_i) / sum (alpha_j/x_j)
 *
 * Their damping, sigma_i dz_i/dt, jumps where an element begins to slip; here it is that of LuGre (Eq. 6), which has
 * vanished there. |F_i| is of the direction in which the element slips. Pure functions: no memory, no FMI. */
#ifndef FEEDSIM_GMS_H
#define FEEDSIM_GMS_H

#include <stddef.h>

#include "../friction_fmu/lugre.h"
#include "prefix.h"

#define contact_make PREFIXED(contact_make)
#define contact_at PREFIXED(contact_at)
#define contacts_relate PREFIXED(contacts_relate)
#define contacts_advance PREFIXED(contacts_advance)
#define contacts_torque PREFIXED(contacts_torque)
#define contact_advance PREFIXED(contact_advance)
#define contact_torque PREFIXED(contact_torque)
#define contact_deflection PREFIXED(contact_deflection)
#define contact_engaged PREFIXED(contact_engaged)
#define contact_torque_by_speed PREFIXED(contact_torque_by_speed)

enum { GMS_ELEMENTS = 10 };

typedef struct Contact {
    Lugre curve;                    /* with sigma_0 = 1, so that lugre_level() is s(n) [N.m] */
    double sigma_0;                 /* sum of all stiffnesses [N.m/rad] */
    double sigma_1;                 /* [N.m.s/rad] */
    double sigma_2;                 /* [N.m.s/rad] */
    double C;                       /* attraction [N.m/s], > 0 */
    double stiffness[GMS_ELEMENTS]; /* k_i [N.m/rad] */
    double share[GMS_ELEMENTS];     /* alpha_i [1] */
} Contact;

typedef struct ContactState {
    double force[GMS_ELEMENTS]; /* F_i [N.m] */
    double slip[GMS_ELEMENTS];  /* direction in which the element slips, -1 or 1; else it sticks */
} ContactState;

/* The contact with these numbers of all elements together (lugre.sigma_0 and so on), x_N/x_1 and the shares' exponent.
 */
Contact contact_make(const Lugre *lugre, double spread, double skew, double C);

/* State of a contact that was free of torque and then moved until its mean deflection is z [rad], or all elements
 * slip; c has no meaning here. */
ContactState contact_at(const Contact *p, double z, double c);

/* State after h [s], over which the speed goes in a straight line from n_start to n_end [rad/s]. Split where the speed
 * crosses zero. Within a part s is taken as linear in time: where an element begins to slip is the root of a parabola,
 * and slipping has a closed form at the part's mean rate C/s. Second order, stable for any h. */
ContactState contact_advance(const Contact *p, ContactState state, double n_start, double n_end, double h);

/* M_fr [N.m] at speed n [rad/s]; the share of the stiffness that sticks [1] is written to *share unless that is NULL.
 */
double contact_torque(const Contact *p, ContactState state, double n, double *share);

/* Mean deflection z = sum F_i / sigma_0 [rad]. */
double contact_deflection(const Contact *p, const ContactState *state);

/* c [rad] of the engaging model, which this law does not have: 0. */
double contact_engaged(const Contact *p, const ContactState *state);

/* Contacts that move alike, side by side: to the bit what each of them would do alone. */
typedef struct ContactInRow {
    Contact contact;
    ContactState state;
} ContactInRow;

/* Nothing to be done ahead. */
void contacts_relate(ContactInRow row[], size_t count);

/* contact_advance() of all of them. */
void contacts_advance(ContactInRow row[], size_t count, double n_start, double n_end, double h);

/* contact_torque() of all of them, to M_fr[0], M_fr[stride] .. */
void contacts_torque(ContactInRow row[], size_t count, double n, double M_fr[], size_t stride);

/* Partial derivative of M_fr by n [N.m.s/rad], all F_i held. */
double contact_torque_by_speed(const Contact *p, const ContactState *state, double n);

#endif

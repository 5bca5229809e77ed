/* The friction contact over time: LuGre (lugre.h) with the transmission engaging model (tem.h), advanced in steps over
 * which the speed is linear.
 *
 * A step is split where the speed crosses zero; each part advances z by the exact solution at the part's mean speed
 * (second order, stable for any step) and c exactly. Pure functions: no memory, no FMI. */
#ifndef FEEDSIM_CONTACT_H
#define FEEDSIM_CONTACT_H

#include <stddef.h>

#include "lugre.h"
#include "prefix.h"

#define contact_at PREFIXED(contact_at)
#define contacts_relate PREFIXED(contacts_relate)
#define contacts_advance PREFIXED(contacts_advance)
#define contacts_torque PREFIXED(contacts_torque)
#define contact_advance PREFIXED(contact_advance)
#define contact_deflection PREFIXED(contact_deflection)
#define contact_engaged PREFIXED(contact_engaged)
#define contact_engagement PREFIXED(contact_engagement)
#define contact_force PREFIXED(contact_force)
#define contact_torque PREFIXED(contact_torque)

typedef struct Contact {
    Lugre lugre;
    double W;     /* width of the engaging zone [rad], >= 0; 0: engaging model off */
    double gamma; /* share of the bristle stiffness engaged at once [1], 0 to 1 */
} Contact;

typedef struct ContactState {
    double z; /* mean bristle deflection [rad] */
    double c; /* position in the engaging zone [rad], -W/2 to +W/2 */
} ContactState;

/* State with deflection z and position c [rad] in the engaging zone; a c beyond it is put to its end. */
ContactState contact_at(const Contact *p, double z, double c);

/* z [rad], and c [rad]. */
double contact_deflection(const Contact *p, const ContactState *state);
double contact_engaged(const Contact *p, const ContactState *state);

/* State after h [s], over which the speed goes in a straight line from n_start to n_end [rad/s]. */
ContactState contact_advance(const Contact *p, ContactState state, double n_start, double n_end, double h);

/* lambda [1], Eq. 3. */
double contact_engagement(const Contact *p, ContactState state);

typedef struct ContactForce {
    double M_fr;   /* [N.m], Eq. 1 */
    double k;      /* share of the bristle stiffness engaged [1], Eq. 2 */
    double lambda; /* engagement [1], Eq. 3 */
} ContactForce;

/* At speed n [rad/s]. */
ContactForce contact_force(const Contact *p, ContactState state, double n);

/* M_fr [N.m], Eq. 1, at speed n [rad/s], with the share k [1] of the bristle stiffness that goes with lambda (Eq. 2);
 * k is written to *share unless that is NULL. */
double contact_torque(const Contact *p, ContactState state, double n, double *share);

/* Contacts that move alike, side by side: to the bit what each of them would do alone, at less cost, as those of one
 * shape of the torque over speed share it. */
typedef struct ContactInRow {
    Contact contact;
    ContactState state;
    size_t like;      /* the first of the row with the same shape */
    LugreShape shape; /* of that one, at the speed of the moment */
} ContactInRow;

/* Fill in `like` of all of them. */
void contacts_relate(ContactInRow row[], size_t count);

/* contact_advance() of all of them. */
void contacts_advance(ContactInRow row[], size_t count, double n_start, double n_end, double h);

/* contact_torque() of all of them, to M_fr[0], M_fr[stride] .. */
void contacts_torque(ContactInRow row[], size_t count, double n, double M_fr[], size_t stride);

#endif

/* The whole responses of friction contacts to one given speed in one call: what the unit computes when it is stepped
 * with the slope of n_fr, without the FMI in between. For fits, which need them by the thousand: a difference quotient
 * asks for a contact a parameter, and side by side they share what their parameters have in common.
 *
 * With free_axis.h one of the two functions of the library that are not of the FMI. It keeps nothing between calls, so
 * calls from several threads do not know of each other. */
#ifndef FEEDSIM_RESPONSE_H
#define FEEDSIM_RESPONSE_H

#include <stddef.h>

#include "prefix.h"

/* As for the functions of the FMI (fmi2Functions.h): exported from a shared library, not where units are linked into
 * one program. */
#if defined FMI2_FUNCTION_PREFIX
#define RESPONSE_EXPORT
#elif defined _WIN32 || defined __CYGWIN__
#define RESPONSE_EXPORT __declspec(dllexport)
#elif defined __GNUC__
#define RESPONSE_EXPORT __attribute__((visibility("default")))
#else
#define RESPONSE_EXPORT
#endif

#define responses PREFIXED(responses) /* friction_responses */

/* Torque and state at the instants 0, every, 2 every .. of the instants 0 .. steps, h [s] apart.
 *
 *   count       > 0 contacts
 *   parameters  of one contact after the other every parameter of the unit, in the order of variables.def (and of
 *               modelDescription.xml)
 *   n           (steps + 1) speed [rad/s], linear between the instants
 *   substeps    >= 1 equal steps from one instant to the next: the solution is of second order in h/substeps
 *   every       >= 1
 *   z, c        (count) state at the first instant [rad]; a c beyond the engaging zone is put to its end
 *   M_fr, z_out, c_out  (count, steps/every + 1) [N.m], [rad], [rad]; z_out and c_out may be NULL
 *
 * Returns for how many instants: all steps/every + 1 of them where it went well; fewer where M_fr of a contact is no
 * finite number at the next one, from which on outputs are undefined; 0, besides, where parameters are refused as the
 * unit refuses them, where count, substeps or every is 0, where h is not finite and above 0, or where there is no
 * memory. */
RESPONSE_EXPORT size_t responses(size_t count, const double parameters[], const double n[], size_t steps, double h,
                                 size_t substeps, size_t every, const double z[], const double c[], double M_fr[],
                                 double z_out[], double c_out[]);

#endif

#include "response.h"

#include <math.h>

#ifndef LAW_PARAMETERS /* another law brings its own, with the same functions */
#define LAW_PARAMETERS "parameters.h"
#endif
#include LAW_PARAMETERS

/* From one instant to the next. */
static ContactState response_interval(const Contact *p, ContactState state, double n_start, double n_end, double h,
                                      size_t substeps) {
    const double d = h / (double)substeps, slope = (n_end - n_start) / (double)substeps;
    double n = n_start;
    for (size_t i = 1; i < substeps; i++) {
        const double next = n_start + slope * (double)i;
        state = contact_advance(p, state, n, next, d);
        n = next;
    }
    return contact_advance(p, state, n, n_end, d); /* ends at n_end itself, not a rounding beside it */
}

size_t response(const double parameters[], const double n[], size_t steps, double h, size_t substeps, size_t every,
                double z, double c, double M_fr[], double z_out[], double c_out[]) {
    Scalars v;
    if (substeps == 0 || every == 0 || !isfinite(h) || h <= 0 || !parameters_take(parameters, &v) ||
        !parameters_agree(&v)) {
        return 0;
    }
    const Contact p = parameters_contact(&v);
    ContactState state = contact_at(&p, z, c);
    size_t written = 0;
    for (size_t i = 0;;) {
        const double torque = contact_torque(&p, state, n[i], NULL);
        if (!isfinite(torque)) {
            return written;
        }
        M_fr[written] = torque;
        if (z_out != NULL) {
            z_out[written] = contact_deflection(&p, &state);
        }
        if (c_out != NULL) {
            c_out[written] = contact_engaged(&p, &state);
        }
        written++;
        if (steps - i < every) {
            return written;
        }
        for (size_t end = i + every; i < end; i++) {
            state = response_interval(&p, state, n[i], n[i + 1], h, substeps);
        }
    }
}

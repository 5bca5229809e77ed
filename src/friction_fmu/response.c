#include "response.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>

#ifndef LAW_PARAMETERS /* another law brings its own, with the same functions */
#define LAW_PARAMETERS "parameters.h"
#endif
#include LAW_PARAMETERS

/* From one instant to the next. */
static void response_interval(ContactInRow row[], size_t count, double n_start, double n_end, double h,
                              size_t substeps) {
    const double d = h / (double)substeps, slope = (n_end - n_start) / (double)substeps;
    double n = n_start;
    for (size_t i = 1; i < substeps; i++) {
        const double next = n_start + slope * (double)i;
        contacts_advance(row, count, n, next, d);
        n = next;
    }
    contacts_advance(row, count, n, n_end, d); /* ends at n_end itself, not a rounding beside it */
}

/* What the contacts say at speed n, to the first place of the outputs and others `stride` apart. False where a torque
 * is no finite number. */
static bool response_instant(ContactInRow row[], size_t count, double n, double M_fr[], double z_out[], double c_out[],
                             size_t stride) {
    bool finite = true;
    contacts_torque(row, count, n, M_fr, stride);
    for (size_t i = 0; i < count; i++) {
        finite = finite && isfinite(M_fr[i * stride]);
        if (z_out != NULL) {
            z_out[i * stride] = contact_deflection(&row[i].contact, &row[i].state);
        }
        if (c_out != NULL) {
            c_out[i * stride] = contact_engaged(&row[i].contact, &row[i].state);
        }
    }
    return finite;
}

/* The contacts at the first instant. False where parameters are refused. */
static bool response_begin(ContactInRow row[], size_t count, const double parameters[], const double z[],
                           const double c[]) {
    for (size_t i = 0; i < count; i++) {
        Scalars v;
        parameters = parameters_take(parameters, &v);
        if (parameters == NULL || !parameters_agree(&v)) {
            return false;
        }
        row[i].contact = parameters_contact(&v);
        row[i].state = contact_at(&row[i].contact, z[i], c[i]);
    }
    contacts_relate(row, count);
    return true;
}

size_t responses(size_t count, const double parameters[], const double n[], size_t steps, double h, size_t substeps,
                 size_t every, const double z[], const double c[], double M_fr[], double z_out[], double c_out[]) {
    if (count == 0 || substeps == 0 || every == 0 || !isfinite(h) || h <= 0) {
        return 0;
    }
    const size_t stride = steps / every + 1;
    size_t written = 0;
    ContactInRow *row = calloc(count, sizeof *row);
    if (row != NULL && response_begin(row, count, parameters, z, c)) {
        for (size_t i = 0; written < stride; written++) {
            if (written > 0) {
                for (size_t end = i + every; i < end; i++) {
                    response_interval(row, count, n[i], n[i + 1], h, substeps);
                }
            }
            double *z_at = z_out != NULL ? z_out + written : NULL, *c_at = c_out != NULL ? c_out + written : NULL;
            if (!response_instant(row, count, n[i], M_fr + written, z_at, c_at, stride)) {
                break;
            }
        }
    }
    free(row);
    return written;
}

/* Delay of a sampled signal by any number of samples, whole or not: a ring buffer of past samples and an interpolation
 * between the ones about the delayed instant.
 *
 *   y_k = sum_i w_i u_(k - first - i)
 *
 * delay_cubic: Lagrange polynomial through four samples. With the delayed instant in the interval between the samples
 * of age m and m + 1, those of age m - 1, m, m + 1, m + 2 (the interval lies in the middle, where the polynomial is
 * best); 0, 1, 2, 3 where the delay is below one sample, because there is no sample of the future. Order 4 in the
 * sampling time. delay_linear: the two samples about the instant. Order 2. A delay of a whole number of samples takes
 * that sample alone and is exact; a delay of 0 hands the input through.
 *
 * A Delay holds coefficients only. The samples live in a ring of `length` doubles that the caller owns. No FMI. */
#ifndef FEEDSIM_DELAY_H
#define FEEDSIM_DELAY_H

#include <stdint.h>

#include "prefix.h"

#define delay_cubic PREFIXED(delay_cubic)
#define delay_linear PREFIXED(delay_linear)
#define delay_fill PREFIXED(delay_fill)
#define delay_step PREFIXED(delay_step)

typedef struct Delay {
    int32_t length;   /* of the ring [samples] */
    int32_t first;    /* age of the newest sample that is weighed [samples] */
    int32_t taps;     /* how many samples are weighed: 1, 2 or 4 */
    double weight[4]; /* w_i [1], newest first */
} Delay;

/* Coefficients for a delay of `samples` >= 0 sampling times (below 2^30). Nearer to a whole number than rounding can
 * tell (1e-9 relative) counts as whole. */
Delay delay_cubic(double samples);
Delay delay_linear(double samples);

/* Make the past: every sample of the ring is `value`. `newest` is the index of the youngest sample. */
void delay_fill(const Delay *p, double *ring, int32_t *newest, double value);

/* Take in the present sample u and return the delayed one. */
double delay_step(const Delay *p, double *ring, int32_t *newest, double u);

#endif

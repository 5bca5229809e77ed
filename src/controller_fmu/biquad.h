/* Second-order section of a sampled signal, for the current setpoint filters and the reference model.
 *
 *   band-stop  (s^2 + 2 D_num w s + w^2) / (s^2 + 2 D_den w s + w^2)
 *   low-pass   w^2 / (s^2 + 2 D_den w s + w^2)
 *
 * Tustin: s = w/K (1 - q)/(1 + q), q = 1/z. K = tan(w h/2) prewarps at w: the sampled filter has the continuous one's
 * gain and phase there. K = w h/2 is Tustin without prewarping. With a_0 = 1 + 2 D_den K + K^2
 *
 *   H(q) = ((1 - q)(b_0 - b_2 q) + g q) / ((1 - q)(1 - a_2 q) + g q)
 *   g = 4 K^2/a_0,  a_2 = (1 - 2 D_den K + K^2)/a_0
 *   b_0, b_2 = (1 +- 2 D_num K + K^2)/a_0 (band-stop),  K^2/a_0 (low-pass)
 *
 * which is the usual quotient sorted by (1 - q): at 0 Hz (q = 1) it is g/g = 1 whatever the rounding of the
 * coefficients. Run as transposed direct form II. No FMI. */
#ifndef FEEDSIM_BIQUAD_H
#define FEEDSIM_BIQUAD_H

#include "prefix.h"

#define biquad_band_stop PREFIXED(biquad_band_stop)
#define biquad_low_pass PREFIXED(biquad_low_pass)
#define biquad_settle PREFIXED(biquad_settle)
#define biquad_step PREFIXED(biquad_step)

typedef struct Biquad {
    double b_0, b_2, a_2, g; /* [1] */
} Biquad;

typedef struct BiquadState {
    double s_1, s_2; /* in the unit of the signal */
} BiquadState;

/* K [1] > 0 as above, D_num >= 0, D_den >= 0 [1]. */
Biquad biquad_band_stop(double K, double D_num, double D_den);
Biquad biquad_low_pass(double K, double D_den);

/* Settled at `value`, as after a long time of constant input. */
void biquad_settle(const Biquad *p, BiquadState *x, double value);

/* Take in the present sample u and return y; the input acts on the output of the same instant. */
double biquad_step(const Biquad *p, BiquadState *x, double u);

#endif

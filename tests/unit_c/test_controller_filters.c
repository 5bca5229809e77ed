/* Second-order sections and reference model of the controller against transfer functions. */
#include <complex.h>

#include "biquad.h"
#include "check.h"
#include "reference_model.h"

static const double PI = 3.14159265358979323846;
static const double T_C = 125e-6;

/* Frequency response of a sampled block: the output to exp(j omega t) once transients are gone, by two real runs
 * (cosine and sine input) combined. */
static double complex biquad_response(const Biquad *p, double omega, int settle) {
    double complex y[2] = {0.0, 0.0};
    for (int part = 0; part < 2; ++part) {
        BiquadState x = {0.0, 0.0};
        for (int k = 0; k <= settle; ++k) {
            double phase = omega * T_C * k;
            y[part] = biquad_step(p, &x, part == 0 ? cos(phase) : sin(phase));
        }
    }
    return (y[0] + I * y[1]) * cexp(-I * omega * T_C * settle);
}

static double complex band_stop(double complex s, double w, double D_num, double D_den) {
    return (s * s + 2.0 * D_num * w * s + w * w) / (s * s + 2.0 * D_den * w * s + w * w);
}

static double complex low_pass(double complex s, double w, double D) {
    return w * w / (s * s + 2.0 * D * w * s + w * w);
}

/* Where Tustin, prewarped at w, puts the frequency omega; and without prewarping. */
static double warped(double omega, double w) {
    return w * tan(omega * T_C / 2.0) / tan(w * T_C / 2.0);
}

static double bilinear(double omega) {
    return 2.0 / T_C * tan(omega * T_C / 2.0);
}

static void filters_respond_as_prewarped(void) {
    static const double frequencies[] = {20.0, 150.0, 455.0, 602.0, 1500.0, 3500.0}; /* [Hz] */
    static const double corners[] = {455.0, 602.0, 2500.0};
    for (size_t c = 0; c < sizeof corners / sizeof corners[0]; ++c) {
        double w = 2.0 * PI * corners[c];
        double K = tan(w * T_C / 2.0);
        Biquad stop = biquad_band_stop(K, 0.08, 0.8);
        Biquad pass = biquad_low_pass(K, 0.7);
        for (size_t i = 0; i < sizeof frequencies / sizeof frequencies[0]; ++i) {
            double omega = 2.0 * PI * frequencies[i];
            double complex s = I * warped(omega, w);
            /* poles below 0.8: after 400 samples transients are rounding; phases of 2e3 rad are good to 2e-13 */
            CHECK_NEAR(cabs(biquad_response(&stop, omega, 400) - band_stop(s, w, 0.08, 0.8)), 0.0, 1e-12);
            CHECK_NEAR(cabs(biquad_response(&pass, omega, 400) - low_pass(s, w, 0.7)), 0.0, 1e-12);
        }
        /* at its own frequency the continuous filter's value: D_num/D_den, and -j/(2 D) */
        CHECK_NEAR(cabs(biquad_response(&stop, w, 400) - 0.1), 0.0, 1e-12);
        CHECK_NEAR(cabs(biquad_response(&pass, w, 400) + I / 1.4), 0.0, 1e-12);
    }
}

static void unit_gain_at_rest(void) {
    static const double K[] = {1e-6, 1e-3, 0.1, 0.24, 3.0};
    for (size_t i = 0; i < sizeof K / sizeof K[0]; ++i) {
        const Biquad filters[] = {biquad_band_stop(K[i], 0.08, 0.8), biquad_low_pass(K[i], 0.8)};
        for (int j = 0; j < 2; ++j) {
            BiquadState x;
            biquad_settle(&filters[j], &x, 2.3);
            double worst = 0.0;
            for (int k = 0; k < 1000; ++k) {
                worst = fmax(worst, fabs(biquad_step(&filters[j], &x, 2.3) - 2.3));
            }
            /* Settled stays settled. A few roundings per sample, 1e-15 together and always the same, sum up like a
             * double integrator's for as long as the filter remembers: 1/K samples, at most the 1000. A gain wrong by
             * the rounding of a coefficient would show as 1e-16/(4 K^2), that is 3e-5 at the smallest K. */
            double memory = fmin(1000.0, 1.0 / K[i]);
            CHECK_NEAR(worst, 0.0, 4e-15 + 1e-15 * memory * memory / 2.0);
        }
    }
    /* From rest to rest, at a frequency where coefficients matter: 1 Hz. Critically damped, over after 5 s. */
    Biquad slow = biquad_low_pass(tan(PI * 1.0 * T_C), 1.0);
    BiquadState x = {0.0, 0.0};
    double y = 0.0;
    for (int k = 0; k < 80000; ++k) {
        y = biquad_step(&slow, &x, 1.0);
    }
    /* stops where g (u - y) is below half an ulp: 1e-16/(2 * 6e-7) = 1e-10 */
    CHECK_NEAR(y, 1.0, 2e-10);
}

static double complex model_response(const ReferenceModel *p, double omega, int settle) {
    double complex y[2] = {0.0, 0.0};
    double ring[64];
    for (int part = 0; part < 2; ++part) {
        ReferenceModelState x = {{0.0, 0.0}, 0};
        reference_model_start(p, &x, ring, 0.0);
        for (int k = 0; k <= settle; ++k) {
            double phase = omega * T_C * k;
            y[part] = reference_model_step(p, &x, ring, part == 0 ? cos(phase) : sin(phase));
        }
    }
    return (y[0] + I * y[1]) * cexp(-I * omega * T_C * settle);
}

static void model_responds_as_tustin(void) {
    static const double models[][2] = {{747.3, 1.487}, {835.5, 1.330}, {915.3, 1.214}}; /* default X, Y, Z */
    static const double frequencies[] = {1.0, 40.0, 145.0, 600.0, 3000.0};
    for (size_t m = 0; m < 3; ++m) {
        double w = models[m][0];
        double D = models[m][1];
        ReferenceModel plain = reference_model_of(true, w, D, 0.0, T_C);
        ReferenceModel late = reference_model_of(true, w, D, 2.6 * T_C, T_C);
        for (size_t i = 0; i < sizeof frequencies / sizeof frequencies[0]; ++i) {
            double omega = 2.0 * PI * frequencies[i];
            double complex expected = low_pass(I * bilinear(omega), w, D);
            double complex q = cexp(-I * omega * T_C);
            /* slowest pole at -300/s: 2000 samples leave exp(-75); phases of 5e3 rad are good to 1e-12 */
            CHECK_NEAR(cabs(model_response(&plain, omega, 2000) - expected), 0.0, 3e-12);
            double complex dead_time = q * q * (0.4 + 0.6 * q);
            CHECK_NEAR(cabs(model_response(&late, omega, 2000) - expected * dead_time), 0.0, 3e-12);
        }
    }
}

static void model_lags_a_ramp_by_its_equivalent_time(void) {
    static const double models[][4] = {{747.3, 1.487, 0.0, 3.98e-3},
                                       {835.5, 1.330, 0.0, 3.18e-3},
                                       {915.3, 1.214, 0.0, 2.65e-3},
                                       {915.3, 1.214, 3.2e-4, 0.0}};
    for (size_t m = 0; m < 4; ++m) {
        double w = models[m][0];
        double D = models[m][1];
        double T_ref = models[m][2];
        ReferenceModel p = reference_model_of(true, w, D, T_ref, T_C);
        ReferenceModelState x;
        double ring[64];
        double lag = 0.0;
        reference_model_start(&p, &x, ring, 0.0);
        for (int k = 0; k < 2000; ++k) {
            double t = k * T_C;
            lag = t - reference_model_step(&p, &x, ring, t);
        }
        CHECK_NEAR(lag, 2.0 * D / w + T_ref, 1e-14); /* rounding of t = 0.25, amplified by 1/g = 80 */
        if (models[m][3] > 0.0) {
            CHECK_NEAR(lag, models[m][3], 0.5e-5); /* the figures of the default machine, as printed */
        }
    }
}

static void model_starts_settled(void) {
    ReferenceModel p = reference_model_of(true, 915.3, 1.214, 3.3 * T_C, T_C);
    ReferenceModelState x;
    double ring[64];
    reference_model_start(&p, &x, ring, 26.0);
    for (int k = 0; k < 500; ++k) {
        CHECK_NEAR(reference_model_step(&p, &x, ring, 26.0), 26.0, 1e-12); /* ulp 3.6e-15, amplified by 1/g = 80 */
    }
}

static void model_acts_at_once(void) {
    ReferenceModel p = reference_model_of(true, 915.3, 1.214, 0.0, T_C);
    ReferenceModelState x;
    double ring[64];
    reference_model_start(&p, &x, ring, 0.0);
    double K = 915.3 * T_C / 2.0;
    double expected = K * K / (1.0 + 2.0 * 1.214 * K + K * K);
    CHECK_NEAR(reference_model_step(&p, &x, ring, 1.0), expected, 1e-18); /* a few ulp of 0.003 */
}

static void model_off_hands_through(void) {
    ReferenceModel p = reference_model_of(false, 915.3, 1.214, 0.5, T_C);
    ReferenceModelState x;
    double ring[64];
    CHECK(p.dead_time.length <= 64);
    reference_model_start(&p, &x, ring, 0.0);
    for (int k = 0; k < 20; ++k) {
        CHECK(reference_model_step(&p, &x, ring, 0.1 * k) == 0.1 * k);
    }
}

int main(void) {
    filters_respond_as_prewarped();
    unit_gain_at_rest();
    model_responds_as_tustin();
    model_lags_a_ramp_by_its_equivalent_time();
    model_starts_settled();
    model_acts_at_once();
    model_off_hands_through();
    return CHECK_RESULT;
}

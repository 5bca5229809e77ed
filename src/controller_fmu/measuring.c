#include "measuring.h"

#include <math.h>

#include "orders.h"

void measuring_add(Measuring *p, double period, double amplitude, double phase) {
    if (amplitude > 0.0 || amplitude < 0.0) {
        p->periodic[p->periodic_errors++] =
            (PeriodicError){.wave_number = 2.0 * acos(-1.0) / period, .amplitude = amplitude, .phase = phase};
    }
}

/* Steele, Lea, Flood: Fast splittable pseudorandom number generators, OOPSLA 2014. */
static uint64_t measuring_hash(uint64_t z) {
    z = (z ^ (z >> 30)) * UINT64_C(0xbf58476d1ce4e5b9);
    z = (z ^ (z >> 27)) * UINT64_C(0x94d049bb133111eb);
    return z ^ (z >> 31);
}

double noise_of_instant(uint64_t seed, int64_t instant) {
    const uint64_t stream = measuring_hash((seed + 1) * UINT64_C(0x9e3779b97f4a7c15));
    const uint64_t bits = measuring_hash(stream + ((uint64_t)instant + 1) * UINT64_C(0x9e3779b97f4a7c15));
    double sum = 0.0;
    for (int i = 0; i < 4; ++i) {
        sum += (double)((bits >> (16 * i)) & 0xffff) - 32767.5;
    }
    /* an even number of 0 ... N - 1 has the variance (N^2 - 1)/12 */
    return sum / sqrt(4.0 * (65536.0 * 65536.0 - 1.0) / 12.0);
}

static double measuring_error(const Measuring *p, double x) {
    double error = p->linear * x;
    for (int32_t j = 0; j < p->periodic_errors; ++j) {
        error += p->periodic[j].amplitude * sin(p->periodic[j].wave_number * x + p->periodic[j].phase);
    }
    return p->table.used ? error + points_value(&p->table, x) : error;
}

void measuring_step(const Measuring *p, MeasuringState *x, int64_t instant, double *x_a, double *n_a) {
    const double n = *n_a;
    if (x->started) {
        const double turned = 0.5 * p->T_c * (x->n + n);
        x->phi = angle_within_turn(x->phi + turned);
        x->x_motor += p->I_P * turned;
    } else {
        x->x_motor = *x_a;
    }
    x->n = n;
    double position = *x_a;
    if (p->indirect) {
        const double e = p->eccentricity;
        position = x->x_motor + p->I_P * e * (sin(x->phi + p->eccentric_phase) - sin(p->eccentric_phase));
    }
    const double error = measuring_error(p, position);
    if (!x->started) {
        x->offset = error;
        x->started = 1;
    }
    double measured = position + (error - x->offset);
    if (p->noise > 0.0) {
        measured += p->noise * noise_of_instant(p->seed, instant);
    }
    if (p->resolution > 0.0) {
        measured = p->resolution * round(measured / p->resolution);
    }
    *x_a = measured;
    if (p->eccentricity > 0.0 || p->eccentricity < 0.0) {
        *n_a = n * (1.0 + p->eccentricity * cos(x->phi + p->eccentric_phase));
    }
}

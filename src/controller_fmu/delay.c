#include "delay.h"

#include <math.h>

/* The quotient of two times that should be whole is off by a few ulp. This is far above, and far below what matters. */
#define ROUNDING 1e-9

/* Split a delay into whole samples and the rest, 0 <= rest < 1. */
static int32_t whole_samples(double samples, double *rest) {
    double nearest = round(samples);
    if (fabs(samples - nearest) <= ROUNDING * fmax(1.0, nearest)) {
        *rest = 0.0;
        return (int32_t)nearest;
    }
    double whole = floor(samples);
    *rest = samples - whole;
    return (int32_t)whole;
}

static Delay taps_from(int32_t first, int32_t taps) {
    Delay p = {.length = first + taps, .first = first, .taps = taps, .weight = {1.0, 0.0, 0.0, 0.0}};
    return p;
}

Delay delay_cubic(double samples) {
    double rest;
    int32_t whole = whole_samples(samples, &rest);
    if (rest == 0.0) {
        return taps_from(whole, 1);
    }
    Delay p = taps_from(whole > 0 ? whole - 1 : 0, 4);
    double age = whole > 0 ? 1.0 + rest : rest; /* of the delayed instant, counted from the first tap */
    for (int i = 0; i < 4; ++i) {
        double weight = 1.0;
        for (int j = 0; j < 4; ++j) {
            if (j != i) {
                weight *= (age - j) / (i - j);
            }
        }
        p.weight[i] = weight;
    }
    return p;
}

Delay delay_linear(double samples) {
    double rest;
    int32_t whole = whole_samples(samples, &rest);
    if (rest == 0.0) {
        return taps_from(whole, 1);
    }
    Delay p = taps_from(whole, 2);
    p.weight[0] = 1.0 - rest;
    p.weight[1] = rest;
    return p;
}

void delay_fill(const Delay *p, double *ring, int32_t *newest, double value) {
    for (int32_t i = 0; i < p->length; ++i) {
        ring[i] = value;
    }
    *newest = 0;
}

double delay_step(const Delay *p, double *ring, int32_t *newest, double u) {
    /* The ring is filled downwards, so that age grows with the index. */
    *newest = *newest > 0 ? *newest - 1 : p->length - 1;
    ring[*newest] = u;
    int32_t at = *newest + p->first;
    at = at < p->length ? at : at - p->length;
    double y = p->weight[0] * ring[at];
    for (int i = 1; i < p->taps; ++i) {
        at = at + 1 < p->length ? at + 1 : 0;
        y += p->weight[i] * ring[at];
    }
    return y;
}

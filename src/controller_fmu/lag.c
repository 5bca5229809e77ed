#include "lag.h"

#include <math.h>

Lag lag_of(double T, double h) {
    Lag p = {1.0, 1.0};
    if (T > 0.0) {
        p.c_0 = -expm1(-h / T);
        p.c_1 = 1.0 - p.c_0 * T / h;
    }
    return p;
}

void lag_settle(LagState *x, double value) {
    x->u = value;
    x->y = value;
}

double lag_step(const Lag *p, LagState *x, double u) {
    x->y += p->c_0 * (x->u - x->y) + p->c_1 * (u - x->u);
    x->u = u;
    return x->y;
}

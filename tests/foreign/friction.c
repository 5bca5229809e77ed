/* Another maker's friction: Coulomb, smoothed, and viscous, over the speed in revolutions per minute. */
#define GUID "{acme-friction}"
#define REALS 5
#define BOOLEANS 1

#include "shell.h"

#include <math.h>

enum { SPEED, TORQUE, COULOMB, VISCOUS, KNEE };

static const double STARTS[REALS] = {[COULOMB] = 8, [VISCOUS] = 0.003, [KNEE] = 20};

static fmi2Status advance(Unit *unit, double h) {
    (void)h;
    double *v = unit->real;
    v[TORQUE] = v[COULOMB] * tanh(v[SPEED] / v[KNEE]) + v[VISCOUS] * v[SPEED];
    return fmi2OK;
}

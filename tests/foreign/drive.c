/* Another maker's drive: position controller P, speed controller PI, in millimetres, revolutions per minute and
 * newton millimetres. It samples at the beginning of a step and holds its torque. */
#define GUID "{acme-drive}"
#define REALS 12
#define BOOLEANS 2

#include "shell.h"

enum { POS_SETPOINT, POS_ACTUAL, SPEED_FORWARD, SPEED_ACTUAL, OVERRIDE, TORQUE, SPEED_SETPOINT, KV, KP, TN, LEAD, LIMIT };
enum { ENABLE, LIMITED };

static const double STARTS[REALS] = {[OVERRIDE] = 100, [KV] = 40, [KP] = 0.1, [TN] = 50, [LEAD] = 2.5, [LIMIT] = 140};

static fmi2Status advance(Unit *unit, double h) {
    double *v = unit->real;
    if (v[OVERRIDE] < 0) {
        unit->callbacks->logger(unit->callbacks->componentEnvironment, "drive", fmi2Error, "error",
                                "an override of %g %% is below %d", v[OVERRIDE], 0);
        return fmi2Error;
    }
    v[SPEED_SETPOINT] = v[KV] * (v[POS_SETPOINT] - v[POS_ACTUAL]) / v[LEAD] * 60 + v[SPEED_FORWARD];
    double error = v[OVERRIDE] / 100 * (v[SPEED_SETPOINT] - v[SPEED_ACTUAL]);
    unit->state += v[KP] * error * h * 1e3 / v[TN];
    double torque = unit->boolean[ENABLE] ? v[KP] * error + unit->state : 0;
    unit->boolean[LIMITED] = torque > v[LIMIT] || torque < -v[LIMIT];
    v[TORQUE] = torque > v[LIMIT] ? v[LIMIT] : torque < -v[LIMIT] ? -v[LIMIT] : torque;
    return fmi2OK;
}

/* The archive's table of setpoints, resources/setpoints.csv or the copy compiled into the unit, as the derived data of
 * an instance. */
#ifndef FEEDSIM_LOAD_H
#define FEEDSIM_LOAD_H

#include "setpoints.h"
#include "unit.h"

#define setpoint_load PREFIXED(setpoint_load)
#define setpoint_release PREFIXED(setpoint_release)

/* unit_derived() is a Setpoints afterwards. false, with the reason logged, where the file cannot be read, belongs to
 * another archive or is faulty. */
bool setpoint_load(Unit *unit);

void setpoint_release(Unit *unit);

#endif

/* The controller as a part of the machine: its own files once more, behind part_shell.h. */
#define FEEDSIM_IDENTITY_H /* a prefix of its own: one program may hold the unit, too */
#define UNIT_NAME machine_controller
#define UNIT_TABLE "controller_variables.def"

#include "part_shell.h"

#include "../controller_fmu/biquad.c"
#include "../controller_fmu/compensation.c"
#include "../controller_fmu/corrections.c"
#include "../controller_fmu/current.c"
#include "../controller_fmu/delay.c"
#include "../controller_fmu/drive.c"
#include "../controller_fmu/lag.c"
#include "../controller_fmu/measured_speed.c"
#include "../controller_fmu/measuring.c"
#include "../controller_fmu/model.c"
#include "../controller_fmu/orders.c"
#include "../controller_fmu/pmsm.c"
#include "../controller_fmu/points.c"
#include "../controller_fmu/position.c"
#include "../controller_fmu/reference_model.c"
#include "../controller_fmu/reversal.c"
#include "../controller_fmu/setpoint_ramp.c"
#include "../controller_fmu/speed.c"
#include "numbers.c"

/* The setpoint unit as a part of the machine: its own files once more, behind part_shell.h. */
#define FEEDSIM_IDENTITY_H /* a prefix of its own: one program may hold the unit, too */
#define UNIT_NAME machine_setpoint
#define UNIT_TABLE "setpoint_variables.def"

#include "files.c" /* ahead: Windows' own headers */
#include "part_shell.h"

#include "../setpoint_fmu/load.c"
#include "../setpoint_fmu/model.c"
#include "../setpoint_fmu/setpoints.c"
#include "archive_files.c"
#include "csv.c"
#include "hash.c"
#include "numbers.c"
#include "text.c"

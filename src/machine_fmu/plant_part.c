/* The plant as a part of the machine: its own files once more, behind part_shell.h. */
#define FEEDSIM_IDENTITY_H /* a prefix of its own: one program may hold the unit, too */
#define UNIT_NAME machine_plant
#define UNIT_TABLE "plant_variables.def"

#include "files.c" /* ahead: Windows' own headers */
#include "part_shell.h"

#include "../plant_fmu/axes.c"
#include "../plant_fmu/cells.c"
#include "../plant_fmu/derive.c"
#include "../plant_fmu/geometry.c"
#include "../plant_fmu/guide.c"
#include "../plant_fmu/guide_law.c"
#include "../plant_fmu/joints.c"
#include "../plant_fmu/load.c"
#include "../plant_fmu/modal.c"
#include "../plant_fmu/model.c"
#include "../plant_fmu/modes.c"
#include "../plant_fmu/mount.c"
#include "../plant_fmu/mounts.c"
#include "../plant_fmu/outputs.c"
#include "../plant_fmu/poses.c"
#include "../plant_fmu/resources.c"
#include "../plant_fmu/transmission.c"
#include "archive_files.c"
#include "csv.c"
#include "hash.c"
#include "numbers.c"
#include "text.c"

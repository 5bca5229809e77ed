/* The friction as a part of the machine: its own files once more, behind part_shell.h; without the functions over whole
 * records, which its library exports besides. */
#define FEEDSIM_IDENTITY_H /* a prefix of its own: one program may hold the unit, too */
#define UNIT_NAME machine_friction
#define UNIT_TABLE "friction_variables.def"

#include "part_shell.h"

#include "../friction_fmu/contact.c"
#include "../friction_fmu/lugre.c"
#include "../friction_fmu/model.c"
#include "../friction_fmu/parameters.c"
#include "../friction_fmu/tem.c"
#include "numbers.c"

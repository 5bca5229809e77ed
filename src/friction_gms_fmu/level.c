/* The torque over speed, once more for this law. */
#include "../friction_fmu/lugre.c"

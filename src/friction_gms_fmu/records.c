/* The functions over whole records, once more for this law. */
#include "records.h"

#define LAW_PARAMETERS "gms_parameters.h"
#include "../friction_fmu/free_axis.c"
#include "../friction_fmu/response.c"

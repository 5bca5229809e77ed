/* The functions over whole records, which the library exports besides those of the FMI: friction_gms_responses and
 * friction_gms_free_axis, with the arguments of friction's. */
#ifndef FEEDSIM_GMS_RECORDS_H
#define FEEDSIM_GMS_RECORDS_H

#include "../friction_fmu/free_axis.h"
#include "../friction_fmu/response.h"

#endif

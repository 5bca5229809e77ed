/* The parameters of this unit's law. */
#ifndef FEEDSIM_GMS_PARAMETERS_H
#define FEEDSIM_GMS_PARAMETERS_H

#include "gms.h"

#include "../friction_fmu/law_parameters.h"

#endif

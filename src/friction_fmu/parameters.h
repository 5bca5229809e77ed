/* The parameters of this unit's law. */
#ifndef FEEDSIM_PARAMETERS_H
#define FEEDSIM_PARAMETERS_H

#include "contact.h"
#include "law_parameters.h"

#endif

/* The unit's parameters as the contact takes them. Which there are, in which order and range: variables.def alone.
 * Behind the law's Contact. */
#ifndef FEEDSIM_LAW_PARAMETERS_H
#define FEEDSIM_LAW_PARAMETERS_H

#include <stdbool.h>

#include "prefix.h"
#include "table.h"

#define parameters_take PREFIXED(parameters_take)
#define parameters_agree PREFIXED(parameters_agree)
#define parameters_contact PREFIXED(parameters_contact)

/* The parameters in the order of their rows -> their fields of *v; the other fields are left alone. Returns what is
 * behind the last one; NULL where one is out of its row's range or not finite. */
const double *parameters_take(const double values[], Scalars *v);

/* Whether the parameters, each within its range, go together: F_S >= F_C. */
bool parameters_agree(const Scalars *v);

Contact parameters_contact(const Scalars *v);

#endif

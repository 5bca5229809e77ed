/* Slopes of inputs, slopes of outputs, and partial derivatives of outputs with respect to inputs. Every function either
 * succeeds or changes nothing and returns false with the reason logged. */
#ifndef FEEDSIM_DERIVATIVES_H
#define FEEDSIM_DERIVATIVES_H

#include "fmi2Functions.h"
#include "shell.h"

bool derivatives_set_inputs(Unit *unit, size_t count, const fmi2ValueReference references[], const fmi2Integer orders[],
                            const fmi2Real values[]);
/* Every input stays finite until the end of a step of size h. */
bool derivatives_inputs_finite(Unit *unit, double h);
/* The slopes served their step. */
void derivatives_clear_inputs(Unit *unit);

bool derivatives_get_outputs(Unit *unit, size_t count, const fmi2ValueReference references[],
                             const fmi2Integer orders[], fmi2Real values[]);
bool derivatives_get_directional(Unit *unit, size_t unknown_count, const fmi2ValueReference unknowns[],
                                 size_t known_count, const fmi2ValueReference knowns[], const fmi2Real seed[],
                                 fmi2Real sensitivity[]);

#endif

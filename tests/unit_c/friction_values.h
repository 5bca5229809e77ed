/* Values of the friction unit's parameters, each at the place of its row in variables.def; a row that is not named here
 * has 0: no effect. */
#ifndef FRICTION_VALUES_H
#define FRICTION_VALUES_H

#include "parameters.h"

#define AT_input_REAL(field)
#define AT_output_REAL(field)
#define AT_local_REAL(field)
#define AT_parameter_REAL(field) AT_##field,
#define VARIABLE(kind, field, name, causality, ...) AT_##causality##_##kind(field)
enum {
#include "variables.def"
    PARAMETERS
};
#undef VARIABLE

static const double VALUES[PARAMETERS] = {[AT_sigma_0] = 300,   [AT_sigma_1] = 0.8, [AT_sigma_2] = 0.006,
                                          [AT_F_C] = 1.6,       [AT_F_S] = 2.1,     [AT_v_s] = 0.6,
                                          [AT_beta] = 1.5,      [AT_F_log] = 0.4,   [AT_v_log] = 3,
                                          [AT_asymmetry] = 0.1, [AT_W] = 0.04,      [AT_gamma] = 0.35};

/* Below what is allowed; of F_S: below F_C. */
static const struct {
    int at;
    double value;
} BELOW[] = {{AT_sigma_0, 0}, {AT_sigma_1, -1e-9},   {AT_sigma_2, -1}, {AT_F_C, 0},
             {AT_F_S, 1.59},  {AT_v_s, 0},           {AT_beta, 0.09},  {AT_F_log, -1},
             {AT_v_log, 0},   {AT_asymmetry, -0.91}, {AT_W, -1},       {AT_gamma, -0.01}};
enum { REFUSED = sizeof BELOW / sizeof BELOW[0] };

#endif

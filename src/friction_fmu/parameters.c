#include "parameters.h"

static bool within(double value, double min, double max) {
    return isfinite(value) && value >= min && value <= max;
}

/* A parameter of another kind than REAL has no macro here and does not compile. */
#define TAKE_input_REAL(...)
#define TAKE_output_REAL(...)
#define TAKE_local_REAL(...)
#define TAKE_parameter_REAL(field, min, max)                                                                           \
    v->field = *values++;                                                                                              \
    good = good && within(v->field, min, max);
#define VARIABLE(kind, field, name, causality, variability, start, text, unit, display, min, min_text, max, ...)       \
    TAKE_##causality##_##kind(field, min, max)

bool parameters_take(const double values[], Scalars *v) {
    bool good = true;
#include "variables.def"
    return good;
}
#undef VARIABLE

bool parameters_agree(const Scalars *v) {
    return v->F_S >= v->F_C;
}

Contact parameters_contact(const Scalars *v) {
    return (Contact){.lugre = {.sigma_0 = v->sigma_0,
                               .sigma_1 = v->sigma_1,
                               .sigma_2 = v->sigma_2,
                               .F_C = v->F_C,
                               .F_S = v->F_S,
                               .v_s = v->v_s,
                               .beta = v->beta,
                               .F_log = v->F_log,
                               .v_log = v->v_log,
                               .asymmetry = v->asymmetry},
                     .W = v->W,
                     .gamma = v->gamma};
}

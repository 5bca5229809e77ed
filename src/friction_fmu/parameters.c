#include "parameters.h"

static bool within(double value, double min, double max) {
    return isfinite(value) && value >= min && value <= max;
}

/* Where the contact has a parameter: among those of LuGre, but for these. */
#define PLACE_W ~, W
#define PLACE_gamma ~, gamma
#define PLACE_SECOND(first, second, ...) second
#define PLACE_CHOICE(...) PLACE_SECOND(__VA_ARGS__, ~)
#define PLACE(field) PLACE_CHOICE(PLACE_##field, lugre.field)

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

#define PUT_input(...)
#define PUT_output(...)
#define PUT_local(...)
#define PUT_parameter(field) contact.PLACE(field) = v->field;
#define VARIABLE(kind, field, name, causality, ...) PUT_##causality(field)

Contact parameters_contact(const Scalars *v) {
    Contact contact = {0};
#include UNIT_TABLE
    return contact;
}
#undef VARIABLE

/* How a friction unit's parameters reach its law by its table alone; to be included once, by the unit's parameters.c,
 * behind its parameters.h. For tables whose parameters are all REAL: another kind has no macro here and does not
 * compile. Ahead of #include UNIT_TABLE, with VARIABLE defined as
 *
 *   TAKE  a row's value is taken into *v, and `good` is false where it is out of the row's range
 *   PUT   and goes from there to its place in `contact`: among those of LuGre, contact.lugre, but for those of which
 * the unit defines PLACE_<name> as `~, <name>` */
#ifndef FEEDSIM_TAKE_H
#define FEEDSIM_TAKE_H

#include <math.h>
#include <stdbool.h>
#include <stddef.h>

static bool within(double value, double min, double max) {
    return isfinite(value) && value >= min && value <= max;
}

#define TAKE_input_REAL(...)
#define TAKE_output_REAL(...)
#define TAKE_local_REAL(...)
#define TAKE_parameter_REAL(field, min, max)                                                                           \
    v->field = *values++;                                                                                              \
    good = good && within(v->field, min, max);
#define TAKE(kind, field, name, causality, variability, start, text, unit, display, min, min_text, max, ...)           \
    TAKE_##causality##_##kind(field, min, max)

#define PLACE_SECOND(first, second, ...) second
#define PLACE_CHOICE(...) PLACE_SECOND(__VA_ARGS__, ~)
#define PLACE(field) PLACE_CHOICE(PLACE_##field, lugre.field)
#define PUT_input(...)
#define PUT_output(...)
#define PUT_local(...)
#define PUT_parameter(field) contact.PLACE(field) = v->field;
#define PUT(kind, field, name, causality, ...) PUT_##causality(field)

#define VARIABLE(...) TAKE(__VA_ARGS__)
const double *parameters_take(const double values[], Scalars *v) {
    bool good = true;
#include UNIT_TABLE
    return good ? values : NULL;
}
#undef VARIABLE

bool parameters_agree(const Scalars *v) {
    return v->F_S >= v->F_C;
}

#endif

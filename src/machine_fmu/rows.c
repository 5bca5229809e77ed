/* Whether what lies in the machine's table is, field by field, what the parts take it for. C lays out equal fields
 * equally where they begin equally aligned; a row too many ahead of a part would break that, and ends here. */
#include "machine.h"

#undef SCALAR_ROW
#undef AXIS_ROW

#define AXIS_ROW(...)
#define SCALAR_ROW(kind, field, ...) offsetof(Scalars, motion_##field),
static const size_t motion_places[] = {
#include "setpoint_variables.def"
    0};
#undef SCALAR_ROW
#define SCALAR_ROW(kind, field, ...) offsetof(Scalars, plant_##field),
static const size_t plant_places[] = {
#include "plant_variables.def"
    0};
#undef SCALAR_ROW
#define SCALAR_ROW(kind, field, ...) offsetof(AxisBlock, drive_##field),
static const size_t drive_places[] = {
#include "controller_variables.def"
    0};
#undef SCALAR_ROW
#define SCALAR_ROW(kind, field, ...) offsetof(AxisBlock, friction_##field),
static const size_t friction_places[] = {
#include "friction_variables.def"
    0};
#undef SCALAR_ROW
#undef AXIS_ROW
#define SCALAR_ROW(...)
#define AXIS_ROW(kind, field, ...) offsetof(AxisBlock, motion_##field),
static const size_t motion_axis_places[] = {
#include "setpoint_variables.def"
    0};
#undef AXIS_ROW
#define AXIS_ROW(kind, field, ...) offsetof(AxisBlock, plant_##field),
static const size_t plant_axis_places[] = {
#include "plant_variables.def"
    0};
/* as table.h has them */
#undef SCALAR_ROW
#undef AXIS_ROW
#define SCALAR_ROW(...) VARIABLE(__VA_ARGS__)
#define AXIS_ROW(...) AXIS_VARIABLE(__VA_ARGS__)

static bool rows_same(Unit *unit, const char *part, const size_t *own, const size_t *its, size_t rows) {
    for (size_t i = 0; i < rows; i++) {
        if (own[i] - own[0] != its[i]) {
            return unit_fail(unit,
                             "this binary is built wrongly: row %.0f of the part %s lies at %.0f bytes, not at %.0f",
                             (double)i, part, (double)(own[i] - own[0]), (double)its[i]);
        }
    }
    return true;
}

bool machine_rows_agree(Unit *unit) {
    return rows_same(unit, "setpoint", motion_places, setpoint_part.scalar_places, setpoint_part.scalar_rows) &&
           rows_same(unit, "setpoint", motion_axis_places, setpoint_part.axis_places, setpoint_part.axis_rows) &&
           rows_same(unit, "plant", plant_places, plant_part.scalar_places, plant_part.scalar_rows) &&
           rows_same(unit, "plant", plant_axis_places, plant_part.axis_places, plant_part.axis_rows) &&
           rows_same(unit, "controller", drive_places, controller_part.scalar_places, controller_part.scalar_rows) &&
           rows_same(unit, "friction", friction_places, friction_part.scalar_places, friction_part.scalar_rows);
}

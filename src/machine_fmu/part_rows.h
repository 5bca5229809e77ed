/* Rows of the parts' tables as rows of the machine's.
 *
 * The rows of a part lie one behind the other, in their order: what lies there is the part's own Scalars (or
 * AxisBlock), field by field, and the part works on it as it does in its own unit. What a row is to an importer:
 *
 *   parameter, local   the same, under the part's name:       Z.drive.K_v, Z.friction.z
 *   output             the same, under its own name:          Z.M_a, Z.x_a
 *   input              a local under the part's name:         Z.drive.x_a, Z.plant.M_a
 *                      and, where it comes from OUTSIDE, an input under its own name besides: Z.x_s, Z.release
 *
 * The plant keeps its names, parameters and locals included (Z.x_0, pose.cell), and inputs from OUTSIDE are its own
 * rows. A part's input is listed here, or the table does not compile. */
#ifndef FEEDSIM_PART_ROWS_H
#define FEEDSIM_PART_ROWS_H

#define FROM_drive_x_s OUTSIDE
#define FROM_drive_n_ffw OUTSIDE
#define FROM_drive_x_a INSIDE
#define FROM_drive_n_a INSIDE
#define FROM_drive_n_add OUTSIDE
#define FROM_drive_M_add OUTSIDE
#define FROM_drive_release OUTSIDE
#define FROM_friction_n_fr INSIDE
#define FROM_plant_M_a INSIDE
#define FROM_plant_M_fr INSIDE
#define FROM_plant_F_a OUTSIDE
#define FROM_plant_tool_F_X OUTSIDE
#define FROM_plant_tool_F_Y OUTSIDE
#define FROM_plant_tool_F_Z OUTSIDE

/* Feed-through of outputs, where it is other than in the part: x_a is no input here. */
#define FEEDTHROUGH_drive_x_e ~, "(x_s)"
#define FEEDTHROUGH_SECOND(first, second, ...) second
#define FEEDTHROUGH_CHOICE(...) FEEDTHROUGH_SECOND(__VA_ARGS__, "", ~)

#define ROWS_JOIN(a, b) a##b
#define ROWS_JOINED(a, b) ROWS_JOIN(a, b)

/* --- drive, friction, motion: `part` is the name ahead of fields and variables; AXIS_VARIABLE or VARIABLE as `row` */

#define PART_parameter(row, part, kind, field, name, v, start, st, unit, display, min, mint, max, maxt, text)          \
    row(kind, part##_##field, #part "." name, parameter, v, start, st, unit, display, min, mint, max, maxt, "", text)
#define PART_local(row, part, kind, field, name, v, start, st, unit, display, min, mint, max, maxt, text)              \
    row(kind, part##_##field, #part "." name, local, v, start, st, unit, display, min, mint, max, maxt, "", text)
#define PART_output(row, part, kind, field, name, v, start, st, unit, display, min, mint, max, maxt, text)             \
    row(kind, part##_##field, name, output, v, start, st, unit, display, min, mint, max, maxt,                         \
        FEEDTHROUGH_CHOICE(FEEDTHROUGH_##part##_##field), text)
#define PART_input(row, part, kind, field, name, v, start, st, unit, display, min, mint, max, maxt, text)              \
    row(kind, part##_##field, #part "." name, local, v, 0, "0", unit, display, min, mint, max, maxt, "", text)

#define DRIVE_ROW(kind, field, name, c, v, start, st, unit, display, min, mint, max, maxt, depends, text)              \
    PART_##c(AXIS_VARIABLE, drive, kind, field, name, v, start, st, unit, display, min, mint, max, maxt, text)
#define FRICTION_ROW(kind, field, name, c, v, start, st, unit, display, min, mint, max, maxt, depends, text)           \
    PART_##c(AXIS_VARIABLE, friction, kind, field, name, v, start, st, unit, display, min, mint, max, maxt, text)

/* What the setpoint unit gives is a matter within the machine: locals. */
#define MOTION_local(row, kind, field, name, v, start, st, unit, display, min, mint, max, maxt, text)                  \
    row(kind, motion_##field, "motion." name, local, v, start, st, unit, display, min, mint, max, maxt, "", text)
#define MOTION_output MOTION_local
#define MOTION_ROW(kind, field, name, c, v, start, st, unit, display, min, mint, max, maxt, depends, text)             \
    MOTION_##c(VARIABLE, kind, field, name, v, start, st, unit, display, min, mint, max, maxt, text)
#define MOTION_AXIS_ROW(kind, field, name, c, v, start, st, unit, display, min, mint, max, maxt, depends, text)        \
    MOTION_##c(AXIS_VARIABLE, kind, field, name, v, start, st, unit, display, min, mint, max, maxt, text)

/* --- inputs of the drives that come from outside, rows of the machine's own */

#define ENTRY_parameter(...)
#define ENTRY_local(...)
#define ENTRY_output(...)
#define ENTRY_INSIDE(...)
#define ENTRY_OUTSIDE(kind, field, name, v, start, st, unit, display, min, mint, max, maxt, text)                      \
    AXIS_VARIABLE(kind, field, name, input, v, start, st, unit, display, min, mint, max, maxt, "", text)
#define ENTRY_input(kind, field, ...) ROWS_JOINED(ENTRY_, FROM_drive_##field)(kind, field, __VA_ARGS__)
#define ENTRY_ROW(kind, field, name, c, v, start, st, unit, display, min, mint, max, maxt, depends, text)              \
    ENTRY_##c(kind, field, name, v, start, st, unit, display, min, mint, max, maxt, text)

/* --- a row with what macros expand to; the schemes as words of its text */

#define INTEGER_EXPANDED(...) INTEGER_OF(__VA_ARGS__)
#define SCHEME_TEXT(number, name, ...) "; " #number " " #name

/* --- plant */

#define PLANT_parameter(row, kind, field, name, v, start, st, unit, display, min, mint, max, maxt, text)               \
    row(kind, plant_##field, name, parameter, v, start, st, unit, display, min, mint, max, maxt, "", text)
#define PLANT_local(row, kind, field, name, v, start, st, unit, display, min, mint, max, maxt, text)                   \
    row(kind, plant_##field, name, local, v, start, st, unit, display, min, mint, max, maxt, "", text)
#define PLANT_output(row, kind, field, name, v, start, st, unit, display, min, mint, max, maxt, text)                  \
    row(kind, plant_##field, name, output, v, start, st, unit, display, min, mint, max, maxt, "", text)
#define PLANT_INSIDE(row, kind, field, name, v, start, st, unit, display, min, mint, max, maxt, text)                  \
    row(kind, plant_##field, "plant." name, local, v, 0, "0", unit, display, min, mint, max, maxt, "", text)
#define PLANT_OUTSIDE(row, kind, field, name, v, start, st, unit, display, min, mint, max, maxt, text)                 \
    row(kind, plant_##field, name, input, v, start, st, unit, display, min, mint, max, maxt, "", text)
#define PLANT_input(row, kind, field, ...) ROWS_JOINED(PLANT_, FROM_plant_##field)(row, kind, field, __VA_ARGS__)
#define PLANT_ROW(kind, field, name, c, v, start, st, unit, display, min, mint, max, maxt, depends, text)              \
    PLANT_##c(VARIABLE, kind, field, name, v, start, st, unit, display, min, mint, max, maxt, text)
#define PLANT_AXIS_ROW(kind, field, name, c, v, start, st, unit, display, min, mint, max, maxt, depends, text)         \
    PLANT_##c(AXIS_VARIABLE, kind, field, name, v, start, st, unit, display, min, mint, max, maxt, text)

#endif

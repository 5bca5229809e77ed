/* One declaration per variable.
 *
 * A unit describes its interface in ONE file, variables.def, with a row per variable. The rows expand through the
 * macros below; whoever includes variables.def defines VARIABLE (scalar rows) and AXIS_VARIABLE (rows that every axis
 * of the plant repeats) first. From the same rows come the value structs and value references (here), the info table
 * (table.c) and, through the C preprocessor, modelDescription.xml (the packager).
 *
 *   REAL    (symbol, causality, variability, start, unit, display unit, min, max, depends, description)
 *   INTEGER (symbol, causality, variability, start, min, max, depends, description)
 *   BOOLEAN (symbol, causality, variability, start, depends, description)
 *   STRING  (symbol, causality, variability, start, description)
 *
 * REAL_OF, INTEGER_OF and BOOLEAN_OF take a group first: REAL_OF(tool, F_X, ...) is the FMI variable "tool.F_X" and the
 * field tool_F_X. AXIS_REAL and AXIS_BOOLEAN are rows of the axis block: "X.M_a" for axis X; AXIS_REAL_OF(guide, F_C,
 * ...) is "X.guide.F_C".
 *
 * - causality: parameter | input | output | local
 * - variability: fixed | tunable | discrete | continuous
 * - start: a plain number (a string for STRING). Outputs and locals have none in FMI (they are calculated): write 0.
 * - min, max: a plain number, or NO_MIN / NO_MAX
 * - depends: names of the inputs an output reacts to at once (direct feed-through), separated by spaces; in parentheses
 *   those it reacts to in initialisation mode alone, as "(x_s) (x_a)"; "" for none
 */
#ifndef FEEDSIM_TABLE_H
#define FEEDSIM_TABLE_H

#include <math.h>
#include <stddef.h>

#define STRING_SIZE 1024 /* bytes of a String variable, the closing zero included */

#define NO_MIN (-INFINITY)
#define NO_MAX (INFINITY)

/* A unit that holds others as its parts includes their tables in its own, with these two defined anew meanwhile. */
#define SCALAR_ROW(...) VARIABLE(__VA_ARGS__)
#define AXIS_ROW(...) AXIS_VARIABLE(__VA_ARGS__)

/* A unit's own table; of a part of another unit, the name under which it lies there. */
#ifndef UNIT_TABLE
#define UNIT_TABLE "variables.def"
#endif

/* Forwarders: VARIABLE(kind, field, name, causality, variability, start, start text, unit, display unit,
 *                      min, min text, max, max text, depends, description) */
#define REAL(s, c, v, start, unit, display, min, max, depends, text)                                                   \
    SCALAR_ROW(REAL, s, #s, c, v, start, #start, unit, display, min, #min, max, #max, depends, text)
#define REAL_OF(g, s, c, v, start, unit, display, min, max, depends, text)                                             \
    SCALAR_ROW(REAL, g##_##s, #g "." #s, c, v, start, #start, unit, display, min, #min, max, #max, depends, text)
#define INTEGER(s, c, v, start, min, max, depends, text)                                                               \
    SCALAR_ROW(INTEGER, s, #s, c, v, start, #start, "", "", min, #min, max, #max, depends, text)
#define INTEGER_OF(g, s, c, v, start, min, max, depends, text)                                                         \
    SCALAR_ROW(INTEGER, g##_##s, #g "." #s, c, v, start, #start, "", "", min, #min, max, #max, depends, text)
#define BOOLEAN(s, c, v, start, depends, text)                                                                         \
    SCALAR_ROW(BOOLEAN, s, #s, c, v, start, #start, "", "", NO_MIN, "NO_MIN", NO_MAX, "NO_MAX", depends, text)
#define BOOLEAN_OF(g, s, c, v, start, depends, text)                                                                   \
    SCALAR_ROW(BOOLEAN, g##_##s, #g "." #s, c, v, start, #start, "", "", NO_MIN, "NO_MIN", NO_MAX, "NO_MAX", depends,  \
               text)
#define STRING(s, c, v, start, text)                                                                                   \
    SCALAR_ROW(STRING, s, #s, c, v, 0, start, "", "", NO_MIN, "NO_MIN", NO_MAX, "NO_MAX", "", text)
#define AXIS_REAL(s, c, v, start, unit, display, min, max, depends, text)                                              \
    AXIS_ROW(REAL, s, #s, c, v, start, #start, unit, display, min, #min, max, #max, depends, text)
#define AXIS_REAL_OF(g, s, c, v, start, unit, display, min, max, depends, text)                                        \
    AXIS_ROW(REAL, g##_##s, #g "." #s, c, v, start, #start, unit, display, min, #min, max, #max, depends, text)
#define AXIS_BOOLEAN(s, c, v, start, depends, text)                                                                    \
    AXIS_ROW(BOOLEAN, s, #s, c, v, start, #start, "", "", NO_MIN, "NO_MIN", NO_MAX, "NO_MAX", depends, text)

typedef double FIELD_REAL;
typedef int FIELD_INTEGER;
typedef int FIELD_BOOLEAN;
typedef char FIELD_STRING[STRING_SIZE];

/* Scalars: one field per scalar row. */
#define VARIABLE(kind, field, ...) FIELD_##kind field;
#define AXIS_VARIABLE(...)
typedef struct Scalars {
#include UNIT_TABLE
} Scalars;
#undef VARIABLE
#undef AXIS_VARIABLE

/* AxisBlock: one field per axis row; empty in units without axes, hence the placeholder. */
#define VARIABLE(...)
#define AXIS_VARIABLE(kind, field, ...) FIELD_##kind field;
typedef struct AxisBlock {
#include UNIT_TABLE
    char placeholder;
} AxisBlock;
#undef VARIABLE
#undef AXIS_VARIABLE

/* Value references. Axis i's row r has SCALAR_ROWS + i * AXIS_ROWS + r. */
#define VARIABLE(kind, field, ...) VR_##field,
#define AXIS_VARIABLE(...)
enum {
#include UNIT_TABLE
    SCALAR_ROWS
};
#undef VARIABLE
#undef AXIS_VARIABLE

#define VARIABLE(...)
#define AXIS_VARIABLE(kind, field, ...) AXIS_VR_##field,
enum {
#include UNIT_TABLE
    AXIS_ROWS
};
#undef VARIABLE
#undef AXIS_VARIABLE

typedef enum Kind { KIND_REAL, KIND_INTEGER, KIND_BOOLEAN, KIND_STRING } Kind;
typedef enum Causality { CAUSALITY_parameter, CAUSALITY_input, CAUSALITY_output, CAUSALITY_local } Causality;
typedef enum Variability {
    VARIABILITY_fixed,
    VARIABILITY_tunable,
    VARIABILITY_discrete,
    VARIABILITY_continuous
} Variability;

/* A row as the generic code sees it. */
typedef struct VariableInfo {
    const char *name; /* "n_fr"; for an axis row the part after the axis name */
    Kind kind;
    Causality causality;
    Variability variability;
    double start;           /* numeric kinds */
    const char *start_text; /* as spelled in the row; the value of a STRING */
    const char *unit;
    double min, max;
    const char *min_text, *max_text;
    size_t offset; /* of the field in Scalars or AxisBlock */
} VariableInfo;

#endif

/* plant: the mechanical structure of a machine with its feed drives, reduced to modes.
 *
 *   q_k'' + 2 zeta_k omega_k q_k' + omega_k^2 q_k = f_k                                per mode k, mass-normalised
 *   f_k   = sum over axes A of n_kA (M_a - M_fr - M_0) + sum over directions d of tcp_kd F_d
 *   n_a   = n_fr = sum over k of n_kA q_k'             rotor against stator [rad/s]
 *   x_a   = x_0 + sum over k of x_kA q_k               slide against rail, at the linear scale [m]
 *   tool.x_d = sum over k of tcp_kd q_k                tool against workpiece [m]
 *   tcp.x_d  = tool.x_d + x_0 of the axis named d      tool centre point [m]
 *
 *   M_a motor torque, M_fr friction torque, M_0 constant load [N.m]; F_d force on the tool [N]; omega_k = 2 pi
 * frequency n_kA, x_kA, tcp_kd: mode shapes at the ports, columns of the mode table (modes.h)
 *
 * Source: M. Wiesauer, F. Bleicher, "Parameterization method for non-linear friction models of machine tool feed
 * drives", 18th CIRP Conference on Modeling of Machining Operations (2021), section 2.1. Method and limits: README.md.
 *
 * Each mode is advanced exactly for inputs that are linear over the step (modal.h). The state is that of the modes; the
 * inputs at the end of the last step are kept with it, as the accelerations there need them. */
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include "axes.h"
#include "files.h"
#include "hash.h"
#include "modal.h"
#include "modes.h"
#include "resources.h"
#include "unit.h"

#define NO_AXIS ((size_t)-1)
#define MESSAGE_SIZE (STRING_SIZE + 512) /* a message that names modes_file must not lose the fault behind it */

static const double pi = 3.14159265358979323846;

/* Derived data. Ports of the modal system: the axes' n, the tool's directions (inputs up to here), the axes' x. */
typedef struct Plant {
    size_t axes;
    const char **axis_names;           /* [axes] */
    size_t tool_axis[TOOL_DIRECTIONS]; /* axis named like the direction, or NO_AXIS */
    double *archive;                   /* the archive's mode table, rows as modes_read() leaves them */
    size_t archive_modes;
    uint64_t archive_hash;

    bool ready;              /* what follows is set */
    char table[STRING_SIZE]; /* modes_file that the modal system was made from */
    uint64_t table_hash;     /* of the table's bytes */
    Modal modal;
    double *memory; /* of the modal system and the scratch of a step */
    double *u, *du; /* [inputs] */
    double *end;    /* [state's doubles] a step's result, until it is known to be sound */
    double *y;      /* [ports] */
} Plant;

/* State block: this head, then inputs at the end of the last step [inputs], q [modal.size], v [modal.size]. */
typedef struct StateHead {
    uint64_t table_hash; /* mode table that the state belongs to */
} StateHead;

static size_t plant_inputs(const Plant *plant) {
    return plant->axes + TOOL_DIRECTIONS;
}

static size_t plant_ports(const Plant *plant) {
    return plant->axes + TOOL_DIRECTIONS + plant->axes;
}

static size_t plant_state_doubles(const Plant *plant) {
    return plant_inputs(plant) + 2 * plant->modal.size;
}

static double *plant_state(Unit *unit) {
    return (double *)((StateHead *)unit_state(unit) + 1);
}

/* --- load and derive ---------------------------------------------------------------------------------------------- */

static size_t plant_axis_named(const Plant *plant, const char *name) {
    for (size_t i = 0; i < plant->axes; i++) {
        if (strcmp(plant->axis_names[i], name) == 0) {
            return i;
        }
    }
    return NO_AXIS;
}

static bool plant_name_axes(Unit *unit, Plant *plant, const AxisRow *rows) {
    plant->axis_names = unit_alloc(unit, plant->axes, sizeof *plant->axis_names);
    if (plant->axis_names == NULL) {
        return false;
    }
    for (size_t i = 0; i < plant->axes; i++) {
        plant->axis_names[i] = rows[i].name;
    }
    if (!unit_set_axes(unit, plant->axes, plant->axis_names)) {
        return false;
    }
    for (size_t i = 0; i < plant->axes; i++) {
        plant->axis_names[i] = unit_axis_name(unit, i); /* the shell's copy, which lives on */
        unit_axis(unit, i)->x_0 = rows[i].x_0;
    }
    plant->tool_axis[0] = plant_axis_named(plant, "X");
    plant->tool_axis[1] = plant_axis_named(plant, "Y");
    plant->tool_axis[2] = plant_axis_named(plant, "Z");
    return true;
}

static bool plant_load_axes(Unit *unit, Plant *plant, const Resources *resources) {
    char source[64], message[MESSAGE_SIZE];
    snprintf(source, sizeof source, "%saxes.csv", resources->source);
    AxisRow *rows = unit_alloc(unit, axes_capacity(resources->axes, resources->axes_size), sizeof *rows);
    if (rows == NULL) {
        return false;
    }
    const bool good =
        axes_read(resources->axes, resources->axes_size, source, rows, &plant->axes, message, sizeof message)
            ? plant_name_axes(unit, plant, rows)
            : unit_fail(unit, "%s", message);
    unit_free(unit, rows);
    return good;
}

/* Mode table of a text as values (see modes.h), to be freed with unit_free(); NULL with the fault logged. */
static double *plant_table(Unit *unit, const Plant *plant, const char *text, size_t size, const char *source,
                           size_t *modes) {
    char message[MESSAGE_SIZE];
    double *values = unit_alloc(unit, modes_capacity(text, size) * modes_width(plant->axes), sizeof *values);
    if (values != NULL &&
        !modes_read(text, size, source, plant->axes, plant->axis_names, values, modes, message, sizeof message)) {
        unit_fail(unit, "%s", message);
        unit_free(unit, values);
        values = NULL;
    }
    return values;
}

static bool plant_load(Unit *unit) {
    Plant *plant = unit_alloc(unit, 1, sizeof *plant);
    if (plant == NULL) {
        return false;
    }
    unit_set_derived(unit, plant);
    Resources resources;
    if (!resources_load(unit, &resources)) {
        return false;
    }
    if (plant_load_axes(unit, plant, &resources)) {
        char source[64];
        snprintf(source, sizeof source, "%smodes.csv", resources.source);
        plant->archive_hash = hash_bytes(HASH_OF_NOTHING, resources.modes, resources.modes_size);
        plant->archive = plant_table(unit, plant, resources.modes, resources.modes_size, source, &plant->archive_modes);
    }
    resources_free(unit, &resources);
    return plant->archive != NULL;
}

/* The modal system of a mode table, and the scratch that its steps need. */
static bool plant_build(Unit *unit, Plant *plant, const double *values, size_t modes) {
    const size_t inputs = plant_inputs(plant), ports = plant_ports(plant), width = modes_width(plant->axes);
    const size_t system = modal_memory(modes, ports);
    const size_t scratch = 2 * inputs + ports + inputs + 2 * modal_padded(modes);
    double *memory = unit_alloc(unit, system + scratch, sizeof *memory);
    if (memory == NULL) {
        return false;
    }
    unit_free(unit, plant->memory);
    plant->memory = memory;
    modal_place(&plant->modal, memory, modes, ports);
    plant->u = memory + system;
    plant->du = plant->u + inputs;
    plant->y = plant->du + inputs;
    plant->end = plant->y + ports;
    for (size_t k = 0; k < modes; k++) {
        const double *row = values + k * width;
        modal_set_mode(&plant->modal, k, 2 * pi * row[MODES_FREQUENCY], row[MODES_DAMPING], row + MODES_SHAPES);
    }
    return true;
}

static bool plant_build_from_file(Unit *unit, Plant *plant, const char *path, uint64_t *hash) {
    size_t size, modes;
    char *text = file_read(unit, NULL, path, &size);
    if (text == NULL) {
        return unit_fail(unit, "parameter 'modes_file': %s cannot be read", path);
    }
    char source[STRING_SIZE + 32];
    snprintf(source, sizeof source, "parameter 'modes_file': %s", path);
    double *values = plant_table(unit, plant, text, size, source, &modes);
    const bool good = values != NULL && plant_build(unit, plant, values, modes);
    *hash = hash_bytes(HASH_OF_NOTHING, text, size);
    unit_free(unit, values);
    unit_free(unit, text);
    return good;
}

/* A file is read once for an instance as long as modes_file keeps its value: a state that is restored must find the
 * table it was made with, whatever has become of the file. */
static bool plant_derive(Unit *unit) {
    Plant *plant = unit_derived(unit);
    const char *path = unit_scalars(unit)->modes_file;
    if (plant->ready && strcmp(plant->table, path) == 0) {
        return true;
    }
    uint64_t hash = plant->archive_hash;
    const bool good = path[0] == '\0' ? plant_build(unit, plant, plant->archive, plant->archive_modes)
                                      : plant_build_from_file(unit, plant, path, &hash);
    if (good) {
        plant->ready = true;
        plant->table_hash = hash;
        snprintf(plant->table, sizeof plant->table, "%s", path);
    }
    return good;
}

/* Hash of the table that plant_derive() would take for this modes_file; false with the reason logged. */
static bool plant_find_table(Unit *unit, const Plant *plant, const char *path, uint64_t *hash) {
    if (path[0] == '\0' || (plant->ready && strcmp(plant->table, path) == 0)) {
        *hash = path[0] == '\0' ? plant->archive_hash : plant->table_hash;
        return true;
    }
    size_t size;
    char *text = file_read(unit, NULL, path, &size);
    if (text == NULL) {
        return unit_fail(unit, "the state needs its mode table, parameter 'modes_file': %s cannot be read", path);
    }
    *hash = hash_bytes(HASH_OF_NOTHING, text, size);
    unit_free(unit, text);
    return true;
}

static bool plant_accepts(Unit *unit, const Scalars *scalars, const void *state, size_t size) {
    StateHead head;
    if (size < sizeof head) {
        return unit_fail(unit, "the state holds %.0f bytes of model state, its head alone has %.0f", (double)size,
                         (double)sizeof head);
    }
    memcpy(&head, state, sizeof head);
    uint64_t found = 0;
    if (!plant_find_table(unit, unit_derived(unit), scalars->modes_file, &found)) {
        return false;
    }
    if (found != head.table_hash) {
        char text[2][HASH_TEXT_SIZE];
        return unit_fail(unit,
                         "the state belongs to other contents of the mode table (modes_file '%s', hash %s) than this "
                         "instance finds there (hash %s)",
                         scalars->modes_file, hash_text(text[0], head.table_hash), hash_text(text[1], found));
    }
    return true;
}

static size_t plant_state_size(const Unit *unit) {
    return sizeof(StateHead) + plant_state_doubles(unit_derived(unit)) * sizeof(double);
}

static void plant_release(Unit *unit) {
    Plant *plant = unit_derived(unit);
    if (plant != NULL) {
        unit_free(unit, plant->memory);
        unit_free(unit, plant->archive);
        unit_free(unit, plant->axis_names);
        unit_free(unit, plant);
        unit_set_derived(unit, NULL);
    }
}

/* --- start and step ----------------------------------------------------------------------------------------------- */

static double plant_start_position(Unit *unit, const Plant *plant, size_t direction) {
    const size_t axis = plant->tool_axis[direction];
    return axis == NO_AXIS ? 0 : unit_axis(unit, axis)->x_0;
}

/* Inputs at the ports, u, and their change du over a step of h. */
static void plant_gather(Unit *unit, double h, double *u, double *du) {
    const Scalars *v = unit_scalars(unit);
    const size_t axes = unit_axes(unit);
    for (size_t i = 0; i < axes; i++) {
        const AxisBlock *axis = unit_axis(unit, i);
        const unsigned row = (unsigned)(SCALAR_ROWS + i * AXIS_ROWS);
        u[i] = axis->M_a - axis->M_fr - axis->M_0;
        du[i] = h * (unit_slope(unit, row + AXIS_VR_M_a) - unit_slope(unit, row + AXIS_VR_M_fr));
    }
    u[axes] = v->tool_F_X;
    u[axes + 1] = v->tool_F_Y;
    u[axes + 2] = v->tool_F_Z;
    du[axes] = h * unit_slope(unit, VR_tool_F_X);
    du[axes + 1] = h * unit_slope(unit, VR_tool_F_Y);
    du[axes + 2] = h * unit_slope(unit, VR_tool_F_Z);
}

/* Speeds at the axes' rotors and displacements elsewhere, y[ports]; false where one is no finite number. */
static bool plant_measure(const Plant *plant, const double *q, const double *v, double *y) {
    const size_t ports = plant_ports(plant);
    bool finite = true;
    for (size_t port = 0; port < ports; port++) {
        y[port] = modal_sum(&plant->modal, port, port < plant->axes ? v : q);
        finite = finite && isfinite(y[port]);
    }
    return finite;
}

static void plant_show(Unit *unit, const Plant *plant, const double *y) {
    Scalars *v = unit_scalars(unit);
    const double *tool = y + plant->axes, *x = tool + TOOL_DIRECTIONS;
    for (size_t i = 0; i < plant->axes; i++) {
        AxisBlock *axis = unit_axis(unit, i);
        axis->n_a = y[i];
        axis->n_fr = y[i];
        axis->x_a = axis->x_0 + x[i];
    }
    v->tool_x_X = tool[0];
    v->tool_x_Y = tool[1];
    v->tool_x_Z = tool[2];
    v->tcp_x_X = plant_start_position(unit, plant, 0) + tool[0];
    v->tcp_x_Y = plant_start_position(unit, plant, 1) + tool[1];
    v->tcp_x_Z = plant_start_position(unit, plant, 2) + tool[2];
}

static void plant_start(Unit *unit) {
    Plant *plant = unit_derived(unit);
    double *u = plant_state(unit), *q = u + plant_inputs(plant), *v = q + plant->modal.size;
    ((StateHead *)unit_state(unit))->table_hash = plant->table_hash;
    plant_gather(unit, 0, u, plant->du);
    plant_measure(plant, q, v, plant->y);
    plant_show(unit, plant, plant->y);
}

static bool plant_step(Unit *unit, double t, double h) {
    (void)t; /* the structure does not change with time */
    Plant *plant = unit_derived(unit);
    const size_t inputs = plant_inputs(plant), size = plant->modal.size;
    double *state = plant_state(unit), *end = plant->end;
    plant_gather(unit, h, plant->u, plant->du);
    size_t active = plant->axes; /* mostly, no force is on the tool: nothing to add then */
    for (size_t i = 0; i < inputs; i++) {
        end[i] = plant->u[i] + plant->du[i];
        if (i >= active && (plant->u[i] < 0 || plant->u[i] > 0 || plant->du[i] < 0 || plant->du[i] > 0)) {
            active = inputs;
        }
    }
    modal_prepare(&plant->modal, h);
    modal_advance(&plant->modal, active, plant->u, plant->du, state + inputs, state + inputs + size, end + inputs,
                  end + inputs + size);
    if (!plant_measure(plant, end + inputs, end + inputs + size, plant->y)) {
        return unit_fail(unit, "an output would be no finite number at the end of the step");
    }
    memcpy(state, end, plant_state_doubles(plant) * sizeof *state);
    plant_show(unit, plant, plant->y);
    return true;
}

/* --- derivatives -------------------------------------------------------------------------------------------------- */

static double plant_output_derivative(Unit *unit, unsigned vr) {
    const Plant *plant = unit_derived(unit);
    const size_t inputs = plant_inputs(plant);
    const double *u = plant_state(unit), *q = u + inputs, *v = q + plant->modal.size;
    switch (vr) {
    case VR_tool_x_X:
    case VR_tcp_x_X:
        return modal_sum(&plant->modal, plant->axes, v);
    case VR_tool_x_Y:
    case VR_tcp_x_Y:
        return modal_sum(&plant->modal, plant->axes + 1, v);
    case VR_tool_x_Z:
    case VR_tcp_x_Z:
        return modal_sum(&plant->modal, plant->axes + 2, v);
    default:
        break;
    }
    if (vr < SCALAR_ROWS) {
        return 0;
    }
    const size_t axis = (vr - SCALAR_ROWS) / AXIS_ROWS;
    switch ((vr - SCALAR_ROWS) % AXIS_ROWS) {
    case AXIS_VR_n_a:
    case AXIS_VR_n_fr:
        return modal_acceleration(&plant->modal, axis, inputs, u, q, v);
    case AXIS_VR_x_a:
        return modal_sum(&plant->modal, inputs + axis, v);
    default:
        return 0;
    }
}

/* The torques and forces act on accelerations: no output reacts at once. */
static double plant_partial(Unit *unit, unsigned output, unsigned input, bool initial) {
    (void)unit;
    (void)output;
    (void)input;
    (void)initial;
    return 0;
}

const Model MODEL = {
    .identifier = "plant",
    .has_resources = true,
    .load = plant_load,
    .derive = plant_derive,
    .state_size = plant_state_size,
    .accepts = plant_accepts,
    .start = plant_start,
    .step = plant_step,
    .output_derivative = plant_output_derivative,
    .partial = plant_partial,
    .release = plant_release,
};

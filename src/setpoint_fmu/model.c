/* setpoint: plays a table of position setpoints x_s [m] and speed feedforwards n_ffw [rad/s].
 *
 *   r = floor((t - t_start - t_0) / T_pos), from 0 to the last row           row that holds at the communication point
 * t A.x_s, A.n_ffw = columns of axis A in row r                              held from row to row
 *   A.release = true                                                         there are setpoints from the start on
 *
 *   t_start start of the experiment, t_0 time of the first row, T_pos time from row to row [s]
 *
 * The row follows from the time of the communication point alone: nothing is counted up, nothing can drift, and there
 * is no state but the time. Format, timing and limits: README.md. */
#include <math.h>

#include "load.h"

static size_t setpoint_state_size(const Unit *unit) {
    (void)unit;
    return 0;
}

static bool setpoint_derive(Unit *unit) {
    (void)unit; /* there is no parameter: the table is that of the archive */
    return true;
}

static void setpoint_show(Unit *unit, const Setpoints *table, size_t row) {
    Scalars *v = unit_scalars(unit);
    const double *values = table->values + row * table->width + 1;
    v->row = (int)row;
    v->finished = row == table->rows - 1;
    for (size_t i = 0; i < table->axes; i++) {
        AxisBlock *axis = unit_axis(unit, i);
        axis->x_s = values[2 * i];
        axis->n_ffw = values[2 * i + 1];
        axis->release = 1;
    }
}

static void setpoint_start(Unit *unit) {
    const Setpoints *table = unit_derived(unit);
    Scalars *v = unit_scalars(unit);
    v->T_pos = table->cycle;
    v->duration = table->values[(table->rows - 1) * table->width];
    setpoint_show(unit, table, setpoints_row(table, 0, setpoints_slack(table, 0, INFINITY)));
}

static bool setpoint_step(Unit *unit, double t, double h) {
    const Setpoints *table = unit_derived(unit);
    const double end = t + h;
    const size_t row = setpoints_row(table, end - unit_start_time(unit), setpoints_slack(table, end, h));
    if ((int)row != unit_scalars(unit)->row) { /* else it is shown already */
        setpoint_show(unit, table, row);
    }
    return true;
}

/* Values are held; the jumps between them have no derivative. */
static double setpoint_output_derivative(Unit *unit, unsigned vr) {
    (void)unit;
    (void)vr;
    return 0;
}

static double setpoint_partial(Unit *unit, unsigned output, unsigned input, bool initial) {
    (void)unit; /* there is no input */
    (void)output;
    (void)input;
    (void)initial;
    return 0;
}

const Model MODEL = {
    .identifier = "setpoint",
    .has_resources = true,
    .load = setpoint_load,
    .derive = setpoint_derive,
    .state_size = setpoint_state_size,
    .start = setpoint_start,
    .step = setpoint_step,
    .output_derivative = setpoint_output_derivative,
    .partial = setpoint_partial,
    .release = setpoint_release,
};

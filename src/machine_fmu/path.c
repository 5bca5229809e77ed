/* Setpoints from outside between the points at which an importer gives them.
 *
 *   setpoints.delay = 0   x_s(t) = x_s + slope (t - t_i), n_ffw likewise: by the input derivatives, held without them
 *   setpoints.delay > 0   x_s(t) = p(t - delay), n_ffw likewise; p: cubic through the four samples around that time
 *   n_ffw_inside          n_ffw(t) = dx_s/dt / I_P of that path; of held setpoints, of the cubic through the last four
 *
 *   t_i start of the step; I_P lead of the axis [m/rad]; a sample is what is set at t_i
 *
 * The cubic is Lagrange's, for samples at any distance: its error falls with the fourth power of that. With a delay of
 * two steps the time lies between the second and the third newest sample, the best place; one step is the least, since
 * a path ahead of the newest sample would be a guess. */
#include <math.h>
#include <string.h>

#include "machine.h"
#include "numbers.h"

enum { POINTS = 4 }; /* of a cubic */

bool machine_path_used(const Scalars *v) {
    return !v->motion_built_in && (v->setpoints_delay > 0 || v->setpoints_n_ffw_inside);
}

/* Least distance of two samples but the newest [s]. Position setpoints change every position cycle at the most. */
static double path_spacing(Unit *unit) {
    const double T_pos = unit_axis(unit, 0)->drive_T_pos, part = unit_scalars(unit)->setpoints_delay / SAMPLES_IN_DELAY;
    return T_pos > part ? T_pos : part;
}

/* Before the first sample everything stood where it was then. */
static void path_begin(Unit *unit, double t) {
    StateHead *head = machine_head(unit);
    const double spacing = path_spacing(unit);
    for (size_t k = 0; k < SAMPLES; k++) {
        head->sample_t[k] = t - (double)(k + 1) * spacing;
    }
    for (size_t i = 0; i < unit_axes(unit); i++) {
        AxisState *own = &machine_axis_states(unit)[i];
        for (size_t k = 0; k < SAMPLES; k++) {
            own->x_s[k] = unit_axis(unit, i)->x_s;
            own->n_ffw[k] = 0;
        }
    }
    head->sampled = 1;
}

bool machine_path_take(Unit *unit, double t, double h) {
    StateHead *head = machine_head(unit);
    const double delay = unit_scalars(unit)->setpoints_delay;
    if (delay > 0 && h > delay * (1 + 1e-9)) {
        char text[2][NUMBER_TEXT_SIZE];
        return unit_fail(unit,
                         "the step is %s s long, setpoints.delay is %s s; setpoints cannot be known ahead of their "
                         "newest sample: allowed are steps up to the delay",
                         number_text(text[0], h), number_text(text[1], delay));
    }
    if (!head->sampled) {
        path_begin(unit, t);
    }
    const bool kept = head->sample_t[0] - head->sample_t[1] > path_spacing(unit) * (1 - 1e-6);
    if (kept) {
        memmove(head->sample_t + 1, head->sample_t, (SAMPLES - 1) * sizeof *head->sample_t);
    }
    head->sample_t[0] = t;
    for (size_t i = 0; i < unit_axes(unit); i++) {
        AxisState *own = &machine_axis_states(unit)[i];
        if (kept) {
            memmove(own->x_s + 1, own->x_s, (SAMPLES - 1) * sizeof *own->x_s);
            memmove(own->n_ffw + 1, own->n_ffw, (SAMPLES - 1) * sizeof *own->n_ffw);
        }
        own->x_s[0] = unit_axis(unit, i)->x_s;
        own->n_ffw[0] = unit_axis(unit, i)->n_ffw;
    }
    return true;
}

/* The first of the four samples around t. */
static size_t path_points(const StateHead *head, double t) {
    size_t older = 0; /* the newest sample that is not behind t */
    while (older < SAMPLES - 1 && head->sample_t[older] > t) {
        older++;
    }
    const size_t first = older > 2 ? older - 2 : 0;
    return first < SAMPLES - POINTS ? first : SAMPLES - POINTS;
}

/* Value at t of the cubic through four samples, and its slope. */
static double path_cubic(const double *t_i, const double *y, double t, double *slope) {
    double value = y[0]; /* differences from it: not a digit is lost on where the axis stands */
    *slope = 0;
    for (size_t i = 1; i < POINTS; i++) {
        double scale = 1, product = 1, by_t = 0; /* prod of (t - t_j) over j != i, and its derivative */
        for (size_t j = 0; j < POINTS; j++) {
            if (j != i) {
                scale *= t_i[i] - t_i[j];
                by_t = by_t * (t - t_i[j]) + product;
                product *= t - t_i[j];
            }
        }
        value += product / scale * (y[i] - y[0]);
        *slope += by_t / scale * (y[i] - y[0]);
    }
    return value;
}

static void path_late(Unit *unit, AxisBlock *axis, const AxisState *own, double t) {
    const StateHead *head = machine_head(unit);
    const double oldest = head->sample_t[SAMPLES - 1], newest = head->sample_t[0];
    const double at = t < oldest ? oldest : t > newest ? newest : t;
    const size_t first = path_points(head, at);
    double slope;
    axis->drive_x_s = path_cubic(head->sample_t + first, own->x_s + first, at, &slope);
    axis->drive_n_ffw = unit_scalars(unit)->setpoints_n_ffw_inside
                            ? slope / axis->drive_I_P
                            : path_cubic(head->sample_t + first, own->n_ffw + first, at, &slope);
}

void machine_path_tell(Unit *unit, size_t i, double t, double t_k) {
    AxisBlock *axis = unit_axis(unit, i);
    const AxisState *own = &machine_axis_states(unit)[i];
    const Scalars *v = unit_scalars(unit);
    const unsigned first = (unsigned)(SCALAR_ROWS + i * AXIS_ROWS);
    if (v->setpoints_delay > 0) {
        path_late(unit, axis, own, t_k - v->setpoints_delay);
        return;
    }
    axis->drive_x_s = axis->x_s;
    axis->drive_n_ffw = axis->n_ffw;
    if (unit_sloped(unit)) {
        axis->drive_x_s += unit_slope(unit, first + AXIS_VR_x_s) * (t_k - t);
        axis->drive_n_ffw += unit_slope(unit, first + AXIS_VR_n_ffw) * (t_k - t);
    }
    if (v->setpoints_n_ffw_inside) {
        double slope = unit_slope(unit, first + AXIS_VR_x_s);
        if (!unit_sloped(unit)) {
            path_cubic(machine_head(unit)->sample_t, own->x_s, t, &slope);
        }
        axis->drive_n_ffw = slope / axis->drive_I_P;
    }
}

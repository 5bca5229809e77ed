/* A model without physics, for tests of the shell. u, w and F are linear over a step:
 *   x' = gain u + offset (u negative where inverted, 0 where b holds),  y = x + feed u + w,  s = F - load */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "unit.h"

typedef struct Toy {
    double gain;
    int derivations;
} Toy;

typedef struct ToyState {
    double x;
    double u_end; /* at the end of the last step, slopes included */
    int steps;
    double history[8]; /* as many as there are cells */
} ToyState;

static bool toy_load(Unit *unit) {
    static const char *const names[] = {"A", "B"};
    if (unit_resources(unit) != NULL && strstr(unit_resources(unit), "refused") != NULL) {
        return unit_fail(unit, "resources in %s are refused, 100 %% sure, see #1", unit_resources(unit));
    }
    if (!unit_set_axes(unit, 2, names)) {
        return false;
    }
    unit_axis(unit, 1)->load = -0.5; /* per-axis start value, as a machine's data would give it */
    return true;
}

static bool toy_derive(Unit *unit) {
    const Scalars *v = unit_scalars(unit);
    if (strcmp(v->label, "refused") == 0) {
        return unit_fail(unit, "label '%s' is refused", v->label);
    }
    if (v->gain == 13 || v->offset >= v->feed + 5) {
        return unit_fail(unit, "gain %g, offset %g and feed %g do not go together", v->gain, v->offset, v->feed);
    }
    Toy *toy = unit_derived(unit);
    if (toy == NULL) {
        toy = unit_alloc(unit, 1, sizeof *toy);
        if (toy == NULL) {
            return false;
        }
        unit_set_derived(unit, toy);
    }
    toy->gain = v->inverted ? -v->gain : v->gain;
    toy->derivations++;
    return true;
}

static size_t toy_state_size(const Unit *unit) {
    return offsetof(ToyState, history) + (size_t)unit_scalars((Unit *)unit)->cells * sizeof(double);
}

static void toy_write(Unit *unit, double h) {
    Scalars *v = unit_scalars(unit);
    const ToyState *state = unit_state(unit);
    v->x = state->x;
    v->y = state->x + v->feed * state->u_end + v->w + unit_slope(unit, VR_w) * h;
    v->twice = 2 * v->y;
    v->late = state->history[v->cells - 1];
    v->steps = state->steps;
    v->positive = state->x > 0;
    v->derivations = ((const Toy *)unit_derived(unit))->derivations;
    for (size_t i = 0; i < unit_axes(unit); i++) {
        unsigned input = (unsigned)SCALAR_ROWS + (unsigned)i * AXIS_ROWS + AXIS_VR_F;
        unit_axis(unit, i)->s = unit_axis(unit, i)->F + unit_slope(unit, input) * h - unit_axis(unit, i)->load;
    }
}

static void toy_start(Unit *unit) {
    ToyState *state = unit_state(unit);
    for (int i = 0; i < unit_scalars(unit)->cells; i++) {
        state->history[i] += 100; /* shows where the state does not arrive zeroed */
    }
    state->u_end = unit_scalars(unit)->u;
    toy_write(unit, 0);
}

static bool toy_step(Unit *unit, double t, double h) {
    const Scalars *v = unit_scalars(unit);
    const Toy *toy = unit_derived(unit);
    ToyState *state = unit_state(unit);
    double slope = unit_slope(unit, VR_u), u_end = v->u + slope * h;
    if (fabs(u_end) > v->limit_u) {
        return unit_fail(unit, "the speed of %g at %g exceeds the limit of %g", u_end, t + h, v->limit_u);
    }
    memmove(state->history + 1, state->history, (size_t)(v->cells - 1) * sizeof(double));
    state->history[0] = state->x;
    if (!v->b) {
        state->x += (toy->gain * (v->u + u_end) / 2 + v->offset) * h;
    }
    state->u_end = u_end;
    state->steps++;
    if (v->i == -3) {
        unit_warn(unit, "i is %d", v->i);
    }
    toy_write(unit, h);
    return true;
}

static double toy_output_derivative(Unit *unit, unsigned vr) {
    const ToyState *state = unit_state(unit);
    return vr == VR_x ? ((const Toy *)unit_derived(unit))->gain * state->u_end + unit_scalars(unit)->offset : 0;
}

static double toy_partial(Unit *unit, unsigned output, unsigned input, bool initial) {
    (void)initial;
    const Scalars *v = unit_scalars(unit);
    if (output == VR_y) {
        return input == VR_u ? v->feed : input == VR_w ? 1 : 0;
    }
    for (unsigned first = SCALAR_ROWS; first < SCALAR_ROWS + 2 * AXIS_ROWS; first += AXIS_ROWS) {
        if (output == first + AXIS_VR_s && input == first + AXIS_VR_F) {
            return 1;
        }
    }
    return 0;
}

static void toy_release(Unit *unit) {
    unit_free(unit, unit_derived(unit));
}

/* A saved state after 13 steps is of other data. */
static bool toy_accepts(Unit *unit, const Scalars *scalars, const void *state, size_t size) {
    const ToyState *saved = state;
    if (size < offsetof(ToyState, history)) {
        return unit_fail(unit, "the state holds %.0f bytes", (double)size);
    }
    return saved->steps != 13 || unit_fail(unit, "state of label '%s' after 13 steps is refused", scalars->label);
}

const Model MODEL = {.identifier = "toy",
                     .load = toy_load,
                     .derive = toy_derive,
                     .state_size = toy_state_size,
                     .accepts = toy_accepts,
                     .start = toy_start,
                     .step = toy_step,
                     .output_derivative = toy_output_derivative,
                     .partial = toy_partial,
                     .release = toy_release};

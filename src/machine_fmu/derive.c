/* Parameters to coefficients, part by part; where the parts' states lie; which saved states belong to them. */
#include <math.h>
#include <string.h>

#include "instants.h"
#include "machine.h"
#include "numbers.h"

#define ALIGNED(size) (((size) + 15) / 16 * 16)

#define SCHEME(number, name, stable, speed, ...) [number] = {SPEED_##speed, __VA_ARGS__},
const Scheme machine_schemes[LAST_SCHEME + 1] = {SCHEMES(SCHEME)};
#undef SCHEME

/* --- where the parts find theirs */

static size_t contact_place(size_t axis) {
    return 1 + axis;
}

static size_t drive_place(const Machine *machine, size_t axis) {
    return 1 + machine->axes + axis;
}

static size_t end_place(const Machine *machine) {
    return 1 + 2 * machine->axes;
}

void machine_bind(Unit *unit, bool with_states) {
    Machine *machine = unit_derived(unit);
    unsigned char *scalars = (unsigned char *)unit_scalars(unit), *state = with_states ? unit_state(unit) : NULL;
    unsigned char *first = machine->axes > 0 ? (unsigned char *)unit_axis(unit, 0) : NULL;
    const double start_time = unit_start_time(unit);
    if (state != NULL && state == machine->bound && start_time == machine->plant.start_time) {
        return; /* as they were: no step of many is to pay for it */
    }
    machine->bound = state;
    machine->plant.scalars = scalars + offsetof(Scalars, plant_modes_file);
    machine->plant.axis_block = first + offsetof(AxisBlock, plant_M_a);
    machine->motion.scalars = scalars + offsetof(Scalars, motion_finished);
    machine->motion.axis_block = first + offsetof(AxisBlock, motion_x_s);
    machine->plant.axis_stride = machine->motion.axis_stride = sizeof(AxisBlock);
    machine->plant.start_time = machine->motion.start_time = start_time;
    machine->plant.state = with_states ? state + machine->places[0] : NULL;
    for (size_t i = 0; machine->drives != NULL && i < machine->axes; i++) {
        Part *drive = &machine->drives[i], *contact = &machine->contacts[i];
        unsigned char *axis = (unsigned char *)unit_axis(unit, i);
        drive->scalars = axis + offsetof(AxisBlock, drive_x_s);
        contact->scalars = axis + offsetof(AxisBlock, friction_n_fr);
        drive->start_time = contact->start_time = start_time;
        contact->state = with_states ? state + machine->places[contact_place(i)] : NULL;
        drive->state = with_states ? state + machine->places[drive_place(machine, i)] : NULL;
    }
}

/* --- parameters */

static bool one_cycle(Unit *unit, const Machine *machine) {
    const double T_c = unit_axis(unit, 0)->drive_T_c;
    for (size_t i = 1; i < machine->axes; i++) {
        const double other = unit_axis(unit, i)->drive_T_c;
        if (other < T_c || other > T_c) {
            char text[2][NUMBER_TEXT_SIZE];
            return unit_fail(
                unit,
                "parameter '%s.drive.T_c' is %s s and '%s.drive.T_c' is %s s; the drives of a machine have "
                "one control cycle",
                unit_axis_name(unit, i), number_text(text[0], other), unit_axis_name(unit, 0),
                number_text(text[1], T_c));
        }
    }
    return true;
}

static bool derive_parts(Machine *machine) {
    bool good = plant_part.derive(&machine->plant) && (!machine->has_motion || setpoint_part.derive(&machine->motion));
    for (size_t i = 0; good && i < machine->axes; i++) {
        good = controller_part.derive(&machine->drives[i]) && friction_part.derive(&machine->contacts[i]);
    }
    return good;
}

static void lay_out_parts(Machine *machine) {
    size_t at = ALIGNED(sizeof(StateHead) + machine->axes * sizeof(AxisState)), part = 0;
    machine->places[part++] = at;
    at += ALIGNED(plant_part.state_size(&machine->plant));
    for (size_t i = 0; i < machine->axes; i++) {
        machine->places[part++] = at;
        at += ALIGNED(friction_part.state_size(&machine->contacts[i]));
    }
    for (size_t i = 0; i < machine->axes; i++) {
        machine->places[part++] = at;
        at += ALIGNED(controller_part.state_size(&machine->drives[i]));
    }
    machine->places[part] = at;
}

/* Memory for what a step that is taken again goes back to: the states of plant and friction, and their variables. */
static bool keep_room(Unit *unit, Machine *machine) {
    const size_t size = machine->places[drive_place(machine, 0)] + sizeof(Scalars) + machine->axes * sizeof(AxisBlock);
    if (machine->scheme->passes < 2 || size <= machine->kept_size) {
        return true;
    }
    unit_free(unit, machine->kept);
    machine->kept_size = 0;
    machine->kept = unit_alloc(unit, size, 1);
    machine->kept_size = machine->kept != NULL ? size : 0;
    return machine->kept != NULL;
}

bool machine_derive(Unit *unit) {
    Machine *machine = unit_derived(unit);
    const Scalars *v = unit_scalars(unit);
    if (machine->places == NULL) {
        machine->places = unit_alloc(unit, 2 + 2 * machine->axes, sizeof *machine->places);
    }
    if (machine->vectors == NULL) {
        machine->vectors = unit_alloc(unit, machine_scratch(machine->axes), sizeof *machine->vectors);
    }
    if (machine->places == NULL || machine->vectors == NULL) {
        return false;
    }
    if (v->motion_built_in && !machine->has_motion) {
        return unit_fail(unit, "parameter 'motion.built_in' is true, but the archive holds no motion "
                               "(resources/setpoints.csv)");
    }
    machine_bind(unit, false);
    if (!one_cycle(unit, machine) || !derive_parts(machine)) {
        return false;
    }
    machine->T_c = unit_axis(unit, 0)->drive_T_c;
    machine->scheme = &machine_schemes[v->coupling_scheme];
    machine->substeps = (size_t)v->coupling_substeps;
    lay_out_parts(machine);
    return keep_room(unit, machine);
}

/* --- saved states */

static bool parts_accept(Machine *machine, const Scalars *scalars, const unsigned char *state) {
    const size_t *places = machine->places;
    const void *plant = (const unsigned char *)scalars + offsetof(Scalars, plant_modes_file);
    if (!plant_part.accepts(&machine->plant, plant, state + places[0], places[1] - places[0])) {
        return false;
    }
    /* The drives have worked the instants of the cycles, each of them. */
    const Clock clock = unit_clock_behind(machine->plant.host, scalars);
    const int64_t cycle = ((const StateHead *)(const void *)state)->cycle;
    for (size_t i = 0; i < machine->axes; i++) {
        const unsigned char *axis = (const unsigned char *)unit_axis_behind(scalars, i);
        machine->drives[i].clock.start = clock.start;
        machine->drives[i].clock.time = clock.start + (double)cycle * machine->T_c;
        machine->drives[i].clock.valid = clock.valid;
        const size_t at = places[drive_place(machine, i)], size = places[drive_place(machine, i) + 1] - at;
        if (!controller_part.accepts(&machine->drives[i], axis + offsetof(AxisBlock, drive_x_s), state + at, size)) {
            return false;
        }
    }
    return true;
}

/* The clock, the cycles worked and where in the last one the clock stands. */
static bool clock_agrees(Unit *unit, const Scalars *scalars, const StateHead *head) {
    const double T_c = unit_axis_behind(scalars, 0)->drive_T_c;
    const Clock clock = unit_clock_behind(unit, scalars);
    if (!instants_agree(unit, clock, head->cycle, T_c)) {
        return false;
    }
    const double share = machine_share(clock.start + (double)head->cycle * T_c - clock.time, T_c);
    const double rounding = 2 * INSTANTS_ROUNDING + INSTANTS_GRAIN * (fabs(clock.start) + fabs(clock.time)) / T_c;
    /* 1 as well where the beginning of the last cycle is not known any more, and the clock is behind its end. */
    const bool agrees = fabs(head->share - share) <= rounding || (head->share == 1 && share > 1);
    if (!(head->share >= 0 && head->share <= 1 + INSTANTS_DRIFT) || (clock.valid && !agrees)) {
        char text[2][NUMBER_TEXT_SIZE];
        return unit_fail(
            unit,
            "the state contradicts itself: the share of the last cycle that its clock has behind it is %s, "
            "its clock says %s",
            number_text(text[0], head->share), number_text(text[1], share));
    }
    return true;
}

/* Samples of setpoints are there where a path needs them; the newest is of the last step. */
static bool samples_agree(Unit *unit, const Scalars *scalars, const StateHead *head) {
    const Clock clock = unit_clock_behind(unit, scalars);
    const double grain = INSTANTS_GRAIN * (fabs(clock.start) + fabs(clock.time));
    if (head->sampled < 0 || head->sampled > machine_path_used(scalars)) {
        return unit_fail(unit,
                         "the state is out of range: samples of setpoints are there %.0f times; allowed is 0, and 1 "
                         "where setpoints.delay or setpoints.n_ffw_inside needs them",
                         (double)head->sampled);
    }
    bool ordered = head->sample_t[0] <= clock.time + grain && isfinite(head->sample_t[SAMPLES - 1]);
    for (size_t k = 1; k < SAMPLES; k++) {
        ordered = ordered && head->sample_t[k - 1] >= head->sample_t[k];
    }
    return !head->sampled || ordered ||
           unit_fail(unit, "the state contradicts itself: its samples of setpoints do not lie one behind the other "
                           "ahead of its clock");
}

/* Asked twice where the parameters change with the state: ahead, when only its head can be judged, as the places of
 * the parts follow from the parameters; and again when they are known. */
bool machine_accepts(Unit *unit, const Scalars *scalars, const void *state, size_t size) {
    Machine *machine = unit_derived(unit);
    const size_t least = sizeof(StateHead) + machine->axes * sizeof(AxisState);
    if (size < least) {
        return unit_fail(unit, "the state holds %.0f bytes of model state, without the parts' it has %.0f",
                         (double)size, (double)least);
    }
    const StateHead *head = state;
    if (head->cycle < 0 || head->cycle >= INSTANTS_COUNTED) {
        return unit_fail(unit, "the state is out of range: control cycle %.0f; allowed is 0 to %.0f",
                         (double)head->cycle, (double)(INSTANTS_COUNTED - 1));
    }
    if (!clock_agrees(unit, scalars, head) || !samples_agree(unit, scalars, head)) {
        return false;
    }
    if (head->end != size || (unit_derived_for(unit, scalars) && machine->places[end_place(machine)] != size)) {
        return unit_fail(unit, "the state says that it has %.0f bytes of model state; it has %.0f", (double)head->end,
                         (double)size);
    }
    return !unit_derived_for(unit, scalars) || parts_accept(machine, scalars, state);
}

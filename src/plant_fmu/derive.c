/* Modal systems from the archive, one per cell of its poses, or a single one from the table that modes_file names; and
 * which saved states belong to them. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "cells.h"
#include "files.h"
#include "hash.h"
#include "numbers.h"
#include "plant.h"

static const double pi = 3.14159265358979323846;

/* Memory for `cells` modal systems of up to `modes` modes, and the scratch that their steps need. */
static bool plant_place(Unit *unit, Plant *plant, size_t cells, size_t modes) {
    const size_t ports = plant_ports(plant), size = modal_padded(modes);
    const size_t system = modal_memory(modes, ports);
    const size_t crossing = cells_scratch(plant->axes, size);
    const size_t axes = plant->axes, shown = PORTS_SHOWN * axes;
    const size_t joints = shown * (3 * size + 2 * ports) + 6 * axes * axes + 8 * axes + 2 * ports;
    const size_t scratch = 4 * ports + axes + joints + crossing;
    Modal *modal = unit_alloc(unit, cells, sizeof *modal);
    double *systems = modal != NULL ? unit_alloc(unit, cells, system * sizeof *systems) : NULL;
    double *memory = systems != NULL ? unit_alloc(unit, scratch, sizeof *memory) : NULL;
    if (memory == NULL) {
        unit_free(unit, systems);
        unit_free(unit, modal);
        return false;
    }
    unit_free(unit, plant->modal);
    unit_free(unit, plant->systems);
    unit_free(unit, plant->memory);
    plant->modal = modal;
    plant->systems = systems;
    plant->memory = memory;
    plant->cells = cells;
    plant->size = size;
    for (size_t i = 0; i < cells; i++) {
        modal_place(&modal[i], systems + i * system, modes, ports);
    }
    plant->u = memory;
    plant->du = plant->u + ports;
    plant->y = plant->du + ports;
    plant->y_before = plant->y + ports;
    plant->x = plant->y_before + ports;
    plant->carried = plant->x + axes;
    double *at = plant->carried + crossing;
    for (size_t i = 0; i < shown; i++) {
        double *held = at + 3 * size;
        plant->forecasts[i] =
            (Forecast){.q = at, .v = at + size, .f = at + 2 * size, .held = held, .ramp = held + ports};
        at += 3 * size + 2 * ports;
    }
    double **const matrices[] = {&plant->held, &plant->ramp,        &plant->by_way,
                                 &plant->by_n, &plant->by_way_ramp, &plant->by_n_ramp};
    for (size_t i = 0; i < sizeof matrices / sizeof *matrices; i++, at += axes * axes) {
        *matrices[i] = at;
    }
    double **const vectors[] = {&plant->v_free, &plant->way_free, &plant->n_free,  &plant->v,
                                &plant->way,    &plant->n,        &plant->motor_u, &plant->motor_du};
    for (size_t i = 0; i < sizeof vectors / sizeof *vectors; i++, at += axes) {
        *vectors[i] = at;
    }
    plant->u_acting = at;
    plant->du_acting = at + ports;
    return true;
}

static void plant_fill(const Plant *plant, Modal *modal, const double *values, size_t modes) {
    for (size_t k = 0; k < modes; k++) {
        const double *row = values + k * modes_width(plant->axes);
        modal_set_mode(modal, k, 2 * pi * row[MODES_FREQUENCY], row[MODES_DAMPING], row + MODES_SHAPES);
    }
}

static bool plant_build(Unit *unit, Plant *plant, const double *values, size_t modes) {
    if (!plant_place(unit, plant, 1, modes)) {
        return false;
    }
    plant_fill(plant, &plant->modal[0], values, modes);
    return true;
}

static bool plant_build_from_archive(Unit *unit, Plant *plant) {
    const Poses *poses = &plant->poses;
    if (poses->cells == 0) {
        return plant_build(unit, plant, plant->archive, plant->archive_modes);
    }
    if (!plant_place(unit, plant, poses->cells, poses->most_modes)) {
        return false;
    }
    for (size_t i = 0; i < poses->cells; i++) {
        plant_fill(plant, &plant->modal[i], poses->cell[i].values, poses->cell[i].modes);
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

static void plant_derive_errors(Unit *unit, Plant *plant) {
    const Scalars *v = unit_scalars(unit);
    plant->geometry = (Geometry){.linear = {{v->geometry_E_XX, v->geometry_squareness_XY, v->geometry_squareness_XZ},
                                            {0, v->geometry_E_YY, v->geometry_squareness_YZ},
                                            {0, 0, v->geometry_E_ZZ}},
                                 .second = {{0, v->geometry_E_XY_second, v->geometry_E_XZ_second},
                                            {v->geometry_E_YX_second, 0, v->geometry_E_YZ_second},
                                            {v->geometry_E_ZX_second, v->geometry_E_ZY_second, 0}},
                                 .third = {{0, v->geometry_E_XY_third, v->geometry_E_XZ_third},
                                           {v->geometry_E_YX_third, 0, v->geometry_E_YZ_third},
                                           {v->geometry_E_ZX_third, v->geometry_E_ZY_third, 0}}};
    const double arms[3] = {v->geometry_arm_X, v->geometry_arm_Y, v->geometry_arm_Z};
    const double first[3][3] = {{v->geometry_E_AX_first, v->geometry_E_BX_first, v->geometry_E_CX_first},
                                {v->geometry_E_AY_first, v->geometry_E_BY_first, v->geometry_E_CY_first},
                                {v->geometry_E_AZ_first, v->geometry_E_BZ_first, v->geometry_E_CZ_first}};
    const double second[3][3] = {{v->geometry_E_AX_second, v->geometry_E_BX_second, v->geometry_E_CX_second},
                                 {v->geometry_E_AY_second, v->geometry_E_BY_second, v->geometry_E_CY_second},
                                 {v->geometry_E_AZ_second, v->geometry_E_BZ_second, v->geometry_E_CZ_second}};
    for (int j = 0; j < 3; j++) {
        geometry_arms(&plant->geometry, j, first[j], second[j], arms);
    }
    double most = 0;
    for (size_t i = 0; i < unit_axes(unit); i++) {
        const AxisBlock *axis = unit_axis(unit, i);
        most = fmax(most, fmax(axis->play, axis->hysteresis_value));
    }
    for (int i = 0; i < 9; i++) {
        const Geometry *g = &plant->geometry;
        most = fmax(most, fabs(g->linear[i / 3][i % 3]));
        most = fmax(most, fmax(fabs(g->second[i / 3][i % 3]), fabs(g->third[i / 3][i % 3])));
    }
    plant->errors = most > 0;
}

/* Memory for what is known of guides and transmissions, once. */
static bool plant_place_joints(Unit *unit, Plant *plant) {
    const size_t axes = unit_axes(unit);
    if (plant->guides == NULL) {
        plant->guides = unit_alloc(unit, axes, sizeof *plant->guides);
    }
    if (plant->transmissions == NULL) {
        plant->transmissions = unit_alloc(unit, axes, sizeof *plant->transmissions);
    }
    if (plant->forecasts == NULL) {
        plant->forecasts = unit_alloc(unit, PORTS_SHOWN * axes, sizeof *plant->forecasts);
    }
    if (plant->acting == NULL) {
        plant->acting = unit_alloc(unit, plant_ports(plant), sizeof *plant->acting);
    }
    if (plant->shapes == NULL) {
        plant->shapes = unit_alloc(unit, plant_ports(plant), sizeof *plant->shapes);
    }
    return plant->guides != NULL && plant->transmissions != NULL && plant->forecasts != NULL && plant->acting != NULL &&
           plant->shapes != NULL;
}

/* Friction at the guides. */
static bool plant_derive_guides(Unit *unit, Plant *plant) {
    const size_t axes = unit_axes(unit);
    plant->guided = false;
    for (size_t i = 0; i < axes; i++) {
        const AxisBlock *v = unit_axis(unit, i);
        Guide *guide = &plant->guides[i];
        char text[2][NUMBER_TEXT_SIZE];
        guide->on = v->guide_F_S > 0 || v->guide_F_C > 0;
        plant->guided = plant->guided || guide->on;
        if (guide->on && !(v->guide_F_C > 0 && v->guide_F_S >= v->guide_F_C)) {
            return unit_fail(unit,
                             "parameter '%s.guide.F_S' is %s N and '%s.guide.F_C' is %s N; the static friction force "
                             "F_S must not be below the Coulomb friction force F_C, which must be above 0; both 0: no "
                             "friction at the guide",
                             unit_axis_name(unit, i), number_text(text[0], v->guide_F_S), unit_axis_name(unit, i),
                             number_text(text[1], v->guide_F_C));
        }
        guide->contact = (Contact){.lugre = {.sigma_0 = v->guide_sigma_0,
                                             .sigma_1 = v->guide_sigma_1,
                                             .sigma_2 = v->guide_sigma_2,
                                             .F_C = v->guide_F_C,
                                             .F_S = v->guide_F_S,
                                             .v_s = v->guide_v_s,
                                             .beta = v->guide_beta,
                                             .F_log = v->guide_F_log,
                                             .v_log = v->guide_v_log,
                                             .asymmetry = v->guide_asymmetry},
                                   .W = v->guide_W,
                                   .gamma = v->guide_gamma};
        const double place[GUIDE_PLACES] = {v->guide_place_0, v->guide_place_1, v->guide_place_2, v->guide_place_3,
                                            v->guide_place_4, v->guide_place_5, v->guide_place_6, v->guide_place_7,
                                            v->guide_place_8, v->guide_place_9, v->guide_place_10};
        guide->placed = false;
        guide->place_first = v->guide_place_first;
        guide->place_spacing = v->guide_place_spacing;
        for (size_t k = 0; k < GUIDE_PLACES; k++) {
            guide->place[k] = place[k];
            guide->placed = guide->placed || fabs(place[k]) > 0;
        }
        guide->warm_time = v->guide_warm_time;
        guide->warm_power = v->guide_warm_power;
    }
    return true;
}

/* Transmissions between the motors and the structure. */
static void plant_derive_transmissions(Unit *unit, Plant *plant) {
    const size_t axes = unit_axes(unit);
    plant->driven = false;
    for (size_t i = 0; i < axes; i++) {
        const AxisBlock *v = unit_axis(unit, i);
        plant->transmissions[i] = (Transmission){.on = v->transmission_stiffness > 0, .J = v->transmission_inertia};
        plant->driven = plant->driven || plant->transmissions[i].on;
    }
}

/* Way of a slide per angle of its motor, by the rigid modes of a cell [m/rad]; 0: none moves it. */
static double plant_lead(const Plant *plant, const Modal *modal, size_t axis) {
    const double *n = modal->shape + axis * modal->size, *x = modal->shape + (plant_slides(plant) + axis) * modal->size;
    double both = 0, own = 0;
    for (size_t k = 0; k < modal->size; k++) {
        if (!(modal->omega[k] > 0)) {
            both += x[k] * n[k];
            own += n[k] * n[k];
        }
    }
    return own > 0 ? both / own : 0;
}

/* At the motors, by the modes: these hold the inertia on the motor's side, and have to hold more than that. */
static bool plant_join_motors(Unit *unit, const Plant *plant) {
    for (size_t i = 0; plant->driven && i < plant->axes; i++) {
        const AxisBlock *v = unit_axis(unit, i);
        Transmission *p = &plant->transmissions[i];
        char text[2][NUMBER_TEXT_SIZE];
        double most = 0;
        for (size_t cell = 0; cell < plant->cells; cell++) {
            const Modal *modal = &plant->modal[cell];
            double sum = 0;
            for (size_t k = 0; k < modal->size; k++) {
                sum += modal->shape[i * modal->size + k] * modal->shape[i * modal->size + k];
            }
            most = fmax(most, sum);
        }
        if (p->on && !(p->J * most < 0.95)) {
            return unit_fail(unit,
                             "parameter '%s.transmission.inertia' is %s kg.m2; it must be below 0.95 of the inertia "
                             "that answers a torque at once, %s kg.m2 by the modes, of which it is a part",
                             unit_axis_name(unit, i), number_text(text[0], p->J), number_text(text[1], 1 / most));
        }
        p->lead = plant_lead(plant, &plant->modal[0], i);
        if (p->on && !(fabs(p->lead) > 0)) {
            return unit_fail(unit,
                             "parameter '%s.transmission.stiffness' is %s N/m, and no rigid mode moves the axis: a "
                             "transmission needs its lead",
                             unit_axis_name(unit, i), number_text(text[0], v->transmission_stiffness));
        }
        p->c = v->transmission_stiffness * p->lead * p->lead;
        p->d = v->transmission_damping * p->lead * p->lead;
        p->half = p->on ? v->transmission_play / 2 / fabs(p->lead) : 0;
        p->rate = p->on ? transmission_rate(p, 1 / most - p->J) : 0;
    }
    return true;
}

/* A file is read once for an instance as long as modes_file keeps its value: a state that is restored must find the
 * table it was made with, whatever has become of the file. */
bool plant_derive(Unit *unit) {
    Plant *plant = unit_derived(unit);
    plant_derive_errors(unit, plant);
    if (!plant_place_joints(unit, plant) || !plant_derive_guides(unit, plant)) {
        return false;
    }
    plant_derive_transmissions(unit, plant);
    plant->foretold = NULL; /* other axes may be joined now */
    const char *path = unit_scalars(unit)->modes_file;
    if (plant->ready && strcmp(plant->table, path) == 0) {
        return plant_derive_mounts(unit, plant) && plant_join_motors(unit, plant);
    }
    uint64_t hash = plant->archive_hash;
    const bool good =
        path[0] == '\0' ? plant_build_from_archive(unit, plant) : plant_build_from_file(unit, plant, path, &hash);
    if (good) {
        plant->ready = true;
        plant->table_hash = hash;
        snprintf(plant->table, sizeof plant->table, "%s", path);
    }
    return good && plant_derive_mounts(unit, plant) && plant_join_motors(unit, plant);
}

/* --- saved states */

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

bool plant_accepts(Unit *unit, const Scalars *scalars, const void *state, size_t size) {
    const Plant *plant = unit_derived(unit);
    StateHead head;
    if (size < sizeof head) {
        return unit_fail(unit, "the state holds %.0f bytes of model state, its head alone has %.0f", (double)size,
                         (double)sizeof head);
    }
    memcpy(&head, state, sizeof head);
    uint64_t found = 0;
    if (!plant_find_table(unit, plant, scalars->modes_file, &found)) {
        return false;
    }
    if (found != head.table_hash) {
        char text[2][HASH_TEXT_SIZE];
        return unit_fail(unit,
                         "the state belongs to other contents of the mode table (modes_file '%s', hash %s) than this "
                         "instance finds there (hash %s)",
                         scalars->modes_file, hash_text(text[0], head.table_hash), hash_text(text[1], found));
    }
    if (head.place > 1) {
        return unit_fail(unit, "the state is in place %.0f; allowed is 0 or 1", (double)head.place);
    }
    const size_t cells = scalars->modes_file[0] == '\0' && plant->poses.cells > 0 ? plant->poses.cells : 1;
    if (head.cell >= cells) {
        return unit_fail(unit, "the state belongs to cell %.0f of the poses; allowed is less than %.0f",
                         (double)head.cell, (double)cells);
    }
    if (scalars->pose_cell < 0 || (uint64_t)scalars->pose_cell != head.cell) {
        return unit_fail(unit,
                         "the state contradicts itself: it belongs to cell %.0f of the poses, and pose.cell is %.0f",
                         (double)head.cell, (double)scalars->pose_cell);
    }
    return true;
}

/* The archive's machine: names and positions of the axes, modes of the pose it starts in, modes of further poses. */
#include <stdio.h>
#include <string.h>

#include "axes.h"
#include "hash.h"
#include "plant.h"
#include "resources.h"

#define REPORT_SIZE (STRING_SIZE + 512) /* a message that names modes_file must not lose the fault behind it */

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
    char source[64], message[REPORT_SIZE];
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

double *plant_table(Unit *unit, const Plant *plant, const char *text, size_t size, const char *source, size_t *modes) {
    char message[REPORT_SIZE];
    double *values = unit_alloc(unit, modes_capacity(text, size) * modes_width(plant->axes), sizeof *values);
    if (values != NULL &&
        !modes_read(text, size, source, plant->axes, plant->axis_names, values, modes, message, sizeof message)) {
        unit_fail(unit, "%s", message);
        unit_free(unit, values);
        values = NULL;
    }
    return values;
}

static bool plant_load_modes(Unit *unit, Plant *plant, const Resources *resources) {
    char source[64];
    snprintf(source, sizeof source, "%smodes.csv", resources->source);
    plant->archive_hash = hash_bytes(HASH_OF_NOTHING, resources->modes, resources->modes_size);
    plant->archive = plant_table(unit, plant, resources->modes, resources->modes_size, source, &plant->archive_modes);
    return plant->archive != NULL;
}

/* What was allocated goes with plant_release(), whether the file was sound or not. */
static bool plant_load_poses(Unit *unit, Plant *plant, const Resources *resources) {
    char source[64], message[REPORT_SIZE];
    if (resources->poses == NULL) {
        return true;
    }
    snprintf(source, sizeof source, "%sposes.bin", resources->source);
    Poses *poses = &plant->poses;
    GridAxis *grid = unit_alloc(unit, plant->axes, sizeof *grid);
    plant->pose_numbers = unit_alloc(unit, poses_capacity(resources->poses_size), sizeof *plant->pose_numbers);
    poses->grid = grid;
    if (grid == NULL || plant->pose_numbers == NULL) {
        return false;
    }
    if (!poses_read_grid(resources->poses, resources->poses_size, source, plant->axes, plant->pose_numbers, grid, poses,
                         message, sizeof message)) {
        return unit_fail(unit, "%s", message);
    }
    poses->cell = unit_alloc(unit, poses->cells, sizeof *poses->cell);
    poses->transfer = unit_alloc(unit, poses->cells, poses->grid_axes * sizeof *poses->transfer);
    if (poses->cell == NULL || poses->transfer == NULL) {
        return false;
    }
    return poses_read_cells(poses, source, plant->axis_names, poses->cell, poses->transfer, message, sizeof message) ||
           unit_fail(unit, "%s", message);
}

static bool plant_load_mounts(Unit *unit, Plant *plant, const Resources *resources) {
    char source[64];
    snprintf(source, sizeof source, "%smounts.csv", resources->source);
    if (resources->mounts == NULL) {
        return true;
    }
    if (plant->poses.cells > 0) {
        return unit_fail(unit, "%s: mounts that are not linear belong to one pose; the archive has a grid of poses",
                         source);
    }
    return plant_read_mounts(unit, plant, resources->mounts, resources->mounts_size, source);
}

bool plant_load(Unit *unit) {
    Plant *plant = unit_alloc(unit, 1, sizeof *plant);
    if (plant == NULL) {
        return false;
    }
    unit_set_derived(unit, plant);
    Resources resources;
    if (!resources_load(unit, &resources)) {
        return false;
    }
    const bool good = plant_load_axes(unit, plant, &resources) && plant_load_modes(unit, plant, &resources) &&
                      plant_load_poses(unit, plant, &resources) && plant_load_mounts(unit, plant, &resources);
    resources_free(unit, &resources);
    return good;
}

void plant_release(Unit *unit) {
    Plant *plant = unit_derived(unit);
    if (plant != NULL) {
        plant_free_mounts(unit, plant);
        unit_free(unit, plant->transmissions);
        unit_free(unit, plant->forecasts);
        unit_free(unit, plant->acting);
        unit_free(unit, plant->shapes);
        unit_free(unit, plant->guides);
        unit_free(unit, plant->memory);
        unit_free(unit, plant->systems);
        unit_free(unit, plant->modal);
        unit_free(unit, (void *)plant->poses.transfer);
        unit_free(unit, plant->poses.cell);
        unit_free(unit, plant->poses.grid);
        unit_free(unit, plant->pose_numbers);
        unit_free(unit, plant->archive);
        unit_free(unit, plant->axis_names);
        unit_free(unit, plant);
        unit_set_derived(unit, NULL);
    }
}

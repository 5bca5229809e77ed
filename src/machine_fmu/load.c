/* The archive's machine: its parts, each with its own files, and the settings (resources/settings.csv), a table
 *
 *   name,value
 *   hash.plant,<16 hexadecimal digits>       of axes.csv, modes.csv, poses.bin and mounts.csv
 *   hash.motion,<16 hexadecimal digits>      of setpoints.csv, where the archive holds a motion
 *   X.drive.K_v,66.6                         start value of a parameter, SI; false and true are 0 and 1
 *
 * whose own hash is in the instantiation GUID: so every file is checked. */
#include <stdio.h>
#include <string.h>

#include "archive_files.h"
#include "csv.h"
#include "embedded_resources.h"
#include "machine.h"

#define FILE_NAME "settings.csv"
#define CELL_SIZE 512

/* --- what the parts ask for */

static void *part_alloc(void *host, size_t count, size_t size) {
    return unit_alloc(host, count, size);
}

static void part_free(void *host, void *memory) {
    unit_free(host, memory);
}

static void part_fail(void *host, const char *label, const char *text) {
    unit_fail(host, "%s: %s", label, text);
}

static void part_warn(void *host, const char *label, const char *text) {
    unit_warn(host, "%s: %s", label, text);
}

static const char *part_axis_name(void *host, const Part *part, size_t axis) {
    return unit_axis_name(host, part->axis_of != NULL ? part->axis_of[axis] : axis);
}

static size_t axis_named(Unit *unit, const char *name) {
    size_t axis = 0;
    while (axis < unit_axes(unit) && strcmp(unit_axis_name(unit, axis), name) != 0) {
        axis++;
    }
    return axis;
}

/* The motion's axes are those of the machine, in any order. */
static bool name_motion_axes(Unit *unit, Machine *machine, size_t count, const char *const *names) {
    machine->motion_axes = unit_alloc(unit, count, sizeof *machine->motion_axes);
    if (machine->motion_axes == NULL) {
        return false;
    }
    if (count != machine->axes) {
        return unit_fail(unit,
                         "resources/setpoints.csv has %.0f axes, the machine has %.0f; every axis needs setpoints",
                         (double)count, (double)machine->axes);
    }
    for (size_t i = 0; i < count; i++) {
        machine->motion_axes[i] = axis_named(unit, names[i]);
        if (machine->motion_axes[i] == machine->axes) {
            return unit_fail(unit, "resources/setpoints.csv has setpoints for the axis %s, which the machine has not",
                             names[i]);
        }
    }
    machine->motion.axis_of = machine->motion_axes;
    machine->motion.axes = count;
    return true;
}

static bool part_set_axes(void *host, Part *part, size_t count, const char *const *names) {
    Unit *unit = host;
    Machine *machine = unit_derived(unit);
    if (part == &machine->motion) {
        return name_motion_axes(unit, machine, count, names);
    }
    if (!unit_set_axes(unit, count, names)) {
        return false;
    }
    machine->axes = machine->plant.axes = count;
    machine_bind(unit, false); /* the part goes on to fill in what it was given here */
    return true;
}

static const PartHost host_calls = {part_alloc, part_free, part_fail, part_warn, part_set_axes, part_axis_name};

static Part part_of(Unit *unit, const char *label, const char *resource_hash) {
    return (Part){.calls = &host_calls,
                  .host = unit,
                  .label = label,
                  .location = unit_location(unit),
                  .resources = unit_resources(unit),
                  .resource_hash = resource_hash};
}

/* --- settings */

typedef struct Settings {
    char source[64]; /* what messages call the file */
    char *text;
    size_t size;
} Settings;

static bool settings_read(Unit *unit, Settings *settings) {
    snprintf(settings->source, sizeof settings->source, "%s" FILE_NAME, file_source(unit));
    settings->text = file_of_archive(unit, FILE_NAME, embedded_settings, embedded_settings_size, &settings->size);
    return settings->text != NULL &&
           file_hash_agrees(unit, FILE_NAME, hash_bytes(HASH_OF_NOTHING, settings->text, settings->size));
}

static bool copy_cell(CsvRow *row, char *text) {
    CsvCell cell;
    if (!csv_next_cell(row, &cell) || cell.length >= CELL_SIZE) {
        return false;
    }
    memcpy(text, cell.text, cell.length);
    text[cell.length] = '\0';
    return true;
}

typedef bool (*SettingTaken)(Unit *unit, Machine *machine, const char *name, const char *value);

static bool take_hash(Unit *unit, Machine *machine, const char *name, const char *value) {
    char *hash = strcmp(name, "hash.plant") == 0    ? machine->plant_hash
                 : strcmp(name, "hash.motion") == 0 ? machine->motion_hash
                                                    : NULL;
    if (hash == NULL) {
        return true;
    }
    if (strlen(value) != HASH_TEXT_SIZE - 1) {
        return unit_fail(unit, "%s is '%s'; allowed are 16 hexadecimal digits", name, value);
    }
    memcpy(hash, value, HASH_TEXT_SIZE);
    return true;
}

static bool take_start(Unit *unit, Machine *machine, const char *name, const char *value) {
    (void)machine;
    return strncmp(name, "hash.", strlen("hash.")) == 0 || unit_set_start(unit, name, value);
}

static bool settings_take(Unit *unit, Machine *machine, const Settings *settings, SettingTaken taken) {
    Csv csv = csv_open(settings->text, settings->size);
    CsvRow row;
    char name[CELL_SIZE], value[CELL_SIZE];
    for (bool header = true; csv_next_row(&csv, &row); header = false) {
        if (csv_cells(row) != 2 || !copy_cell(&row, name) || !copy_cell(&row, value) ||
            (header && (strcmp(name, "name") != 0 || strcmp(value, "value") != 0))) {
            return unit_fail(unit, "%s, line %u: expected is %s", settings->source, csv.line,
                             header ? "the header name,value" : "the name of a parameter and its value");
        }
        if (!header && !taken(unit, machine, name, value)) {
            return false;
        }
    }
    return true;
}

/* --- parts */

static bool load_axes(Unit *unit, Machine *machine) {
    const size_t axes = machine->axes;
    const size_t plant = plant_part.scalar_rows + axes * plant_part.axis_rows;
    machine->drives = unit_alloc(unit, axes, sizeof *machine->drives);
    machine->contacts = unit_alloc(unit, axes, sizeof *machine->contacts);
    machine->labels = unit_alloc(unit, 2 * axes, LABEL_SIZE);
    machine->slopes =
        unit_alloc(unit, plant + controller_part.scalar_rows + axes * friction_part.scalar_rows, sizeof(double));
    if (machine->drives == NULL || machine->contacts == NULL || machine->labels == NULL || machine->slopes == NULL) {
        return false;
    }
    machine->plant.slopes = machine->slopes;
    for (size_t i = 0; i < axes; i++) {
        char *drive = machine->labels + 2 * i * LABEL_SIZE, *contact = drive + LABEL_SIZE;
        snprintf(drive, LABEL_SIZE, "%s.drive", unit_axis_name(unit, i));
        snprintf(contact, LABEL_SIZE, "%s.friction", unit_axis_name(unit, i));
        machine->drives[i] = part_of(unit, drive, NULL);
        machine->contacts[i] = part_of(unit, contact, NULL);
        machine->drives[i].slopes = machine->slopes + plant; /* they sample: none is ever set */
        machine->contacts[i].slopes =
            machine->slopes + plant + controller_part.scalar_rows + i * friction_part.scalar_rows;
    }
    return true;
}

static bool load_parts(Unit *unit, Machine *machine, const Settings *settings) {
    if (!settings_take(unit, machine, settings, take_hash)) {
        return false;
    }
    machine->plant = part_of(unit, "plant", machine->plant_hash);
    if (!plant_part.load(&machine->plant) || !load_axes(unit, machine)) {
        return false;
    }
    for (size_t i = 0; i < machine->axes; i++) {
        unit_axis(unit, i)->x_s = unit_axis(unit, i)->plant_x_0; /* setpoints begin where the axes stand */
    }
    machine->has_motion = machine->motion_hash[0] != '\0';
    machine->motion = part_of(unit, "motion", machine->motion_hash);
    return (!machine->has_motion || setpoint_part.load(&machine->motion)) &&
           settings_take(unit, machine, settings, take_start);
}

bool machine_load(Unit *unit) {
    Machine *machine = unit_alloc(unit, 1, sizeof *machine);
    if (machine == NULL) {
        return false;
    }
    unit_set_derived(unit, machine);
    Settings settings = {.text = NULL};
    const bool good =
        machine_rows_agree(unit) && settings_read(unit, &settings) && load_parts(unit, machine, &settings);
    unit_free(unit, settings.text);
    return good;
}

void machine_release(Unit *unit) {
    Machine *machine = unit_derived(unit);
    for (size_t i = 0; machine->drives != NULL && machine->contacts != NULL && i < machine->axes; i++) {
        controller_part.release(&machine->drives[i]);
        friction_part.release(&machine->contacts[i]);
    }
    plant_part.release(&machine->plant);
    setpoint_part.release(&machine->motion);
    unit_free(unit, machine->kept);
    unit_free(unit, machine->vectors);
    unit_free(unit, machine->places);
    unit_free(unit, machine->motion_axes);
    unit_free(unit, machine->slopes);
    unit_free(unit, machine->labels);
    unit_free(unit, machine->contacts);
    unit_free(unit, machine->drives);
    unit_free(unit, machine);
    unit_set_derived(unit, NULL);
}

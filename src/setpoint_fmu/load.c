#include "load.h"

#include <stdio.h>

#include "archive_files.h"
#include "embedded_resources.h"
#include "hash.h"

#define FILE_NAME "setpoints.csv"
#define REPORT_SIZE 512

static bool setpoint_name_axes(Unit *unit, const SetpointAxis *names, size_t axes) {
    const char **pointers = unit_alloc(unit, axes, sizeof *pointers);
    if (pointers == NULL) {
        return false;
    }
    for (size_t i = 0; i < axes; i++) {
        pointers[i] = names[i];
    }
    const bool good = unit_set_axes(unit, axes, pointers);
    unit_free(unit, pointers);
    return good;
}

static bool setpoint_read_axes(Unit *unit, Setpoints *table, const char *text, size_t size, const char *source) {
    char message[REPORT_SIZE];
    SetpointAxis *names = unit_alloc(unit, setpoints_axes_capacity(text, size), sizeof *names);
    if (names == NULL) {
        return false;
    }
    const bool good = setpoints_read_axes(text, size, source, names, &table->axes, message, sizeof message)
                          ? setpoint_name_axes(unit, (const SetpointAxis *)names, table->axes)
                          : unit_fail(unit, "%s", message);
    unit_free(unit, names);
    return good;
}

/* What was allocated goes with setpoint_release(), whether the table was sound or not. */
static bool setpoint_read(Unit *unit, Setpoints *table, const char *text, size_t size, const char *source) {
    char message[REPORT_SIZE];
    if (!setpoint_read_axes(unit, table, text, size, source)) {
        return false;
    }
    const size_t width = 1 + 2 * table->axes;
    table->values = unit_alloc(unit, setpoints_rows_capacity(text, size), width * sizeof *table->values);
    return table->values != NULL &&
           (setpoints_read_rows(text, size, source, table, message, sizeof message) || unit_fail(unit, "%s", message));
}

bool setpoint_load(Unit *unit) {
    Setpoints *table = unit_alloc(unit, 1, sizeof *table);
    if (table == NULL) {
        return false;
    }
    unit_set_derived(unit, table);
    char source[64];
    snprintf(source, sizeof source, "%s" FILE_NAME, file_source(unit));
    size_t size = 0;
    char *text = file_of_archive(unit, FILE_NAME, embedded_setpoints, embedded_setpoints_size, &size);
    const bool good = text != NULL && file_hash_agrees(unit, FILE_NAME, hash_bytes(HASH_OF_NOTHING, text, size)) &&
                      setpoint_read(unit, table, text, size, source);
    unit_free(unit, text);
    return good;
}

void setpoint_release(Unit *unit) {
    Setpoints *table = unit_derived(unit);
    if (table != NULL) {
        unit_free(unit, table->values);
        unit_free(unit, table);
        unit_set_derived(unit, NULL);
    }
}

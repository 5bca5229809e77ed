#include "load.h"

#include <string.h>

#include "embedded_resources.h"
#include "files.h"
#include "hash.h"

#define FILE_NAME "setpoints.csv"
#define REPORT_SIZE 512

/* The file's bytes, closed by a zero that *size does not count; *source is what messages call it. */
static char *setpoint_bytes(Unit *unit, const char **source, size_t *size) {
    const char *directory = unit_resources(unit);
    if (directory != NULL) {
        char *bytes = file_read(unit, directory, FILE_NAME, size);
        *source = "resources/" FILE_NAME;
        if (bytes == NULL) {
            unit_fail(unit, "%s/" FILE_NAME " cannot be read; it is the table that this unit plays", directory);
        }
        return bytes;
    }
    if (embedded_setpoints_size == 0) {
        unit_fail(unit, "the importer gave no resource location, and no table is embedded in this unit (large ones are "
                        "not): " FILE_NAME " cannot be read");
        return NULL;
    }
    char *copy = unit_alloc(unit, embedded_setpoints_size + 1, 1);
    if (copy != NULL) {
        memcpy(copy, embedded_setpoints, embedded_setpoints_size);
    }
    *source = "embedded " FILE_NAME;
    *size = embedded_setpoints_size;
    return copy;
}

static bool setpoint_is_the_packed(Unit *unit, const char *bytes, const char *source, size_t size) {
    char actual[HASH_TEXT_SIZE];
    if (strcmp(hash_text(actual, hash_bytes(HASH_OF_NOTHING, bytes, size)), unit_resource_hash(unit)) == 0) {
        return true;
    }
    if (unit_resources(unit) == NULL) {
        return unit_fail(unit,
                         "the table embedded in this unit has hash %s, but the archive was packed with hash %s: with "
                         "another table; the importer must give the resource location",
                         actual, unit_resource_hash(unit));
    }
    return unit_fail(unit,
                     "%s has hash %s, but the archive was packed with hash %s: the archive is stale or its file was "
                     "changed; pack it anew",
                     source, actual, unit_resource_hash(unit));
}

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
    const char *source = NULL;
    size_t size = 0;
    char *text = setpoint_bytes(unit, &source, &size);
    const bool good = text != NULL && setpoint_is_the_packed(unit, text, source, size) &&
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

#include "resources.h"

#include <string.h>

#include "embedded_resources.h"
#include "files.h"
#include "hash.h"

#define AXES_FILE "axes.csv"
#define MODES_FILE "modes.csv"

/* A copy of embedded bytes with a closing zero, as file_read() gives it. */
static char *resources_copy(Unit *unit, const unsigned char *bytes, size_t size) {
    char *copy = unit_alloc(unit, size + 1, 1);
    if (copy != NULL) {
        memcpy(copy, bytes, size);
    }
    return copy;
}

static bool resources_embedded(Unit *unit, Resources *resources) {
    if (embedded_axes_size == 0 || embedded_modes_size == 0) {
        return unit_fail(unit,
                         "the importer gave no resource location and no machine is embedded in this unit: " AXES_FILE
                         " and " MODES_FILE " cannot be read");
    }
    resources->source = "embedded ";
    resources->axes_size = embedded_axes_size;
    resources->modes_size = embedded_modes_size;
    resources->axes = resources_copy(unit, embedded_axes, embedded_axes_size);
    resources->modes = resources_copy(unit, embedded_modes, embedded_modes_size);
    return resources->axes != NULL && resources->modes != NULL;
}

static char *resources_file(Unit *unit, const char *directory, const char *name, size_t *size) {
    char *bytes = file_read(unit, directory, name, size);
    if (bytes == NULL) {
        unit_fail(unit, "%s/%s cannot be read; the plant takes its axes and modes from the archive's resources",
                  directory, name);
    }
    return bytes;
}

static bool resources_read(Unit *unit, const char *directory, Resources *resources) {
    resources->source = "resources/";
    resources->axes = resources_file(unit, directory, AXES_FILE, &resources->axes_size);
    if (resources->axes == NULL) {
        return false;
    }
    resources->modes = resources_file(unit, directory, MODES_FILE, &resources->modes_size);
    return resources->modes != NULL;
}

static bool resources_check(Unit *unit, const Resources *resources) {
    char found[HASH_TEXT_SIZE];
    uint64_t hash = hash_bytes(HASH_OF_NOTHING, resources->axes, resources->axes_size);
    hash_text(found, hash_bytes(hash, resources->modes, resources->modes_size));
    if (strcmp(found, unit_resource_hash(unit)) != 0) {
        return unit_fail(unit,
                         "%s" AXES_FILE " and %s" MODES_FILE
                         " have hash %s, but the archive was packed with hash %s: the "
                         "archive is stale or its files were changed; pack it anew",
                         resources->source, resources->source, found, unit_resource_hash(unit));
    }
    return true;
}

bool resources_load(Unit *unit, Resources *resources) {
    const char *directory = unit_resources(unit);
    *resources = (Resources){NULL, NULL, NULL, 0, 0};
    const bool read =
        directory != NULL ? resources_read(unit, directory, resources) : resources_embedded(unit, resources);
    if (read && resources_check(unit, resources)) {
        return true;
    }
    resources_free(unit, resources);
    return false;
}

void resources_free(Unit *unit, Resources *resources) {
    unit_free(unit, resources->axes);
    unit_free(unit, resources->modes);
    resources->axes = NULL;
    resources->modes = NULL;
}

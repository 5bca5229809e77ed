#include "resources.h"

#include <string.h>

#include "embedded_resources.h"
#include "files.h"
#include "hash.h"

#define AXES_FILE "axes.csv"
#define MODES_FILE "modes.csv"
#define POSES_FILE "poses.bin"

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
    /* most machines have none; where one is missing, the hash tells */
    resources->poses = file_read(unit, directory, POSES_FILE, &resources->poses_size);
    return resources->modes != NULL;
}

static bool resources_check(Unit *unit, const Resources *resources) {
    char found[HASH_TEXT_SIZE];
    uint64_t hash = hash_bytes(HASH_OF_NOTHING, resources->axes, resources->axes_size);
    hash = hash_bytes(hash, resources->modes, resources->modes_size);
    if (resources->poses != NULL) {
        hash = hash_bytes(hash, resources->poses, resources->poses_size);
    }
    if (strcmp(hash_text(found, hash), unit_resource_hash(unit)) == 0) {
        return true;
    }
    if (unit_resources(unit) == NULL) {
        return unit_fail(unit,
                         "the machine embedded in this unit has hash %s, but the archive was packed with hash %s: with "
                         "another machine, or with poses (" POSES_FILE
                         "), which are not embedded; the importer must give the resource location",
                         found, unit_resource_hash(unit));
    }
    return unit_fail(unit,
                     "resources/" AXES_FILE ", resources/" MODES_FILE "%s have hash %s, but the archive was packed "
                     "with hash %s: the archive is stale or its files were changed or are missing; pack it anew",
                     resources->poses != NULL ? " and resources/" POSES_FILE : " (no " POSES_FILE ")", found,
                     unit_resource_hash(unit));
}

bool resources_load(Unit *unit, Resources *resources) {
    const char *directory = unit_resources(unit);
    *resources = (Resources){.source = NULL};
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
    unit_free(unit, resources->poses);
    resources->axes = NULL;
    resources->modes = NULL;
    resources->poses = NULL;
}

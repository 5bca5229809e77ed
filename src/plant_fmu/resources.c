#include "resources.h"

#include "archive_files.h"
#include "embedded_resources.h"
#include "files.h"
#include "hash.h"

#define AXES_FILE "axes.csv"
#define MODES_FILE "modes.csv"
#define POSES_FILE "poses.bin"

static bool resources_check(Unit *unit, const Resources *resources) {
    uint64_t hash = hash_bytes(HASH_OF_NOTHING, resources->axes, resources->axes_size);
    hash = hash_bytes(hash, resources->modes, resources->modes_size);
    if (resources->poses == NULL) {
        return file_hash_agrees(unit, AXES_FILE ", " MODES_FILE " (no " POSES_FILE ")", hash);
    }
    return file_hash_agrees(unit, AXES_FILE ", " MODES_FILE " and " POSES_FILE,
                            hash_bytes(hash, resources->poses, resources->poses_size));
}

bool resources_load(Unit *unit, Resources *resources) {
    const char *directory = unit_resources(unit);
    *resources = (Resources){.source = file_source(unit)};
    resources->axes = file_of_archive(unit, AXES_FILE, embedded_axes, embedded_axes_size, &resources->axes_size);
    if (resources->axes != NULL) {
        resources->modes =
            file_of_archive(unit, MODES_FILE, embedded_modes, embedded_modes_size, &resources->modes_size);
    }
    if (resources->modes != NULL) {
        /* most machines have none, and none are embedded; where they are missing, the hash tells */
        resources->poses = directory != NULL ? file_read(unit, directory, POSES_FILE, &resources->poses_size) : NULL;
        if (resources_check(unit, resources)) {
            return true;
        }
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

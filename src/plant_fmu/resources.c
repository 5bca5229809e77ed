#include "resources.h"

#include "archive_files.h"
#include "embedded_resources.h"
#include "files.h"
#include "hash.h"

#define AXES_FILE "axes.csv"
#define MODES_FILE "modes.csv"
#define POSES_FILE "poses.bin"
#define MOUNTS_FILE "mounts.csv"

static bool resources_check(Unit *unit, const Resources *resources) {
    uint64_t hash = hash_bytes(HASH_OF_NOTHING, resources->axes, resources->axes_size);
    hash = hash_bytes(hash, resources->modes, resources->modes_size);
    if (resources->poses != NULL) {
        hash = hash_bytes(hash, resources->poses, resources->poses_size);
    }
    if (resources->mounts != NULL) {
        hash = hash_bytes(hash, resources->mounts, resources->mounts_size);
    }
    const char *names[2][2] = {
        {AXES_FILE ", " MODES_FILE " (no " POSES_FILE ")", AXES_FILE ", " MODES_FILE " and " POSES_FILE},
        {AXES_FILE ", " MODES_FILE " and " MOUNTS_FILE " (no " POSES_FILE ")",
         AXES_FILE ", " MODES_FILE ", " POSES_FILE " and " MOUNTS_FILE}};
    return file_hash_agrees(unit, names[resources->mounts != NULL][resources->poses != NULL], hash);
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
        if (directory != NULL) {
            resources->poses = file_read(unit, directory, POSES_FILE, &resources->poses_size);
            resources->mounts = file_read(unit, directory, MOUNTS_FILE, &resources->mounts_size);
        }
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
    unit_free(unit, resources->mounts);
    resources->axes = NULL;
    resources->modes = NULL;
    resources->poses = NULL;
    resources->mounts = NULL;
}

/* The machine data of the archive: axes.csv, modes.csv and, where there are, poses.bin and mounts.csv from the
 * resources directory; or, where the importer gave none, axes.csv and modes.csv from the copy compiled into the unit.
 * Checked against the hash in the instantiation GUID. */
#ifndef FEEDSIM_RESOURCES_H
#define FEEDSIM_RESOURCES_H

#include "unit.h"

#define resources_load PREFIXED(resources_load)
#define resources_free PREFIXED(resources_free)

typedef struct Resources {
    const char *source;                  /* how messages begin their names */
    char *axes, *modes, *poses, *mounts; /* bytes of the files, each closed by a zero that the size does not count */
    size_t axes_size, modes_size, poses_size, mounts_size; /* poses NULL: the machine has one pose; mounts NULL: none is
                                                              other than linear */
} Resources;

/* false, with the reason logged and nothing to free, where a file cannot be read or belongs to another archive. */
bool resources_load(Unit *unit, Resources *resources);

void resources_free(Unit *unit, Resources *resources);

#endif

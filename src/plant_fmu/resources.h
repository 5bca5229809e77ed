/* The machine data of the archive: axes.csv and modes.csv from the resources directory, or, where the importer gave
 * none, from the copy compiled into the unit. Checked against the hash in the instantiation GUID. */
#ifndef FEEDSIM_RESOURCES_H
#define FEEDSIM_RESOURCES_H

#include "unit.h"

#define resources_load PREFIXED(resources_load)
#define resources_free PREFIXED(resources_free)

typedef struct Resources {
    const char *source; /* for messages: "resources/" or "embedded " */
    char *axes, *modes; /* bytes of the two files, each closed by a zero that the size does not count */
    size_t axes_size, modes_size;
} Resources;

/* false, with the reason logged and nothing to free, where a file cannot be read or belongs to another archive. */
bool resources_load(Unit *unit, Resources *resources);

void resources_free(Unit *unit, Resources *resources);

#endif

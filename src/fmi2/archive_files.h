/* The files of the unit's own archive: its resources, or the copies embedded in the unit. */
#ifndef FEEDSIM_ARCHIVE_FILES_H
#define FEEDSIM_ARCHIVE_FILES_H

#include <stddef.h>
#include <stdint.h>

#include "unit.h"

/* The bytes of one of the archive's resources as from file_read(); where the importer named no folder for them, of the
 * copy embedded in the unit (`embedded_size` 0: there is none). NULL, with the reason logged. */
char *file_of_archive(Unit *unit, const char *name, const unsigned char *embedded, size_t embedded_size, size_t *size);

/* How messages begin the names of the archive's files: "resources/", or "embedded ". */
const char *file_source(const Unit *unit);

/* Refuse files, which messages call `names`, whose hash is not that which the archive was packed with. */
bool file_hash_agrees(Unit *unit, const char *names, uint64_t hash);

#endif

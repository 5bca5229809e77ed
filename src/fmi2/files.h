/* Files for models: UTF-8 paths on every platform, contents read whole; and the archive's own files. */
#ifndef FEEDSIM_FILES_H
#define FEEDSIM_FILES_H

#include <stddef.h>
#include <stdint.h>

#include "unit.h"

/* The bytes of directory/name (both UTF-8), closed by an extra zero that *size does not count; to be freed with
 * unit_free(). directory NULL: name is the full path. NULL, and nothing logged, where the file cannot be opened and
 * read whole: what that means is for the caller to say. size may be NULL. */
char *file_read(Unit *unit, const char *directory, const char *name, size_t *size);

/* The bytes of one of the archive's resources as from file_read(); where the importer named no folder for them, of the
 * copy embedded in the unit (`embedded_size` 0: there is none). NULL, with the reason logged. */
char *file_of_archive(Unit *unit, const char *name, const unsigned char *embedded, size_t embedded_size, size_t *size);

/* How messages begin the names of the archive's files: "resources/", or "embedded ". */
const char *file_source(const Unit *unit);

/* Refuse files, which messages call `names`, whose hash is not that which the archive was packed with. */
bool file_hash_agrees(Unit *unit, const char *names, uint64_t hash);

#endif

/* Files for models: UTF-8 paths on every platform, contents read whole. A page has its own (src/page). */
#ifndef FEEDSIM_FILES_H
#define FEEDSIM_FILES_H

#include <stddef.h>

#include "unit.h"

/* The bytes of directory/name (both UTF-8), closed by an extra zero that *size does not count; to be freed with
 * unit_free(). directory NULL: name is the full path. NULL, and nothing logged, where the file cannot be opened and
 * read whole: what that means is for the caller to say. size may be NULL. */
char *file_read(Unit *unit, const char *directory, const char *name, size_t *size);

#endif

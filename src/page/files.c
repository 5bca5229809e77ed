/* Files for models, as files.h has them, in a page: those that loop.c was given. It is put into several files. */
#include "files.h"

#include <string.h>

extern const char *page_file(const char *name, size_t *size);

char *file_read(Unit *unit, const char *directory, const char *name, size_t *size) {
    size_t count = 0;
    const char *bytes = directory != NULL ? page_file(name, &count) : NULL;
    char *copy = bytes != NULL ? unit_alloc(unit, count + 1, 1) : NULL;
    if (copy == NULL) {
        return NULL;
    }
    memcpy(copy, bytes, count);
    copy[count] = '\0';
    if (size != NULL) {
        *size = count;
    }
    return copy;
}

#include "archive_files.h"

#include <string.h>

#include "files.h"
#include "hash.h"

char *file_of_archive(Unit *unit, const char *name, const unsigned char *embedded, size_t embedded_size, size_t *size) {
    const char *directory = unit_resources(unit), *location = unit_location(unit);
    if (directory != NULL) {
        char *bytes = file_read(unit, directory, name, size);
        if (bytes == NULL) {
            unit_fail(unit,
                      "%s/%s cannot be read: the resource location '%s' must be the folder resources of the unpacked "
                      "archive",
                      directory, name, location);
        }
        return bytes;
    }
    if (embedded_size == 0) {
        unit_fail(unit,
                  "%s is not embedded in this unit: the importer must give the resource location, as a file: URI or a "
                  "path; it gave %s",
                  name, location != NULL ? location : "none");
        return NULL;
    }
    char *copy = unit_alloc(unit, embedded_size + 1, 1);
    if (copy != NULL) {
        memcpy(copy, embedded, embedded_size);
        *size = embedded_size;
    }
    return copy;
}

const char *file_source(const Unit *unit) {
    return unit_resources(unit) != NULL ? "resources/" : "embedded ";
}

bool file_hash_agrees(Unit *unit, const char *names, uint64_t hash) {
    char actual[HASH_TEXT_SIZE];
    if (strcmp(hash_text(actual, hash), unit_resource_hash(unit)) == 0) {
        return true;
    }
    if (unit_resources(unit) == NULL) {
        const char *location = unit_location(unit);
        return unit_fail(
            unit,
            "embedded %s: the hash is %s, but the archive was packed with hash %s, of files that are not embedded "
            "in this unit; the importer must give the resource location, as a file: URI or a path; it "
            "gave %s",
            names, actual, unit_resource_hash(unit), location != NULL ? location : "none");
    }
    return unit_fail(unit,
                     "resources/%s: the hash is %s, but the archive was packed with hash %s: files were changed or are "
                     "missing, or are another archive's; pack it anew",
                     names, actual, unit_resource_hash(unit));
}

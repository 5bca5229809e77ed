#ifdef _WIN32 /* ahead of table.h, whose BOOLEAN it would stumble over */
#define WIN32_LEAN_AND_MEAN
#include <windows.h>
#endif

#include "files.h"

#include <stdio.h>
#include <string.h>

#include "hash.h"

static FILE *open_path(Unit *unit, const char *path) {
#ifdef _WIN32
    /* fopen() would take the path in the code page of the process. */
    int length = MultiByteToWideChar(CP_UTF8, MB_ERR_INVALID_CHARS, path, -1, NULL, 0);
    wchar_t *wide = length > 0 ? unit_alloc(unit, (size_t)length, sizeof *wide) : NULL;
    FILE *file = NULL;
    if (wide != NULL && MultiByteToWideChar(CP_UTF8, MB_ERR_INVALID_CHARS, path, -1, wide, length) > 0) {
        file = _wfopen(wide, L"rb");
    }
    unit_free(unit, wide);
    return file;
#else
    (void)unit;
    return fopen(path, "rb");
#endif
}

/* Read to the end in growing pieces: the length of what is no plain file is not known in advance. */
static char *read_stream(Unit *unit, FILE *file, size_t *size) {
    char *bytes = NULL;
    size_t room = 0, count = 0;
    do {
        if (room - count < 2) {
            size_t larger = room > 0 ? 2 * room : 16384;
            char *grown = unit_alloc(unit, larger, 1);
            if (grown != NULL && count > 0) {
                memcpy(grown, bytes, count);
            }
            unit_free(unit, bytes);
            if (grown == NULL) {
                return NULL;
            }
            bytes = grown;
            room = larger;
        }
        count += fread(bytes + count, 1, room - count - 1, file);
    } while (!feof(file) && !ferror(file));
    if (ferror(file)) {
        unit_free(unit, bytes);
        return NULL;
    }
    bytes[count] = '\0';
    if (size != NULL) {
        *size = count;
    }
    return bytes;
}

char *file_read(Unit *unit, const char *directory, const char *name, size_t *size) {
    size_t length = (directory != NULL ? strlen(directory) + 1 : 0) + strlen(name) + 1;
    char *path = unit_alloc(unit, length, 1);
    if (path == NULL) {
        return NULL;
    }
    if (directory != NULL) {
        snprintf(path, length, "%s/%s", directory, name);
    } else {
        snprintf(path, length, "%s", name);
    }
    FILE *file = open_path(unit, path);
    unit_free(unit, path);
    if (file == NULL) {
        return NULL;
    }
    char *bytes = read_stream(unit, file, size);
    fclose(file);
    return bytes;
}

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

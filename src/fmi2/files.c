#ifdef _WIN32 /* ahead of table.h, whose BOOLEAN it would stumble over */
#define WIN32_LEAN_AND_MEAN
#include <windows.h>
#endif

#include "files.h"

#include <stdio.h>
#include <string.h>

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

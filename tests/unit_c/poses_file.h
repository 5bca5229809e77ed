/* A grid of poses in memory, written number by number: what the tests of poses.c and cells.c read. */
#ifndef POSES_FILE_H
#define POSES_FILE_H

#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

typedef struct PosesFile {
    char bytes[20000];
    size_t size;
} PosesFile;

static inline void file_begin(PosesFile *file) {
    memcpy(file->bytes, "FSPOSES1", 8);
    file->size = 8;
}

/* Little-endian, whatever the machine is. */
static inline void file_put(PosesFile *file, size_t at, double number) {
    uint64_t bits;
    memcpy(&bits, &number, sizeof bits);
    for (size_t i = 0; i < 8; i++) {
        file->bytes[at + i] = (char)(bits >> (8 * i) & 255);
    }
}

static inline void file_add(PosesFile *file, double number) {
    if (file->size + 8 > sizeof file->bytes) {
        abort();
    }
    file_put(file, file->size, number);
    file->size += 8;
}

static inline void file_add_all(PosesFile *file, size_t count, const double *numbers) {
    for (size_t i = 0; i < count; i++) {
        file_add(file, numbers[i]);
    }
}

#define FILE_ADD(file, ...)                                                                                            \
    file_add_all((file), sizeof (double[]){__VA_ARGS__} / sizeof(double), (const double[]){__VA_ARGS__})

#endif

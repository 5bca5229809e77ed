/* What a unit is surrounded by while it is fuzzed (target.c): faults that are told, the bytes that decide, an
 * importer's memory and messages, resource files as they are or mutated, instances with their twins. */
#ifndef FEEDSIM_FUZZ_SURROUNDINGS_H
#define FEEDSIM_FUZZ_SURROUNDINGS_H

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "fmi2Functions.h"
#include "shell.h"
#include "state.h"
#include "values.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);
int LLVMFuzzerInitialize(int *count, char ***words);

enum { MOST = 40, FILES = 5, FILE_ROOM = 8192, PATH_ROOM = 512, PAIRS = 2, DEEPEST = 2, MOST_CYCLES = 2000 };

/* --- faults */

static const char *doing = "nothing";

static void fault(const char *what) {
    fprintf(stderr, "FAULT in %s: %s\n", doing, what);
    abort();
}

static void must(bool good, const char *what) {
    if (!good) {
        fault(what);
    }
}

/* --- bytes */

static const uint8_t *at, *end;

static unsigned byte(void) {
    return at < end ? *at++ : 0;
}

static uint64_t bytes(unsigned count) {
    uint64_t value = 0;
    while (count-- > 0) {
        value = value << 8 | byte();
    }
    return value;
}

static double number(void) {
    static const double special[] = {0,       -0.0,  NAN,   -NAN,   INFINITY, -INFINITY, 1e308, -1.7e308,
                                     5e-324,  1e-9,  -1e-9, 1e150,  -1e151,   1e-308,    1,     -1,
                                     1.25e-4, 1e-30, 1e9,   2.5e-4, 1e-3,     1e16,      0.5,   1e-6};
    static const double scale[] = {1e-9, 1e-6, 1e-4, 1e-3, 1e-2, 1, 100, 1e6};
    const unsigned kind = byte();
    if (kind < sizeof special / sizeof *special) {
        return special[kind];
    }
    if (kind < 32) {
        const uint64_t bits = bytes(8);
        double value;
        memcpy(&value, &bits, sizeof value);
        return value;
    }
    return scale[kind % 8] * (double)((int)byte() - 128) / 100;
}

/* --- the importer's side: memory, messages */

static long held, fail_in; /* allocations that live; the how-manieth next one fails, 0: none */
static bool short_of_memory;
static uint8_t junk;
static int errors_told;
static uint64_t calls_made, instances_made;

static void *allocate(size_t count, size_t size) {
    if (fail_in > 0 && --fail_in == 0) {
        short_of_memory = true;
        return NULL;
    }
    if (count > SIZE_MAX / (size + 1) || count * size > (size_t)1 << 28) {
        return NULL;
    }
    void *memory = malloc(count * size);
    if (memory != NULL) {
        memset(memory, junk, count * size); /* the standard wants zeroes; not every importer gives them */
        held++;
    }
    return memory;
}

static void give_back(void *memory) {
    must(memory != NULL, "freeMemory got NULL");
    held--;
    free(memory);
}

static void tell(fmi2ComponentEnvironment environment, fmi2String instance, fmi2Status status, fmi2String category,
                 fmi2String message, ...) {
    must(environment == &held, "the logger got another environment");
    must(strcmp(instance, "tried%s#1#") == 0 || short_of_memory, "the logger got another name");
    must(category != NULL && message != NULL && strlen(message) < 5000, "a message is no text");
    for (const char *c = message; *c != '\0'; c++) {
        must((unsigned char)*c >= 0x20 && *c != 0x7f, "a message holds a control character");
        if (*c == '%' || *c == '#') {
            must(c[1] == *c, "a message holds a single % or #");
            c++;
        }
    }
    if (status == fmi2Error) {
        errors_told++;
    }
}

static const fmi2CallbackFunctions callbacks = {tell, allocate, give_back, NULL, &held};

static void *volatile written;

static void keep_written(void *memory) {
    written = memory;
}

/* What a function left unset on the stack is another number for the twin. */
static void dirty_stack(void) {
    uint8_t waste[2048];
    memset(waste, junk, sizeof waste);
    keep_written(waste);
}

static void begin(bool twin) {
    junk = twin ? 0x41 : 0xbf; /* doubles of 2.2e6 and -0.12 */
    dirty_stack();
    errors_told = 0;
    calls_made++;
}

/* --- resource files, as they are or mutated, and the GUID that fits them */

typedef struct File {
    const char *name;
    uint8_t content[FILE_ROOM];
    size_t size;
} File;

static File files[FILES];
static size_t file_count;
static char other_modes[PATH_ROOM], scratch[PATH_ROOM], folder[PATH_ROOM], guid[GUID_SIZE];

static void read_base(const char *name) {
    File *file = &files[file_count];
    char path[PATH_ROOM];
    snprintf(path, sizeof path, "%s/%s", RESOURCES, name);
    FILE *stream = fopen(path, "rb");
    if (stream == NULL) {
        return;
    }
    file->name = name;
    file->size = fread(file->content, 1, sizeof file->content, stream);
    fclose(stream);
    file_count++;
}

static void write_file(const File *file) {
    char path[PATH_ROOM + 32];
    snprintf(path, sizeof path, "%s/%s", scratch, file->name);
    FILE *stream = fopen(path, "wb");
    must(stream != NULL && fwrite(file->content, 1, file->size, stream) == file->size && fclose(stream) == 0,
         "a file of the fuzzer's own cannot be written");
}

static void mutate_text(File *file, size_t place) {
    static const char *const pieces[] = {",",    "\n",   "1e308",  "-1", "nan", "\"",  "0",
                                         "\xff", "\r\n", "1e-320", ";",  "",    "2.5", "X"};
    const char *piece = pieces[byte() % (sizeof pieces / sizeof *pieces)];
    const size_t length = strlen(piece), gone = byte() % 8;
    const size_t behind = place + gone < file->size ? place + gone : file->size;
    if (file->size - (behind - place) + length > sizeof file->content) {
        return;
    }
    memmove(file->content + place + length, file->content + behind, file->size - behind);
    memcpy(file->content + place, piece, length);
    file->size = file->size - (behind - place) + length;
}

static void mutate_numbers(File *file, size_t place) {
    const double value = number();
    uint8_t image[8];
    memcpy(image, &value, sizeof image);
    place -= place % 8;
    memcpy(file->content + place, image, place + 8 <= file->size ? 8 : file->size - place);
    if (byte() % 16 == 0) {
        file->size = place;
    }
}

static void mutate(File *file) {
    for (unsigned count = 1 + byte() % 4; count > 0 && file->size > 0; count--) {
        const size_t place = (size_t)bytes(2) % (byte() < 128 || file->size < 256 ? file->size : 256);
        if (strstr(file->name, ".bin") != NULL) {
            mutate_numbers(file, place);
        } else {
            mutate_text(file, place);
        }
    }
}

static uint64_t hash_of(const File *chosen, size_t count, const char *names) {
    uint64_t hash = HASH_OF_NOTHING;
    for (size_t i = 0; i < count; i++) {
        if (names == NULL || strstr(names, chosen[i].name) != NULL) {
            hash = hash_bytes(hash, chosen[i].content, chosen[i].size);
        }
    }
    return hash;
}

/* settings.csv, the first file where there is one, says in a row what hash the files of a part have. */
static void enter_hash(File *settings, const char *row, uint64_t hash) {
    char text[HASH_TEXT_SIZE];
    const size_t length = strlen(row), digits = HASH_TEXT_SIZE - 1;
    hash_text(text, hash);
    for (size_t at_byte = 0; at_byte + length + digits <= settings->size; at_byte++) {
        if (memcmp(settings->content + at_byte, row, length) == 0) {
            memcpy(settings->content + at_byte + length, text, digits);
        }
    }
}

/* Of all files; where there are settings, of these, which hold those of the others. */
static uint64_t seal(File *chosen, size_t count) {
    if (count == 0 || strcmp(chosen[0].name, "settings.csv") != 0) {
        return hash_of(chosen, count, NULL);
    }
    enter_hash(&chosen[0], "hash.plant,", hash_of(chosen, count, "axes.csv modes.csv poses.bin"));
    enter_hash(&chosen[0], "hash.motion,", hash_of(chosen, count, "setpoints.csv"));
    return hash_of(chosen, 1, NULL);
}

/* Chooses the files of this input: those of the folder, without the last one, or some of them changed. */
static void choose_resources(void) {
    static File changed[FILES];
    const unsigned variant = byte() % 8;
    size_t count = file_count;
    char own[HASH_TEXT_SIZE], theirs[HASH_TEXT_SIZE];
    if (variant == 1 && count > 1) {
        count--;
    }
    snprintf(folder, sizeof folder, "%s", variant < 1 || count == 0 ? RESOURCES : scratch);
    memcpy(changed, files, sizeof files);
    if (variant > 3 && count > 0) {
        for (unsigned k = 1 + byte() % 2; k > 0; k--) {
            mutate(&changed[byte() % count]);
        }
    }
    const uint64_t hash = seal(changed, count);
    for (size_t i = 0; i < file_count && variant >= 1; i++) {
        char path[PATH_ROOM + 32];
        snprintf(path, sizeof path, "%s/%s", scratch, files[i].name);
        if (i < count) {
            write_file(&changed[i]);
        } else {
            remove(path);
        }
    }
    snprintf(guid, sizeof guid, "%s-%s", table_hash(own), hash_text(theirs, hash));
}

static void clear_scratch(void) {
    for (size_t i = 0; i < file_count; i++) {
        char path[PATH_ROOM + 32];
        snprintf(path, sizeof path, "%s/%s", scratch, files[i].name);
        remove(path);
    }
    rmdir(scratch);
    printf("calls %llu instances %llu\n", (unsigned long long)calls_made, (unsigned long long)instances_made);
}

int LLVMFuzzerInitialize(int *count, char ***words) {
    (void)count, (void)words;
    static const char *const names[] = {"settings.csv", "axes.csv", "modes.csv", "setpoints.csv", "poses.bin"};
    for (size_t i = 0; i < FILES; i++) {
        read_base(names[i]);
    }
    snprintf(other_modes, sizeof other_modes, "%s/other_modes.csv", RESOURCES);
    const char *place = getenv("TMPDIR");
    snprintf(scratch, sizeof scratch, "%s/feedsim-fuzz-XXXXXX", place != NULL ? place : "/tmp");
    must(mkdtemp(scratch) != NULL, "no folder for files of the fuzzer's own");
    atexit(clear_scratch);
    return 0;
}

/* --- an instance and its twin */

typedef struct Pair {
    Unit *unit, *twin;
    Phase phase;       /* that the calls have led to */
    double time, stop; /* likewise */
} Pair;

static Pair pairs[PAIRS];
static unsigned depth; /* of detours */

static const Header *header_of(const Pair *pair) {
    return unit_header(pair->unit);
}

static Unit *instantiate(bool twin) {
    doing = "fmi2Instantiate";
    begin(twin);
    short_of_memory = false;
    instances_made++;
    return fmi2Instantiate("tried%s#1#", fmi2CoSimulation, guid, folder, &callbacks, fmi2False, fmi2False);
}

static void free_pair(Pair *pair) {
    doing = "fmi2FreeInstance";
    fmi2FreeInstance(pair->unit);
    fmi2FreeInstance(pair->twin);
    *pair = (Pair){.unit = NULL};
}

static void at_its_start(Pair *pair) {
    pair->phase = PHASE_INSTANTIATED;
    pair->time = 0;
    pair->stop = INFINITY;
}

/* Whether there are such instances, with those resources. */
static bool make_pair(Pair *pair) {
    pair->unit = instantiate(false);
    must((pair->unit == NULL) == (errors_told > 0), "refused without an error, or made with one");
    pair->twin = instantiate(true);
    must((pair->unit == NULL) == (pair->twin == NULL), "the same twice, and only one is made");
    at_its_start(pair);
    return pair->unit != NULL;
}

#endif

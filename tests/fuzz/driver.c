/* Runs LLVMFuzzerTestOneInput() where the compiler has no libFuzzer, with the options and folders that libFuzzer takes:
 *
 *   program [-seed=N] [-max_total_time=SECONDS] [-max_len=BYTES] [-timeout=SECONDS] [-artifact_prefix=PATH/] FOLDER...
 *   program FILE...     runs these once
 *
 * Inputs that reach new code are kept, written to the first folder, and changed further. gcc tells of the code that is
 * reached (-fsanitize-coverage=trace-pc); without it inputs are changed blindly. The input that is being run lies in
 * PATH/running, a file that is mapped: whatever ends the program, it is there afterwards. */
#include <dirent.h>
#include <fcntl.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);
int LLVMFuzzerInitialize(int *count, char ***words);
void __sanitizer_cov_trace_pc(void);

enum { EDGES = 1 << 15, KEPT = 1 << 16, LONGEST = 1 << 16, PATH_ROOM = 1024 };

typedef struct Input {
    uint8_t *bytes;
    size_t size;
} Input;

static uint8_t counts[EDGES], seen[EDGES];
static uintptr_t came_from;
static Input kept[KEPT];
static size_t kept_count, reached;
static uint8_t buffer[LONGEST];
static uint8_t *running;
static uint64_t state;
static unsigned long seed = 1, seconds, longest = 2048, timeout = 20, runs;
static const char *prefix = "./", *folder;

/* --- what code is reached: edges, by how often (1, 2, 3, 4 to 7, ...) */

void __sanitizer_cov_trace_pc(void) {
    const uintptr_t here = (uintptr_t)__builtin_return_address(0) - (uintptr_t)&LLVMFuzzerTestOneInput;
    counts[(here ^ came_from) % EDGES]++;
    came_from = here << 3;
}

static bool reaches_more(void) {
    bool more = false;
    for (size_t i = 0; i < EDGES; i++) {
        if (counts[i] == 0) {
            continue;
        }
        uint8_t size = 1;
        while (size < 128 && counts[i] >= 2 * size) {
            size *= 2;
        }
        reached += seen[i] == 0;
        more = more || (seen[i] & size) == 0;
        seen[i] |= size;
    }
    return more;
}

/* --- inputs */

static uint32_t pick(uint32_t below) {
    state = state * UINT64_C(6364136223846793005) + UINT64_C(1442695040888963407);
    return (uint32_t)((state >> 33) % below);
}

static void run(const uint8_t *bytes, size_t size) {
    Input given = {malloc(size > 0 ? size : 1), size}; /* no byte more: reading too far is seen */
    memcpy(given.bytes, bytes, size);
    memcpy(running, &size, sizeof size);
    memcpy(running + sizeof size, bytes, size);
    memset(counts, 0, sizeof counts);
    came_from = 0;
    alarm((unsigned)timeout);
    LLVMFuzzerTestOneInput(given.bytes, size);
    runs++;
    free(given.bytes);
}

static void keep(const uint8_t *bytes, size_t size, bool write) {
    if (!reaches_more() || kept_count == KEPT) {
        return;
    }
    kept[kept_count] = (Input){malloc(size + 1), size};
    memcpy(kept[kept_count++].bytes, bytes, size);
    if (!write || folder == NULL) {
        return;
    }
    char path[PATH_ROOM];
    snprintf(path, sizeof path, "%s/%lu-%06lu", folder, seed, (unsigned long)kept_count);
    FILE *file = fopen(path, "wb");
    if (file != NULL) {
        fwrite(bytes, 1, size, file);
        fclose(file);
    }
}

static size_t change(void) {
    size_t size = 0;
    if (kept_count > 0 && pick(20) > 0) {
        const Input from =
            kept[pick(2) ? pick((uint32_t)kept_count) : kept_count - 1 - pick((uint32_t)(kept_count + 3) / 4)];
        size = from.size < longest ? from.size : longest;
        memcpy(buffer, from.bytes, size);
    }
    for (uint32_t count = 1u << pick(5); count > 0; count--) {
        const uint32_t place = pick((uint32_t)size + 1), length = 1 + pick(pick(4) ? 8 : 128);
        const Input other = kept_count > 0 ? kept[pick((uint32_t)kept_count)] : (Input){NULL, 0};
        switch (pick(6)) {
        case 0: /* other bytes */
            for (uint32_t i = place; i < size && i < place + length; i++) {
                buffer[i] = (uint8_t)pick(256);
            }
            break;
        case 1: /* more */
            if (size + length <= longest) {
                memmove(buffer + place + length, buffer + place, size - place);
                for (uint32_t i = place; i < place + length; i++) {
                    buffer[i] = (uint8_t)pick(256);
                }
                size += length;
            }
            break;
        case 2: /* fewer */
            if (place + length <= size) {
                memmove(buffer + place, buffer + place + length, size - place - length);
                size -= length;
            }
            break;
        case 3: /* a little up or down */
            if (place < size) {
                buffer[place] = (uint8_t)(buffer[place] + pick(9) - 4);
            }
            break;
        case 4: /* what another has there */
            for (uint32_t i = place; i < size && i < other.size && i < place + 4 * length; i++) {
                buffer[i] = other.bytes[i];
            }
            break;
        default: /* how another goes on */
            if (other.size > 0) {
                const size_t from = pick((uint32_t)other.size);
                for (size_t i = from; i < other.size && size < longest; i++) {
                    buffer[size++] = other.bytes[i];
                }
            }
        }
    }
    return size;
}

/* --- files */

static bool run_file(const char *path, bool keeps) {
    FILE *file = fopen(path, "rb");
    if (file == NULL) {
        return false;
    }
    const size_t size = fread(buffer, 1, sizeof buffer, file);
    fclose(file);
    run(buffer, size);
    if (keeps) {
        keep(buffer, size, false);
    }
    return true;
}

static int by_name(const void *a, const void *b) {
    return strcmp(*(char *const *)a, *(char *const *)b);
}

/* In the order of their names: the same run everywhere. */
static void run_folder(const char *path) {
    static char *names[KEPT];
    size_t count = 0;
    DIR *directory = opendir(path);
    for (struct dirent *entry; directory != NULL && count < KEPT && (entry = readdir(directory)) != NULL;) {
        if (entry->d_name[0] != '.') {
            names[count++] = strdup(entry->d_name);
        }
    }
    if (directory != NULL) {
        closedir(directory);
    }
    qsort(names, count, sizeof *names, by_name);
    for (size_t i = 0; i < count; i++) {
        char whole[PATH_ROOM];
        snprintf(whole, sizeof whole, "%s/%s", path, names[i]);
        run_file(whole, true);
        free(names[i]);
    }
}

static bool option(const char *word, const char *name, unsigned long *value) {
    const size_t length = strlen(name);
    if (strncmp(word, name, length) != 0) {
        return false;
    }
    *value = strtoul(word + length, NULL, 10);
    return true;
}

int main(int count, char **words) {
    char path[PATH_ROOM];
    int first = 1;
    for (; first < count && words[first][0] == '-'; first++) {
        if (strncmp(words[first], "-artifact_prefix=", 17) == 0) {
            prefix = words[first] + 17;
        } else if (!option(words[first], "-seed=", &seed) && !option(words[first], "-max_total_time=", &seconds) &&
                   !option(words[first], "-max_len=", &longest) && !option(words[first], "-timeout=", &timeout)) {
            fprintf(stderr, "%s is not known here\n", words[first]);
        }
    }
    longest = longest < LONGEST ? longest : LONGEST;
    state = seed;
    snprintf(path, sizeof path, "%srunning", prefix);
    const int file = open(path, O_RDWR | O_CREAT | O_TRUNC, 0666);
    const size_t room = sizeof(size_t) + LONGEST;
    if (file < 0 || ftruncate(file, (off_t)room) != 0) {
        return 2;
    }
    running = mmap(NULL, room, PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
    if (running == MAP_FAILED) {
        return 2;
    }
    LLVMFuzzerInitialize(&count, &words);
    struct stat about;
    for (int i = first; i < count; i++) {
        if (stat(words[i], &about) == 0 && S_ISDIR(about.st_mode)) {
            folder = folder != NULL ? folder : words[i];
            run_folder(words[i]);
        } else if (!run_file(words[i], false)) {
            fprintf(stderr, "%s cannot be read\n", words[i]);
            return 2;
        }
    }
    const time_t until = time(NULL) + (time_t)seconds;
    while (folder != NULL && time(NULL) < until) {
        const size_t size = change();
        run(buffer, size);
        keep(buffer, size, true);
    }
    alarm(0);
    printf("inputs %lu kept %lu edges %lu\n", runs, (unsigned long)kept_count, (unsigned long)reached);
    munmap(running, room);
    close(file);
    unlink(path);
    return 0;
}

/* Worst-case time of a unit's fmi2DoStep, for real-time targets.
 *
 *   worst_case MODE LIBRARY SCRIPT REPEATS [INDICES]
 *
 * SCRIPT holds words: guid, resources (a URI, or -), h, steps; count of parameters and reference, value of each; count
 * of inputs and their references; then a row of values of the inputs per instant 0 .. steps, linear in between.
 *
 * - time: runs the whole script REPEATS times from the same saved state and prints, per step, the shortest time in ns:
 *   what the operating system does to a step differs from run to run, what the step does itself does not. A last line
 *   holds median, 99.99th percentile and maximum of all steps of all runs, then median and maximum of the shortest
 *   times, per step, that setting the inputs and their slopes took.
 * - cold: the same, caches filled with something else ahead of every step that the file INDICES lists; prints the
 *   shortest times of those.
 * - count: runs once, the steps of INDICES through measured_step(), for callgrind to count instructions there.
 * - confined: runs once with all system calls but read and write forbidden (seccomp, strict: the process would be
 *   killed), and prints how often the unit asked for memory. Linux only. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#ifdef __linux__
#include <linux/seccomp.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <unistd.h>
#endif

#include "fmi2FunctionTypes.h"

enum { MOST = 64, FLUSHED = 64 << 20 };

static fmi2SetRealTYPE *set;
static fmi2SetRealInputDerivativesTYPE *set_slopes;
static fmi2DoStepTYPE *do_step;
static fmi2GetFMUstateTYPE *save;
static fmi2SetFMUstateTYPE *restore;

static fmi2Component unit;
static size_t steps, driven;
static fmi2ValueReference inputs[MOST];
static fmi2Integer first[MOST];
static double h, *rows;
static long asked; /* how often the unit asked for memory, or gave it back */

static void fail(const char *what) {
    fprintf(stderr, "worst_case: %s\n", what);
    exit(2);
}

static void *symbol(void *library, const char *name) {
    void *found = dlsym(library, name);
    if (found == NULL) {
        fail(name);
    }
    return found;
}
#define FIND(variable, name) *(void **)&variable = symbol(library, name)

static void logger(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status, fmi2String category,
                   fmi2String message, ...) {
    (void)environment;
    (void)category;
    fprintf(stderr, "%s [%d] %s\n", name, (int)status, message);
}

static void *allocate(size_t count, size_t size) {
    asked++;
    return calloc(count, size);
}

static void give_back(void *memory) {
    asked++;
    free(memory);
}

static double number(FILE *file) {
    double value;
    if (fscanf(file, "%lf", &value) != 1) {
        fail("the script ends early");
    }
    return value;
}

/* Instance in step mode. */
static void begin(void *library, const char *path) {
    fmi2InstantiateTYPE *instantiate;
    fmi2SetupExperimentTYPE *set_up;
    fmi2EnterInitializationModeTYPE *enter;
    fmi2ExitInitializationModeTYPE *leave;
    FIND(instantiate, "fmi2Instantiate");
    FIND(set_up, "fmi2SetupExperiment");
    FIND(enter, "fmi2EnterInitializationMode");
    FIND(leave, "fmi2ExitInitializationMode");
    FIND(set, "fmi2SetReal");
    FIND(set_slopes, "fmi2SetRealInputDerivatives");
    FIND(do_step, "fmi2DoStep");
    FIND(save, "fmi2GetFMUstate");
    FIND(restore, "fmi2SetFMUstate");
    static const fmi2CallbackFunctions callbacks = {logger, allocate, give_back, NULL, NULL};
    char guid[64], resources[4096];
    FILE *file = fopen(path, "r");
    if (file == NULL || fscanf(file, "%63s %4095s", guid, resources) != 2) {
        fail("no script");
    }
    h = number(file);
    steps = (size_t)number(file);
    unit = instantiate("unit", fmi2CoSimulation, guid, strcmp(resources, "-") ? resources : NULL, &callbacks, 0, 0);
    if (unit == NULL) {
        fail("fmi2Instantiate");
    }
    for (size_t i = (size_t)number(file); i > 0; i--) {
        const fmi2ValueReference reference = (fmi2ValueReference)number(file);
        const double value = number(file);
        if (set(unit, &reference, 1, &value) != fmi2OK) {
            fail("a parameter");
        }
    }
    driven = (size_t)number(file);
    if (driven > MOST) {
        fail("too many inputs");
    }
    for (size_t i = 0; i < driven; i++) {
        inputs[i] = (fmi2ValueReference)number(file);
        first[i] = 1;
    }
    rows = calloc((steps + 1) * driven + 1, sizeof *rows);
    if (rows == NULL) {
        fail("memory");
    }
    for (size_t i = 0; i < (steps + 1) * driven; i++) {
        rows[i] = number(file);
    }
    fclose(file);
    if (set_up(unit, 0, 0, 0, 0, 0) != fmi2OK || enter(unit) != fmi2OK ||
        (driven > 0 && set(unit, inputs, driven, rows) != fmi2OK) || leave(unit) != fmi2OK) {
        fail("initialisation");
    }
}

static void drive(size_t k) {
    const double *now = rows + k * driven, *next = now + driven;
    double slopes[MOST];
    for (size_t i = 0; i < driven; i++) {
        slopes[i] = (next[i] - now[i]) / h;
    }
    if (driven > 0 &&
        (set(unit, inputs, driven, now) != fmi2OK || set_slopes(unit, inputs, driven, first, slopes) != fmi2OK)) {
        fail("inputs");
    }
}

static int step(size_t k) {
    return do_step(unit, (double)k * h, h, fmi2True) == fmi2OK;
}

/* Under this name in callgrind's output. */
int measured_step(size_t k);
__attribute__((noinline)) int measured_step(size_t k) {
    return step(k);
}

static double now_ns(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return 1e9 * (double)t.tv_sec + (double)t.tv_nsec;
}

static int ascending(const void *a, const void *b) {
    const float x = *(const float *)a, y = *(const float *)b;
    return (x > y) - (x < y);
}

/* Marks of the steps in the file; all where there is none. */
static unsigned char *read_marks(const char *path) {
    unsigned char *marks = calloc(steps, 1);
    FILE *file = path != NULL ? fopen(path, "r") : NULL;
    if (marks == NULL || (path != NULL && file == NULL)) {
        fail("no indices");
    }
    unsigned long k;
    while (file != NULL && fscanf(file, "%lu", &k) == 1) {
        if (k < steps) {
            marks[k] = 1;
        }
    }
    if (file != NULL) {
        fclose(file);
    } else {
        memset(marks, 1, steps);
    }
    return marks;
}

static volatile unsigned char sink;
static void fill_caches(unsigned char *memory) {
    for (size_t i = 0; i < FLUSHED; i += 64) {
        sink = (unsigned char)(sink + memory[i]++);
    }
}

static void time_steps(size_t repeats, const unsigned char *marks, unsigned char *flush) {
    fmi2FMUstate start = NULL;
    double *shortest = calloc(steps, sizeof *shortest), clock_cost = 1e9;
    float *all = calloc(steps * repeats, sizeof *all), *setting = calloc(steps, sizeof *setting);
    if (shortest == NULL || all == NULL || setting == NULL || save(unit, &start) != fmi2OK) {
        fail("memory");
    }
    for (int i = 0; i < 100000; i++) {
        const double begun = now_ns(), cost = now_ns() - begun;
        if (cost < clock_cost) {
            clock_cost = cost;
        }
    }
    for (size_t r = 0; r < repeats; r++) {
        if (restore(unit, start) != fmi2OK) {
            fail("fmi2SetFMUstate");
        }
        for (size_t k = 0; k < steps; k++) {
            const double set_out = now_ns();
            drive(k);
            const float set_for = (float)(now_ns() - set_out - clock_cost);
            if (r == 0 || set_for < setting[k]) {
                setting[k] = set_for;
            }
            if (flush != NULL && marks[k]) {
                fill_caches(flush);
            }
            const double begun = now_ns();
            const int good = step(k);
            const double spent = now_ns() - begun - clock_cost;
            if (!good) {
                fail("fmi2DoStep");
            }
            if (r == 0 || spent < shortest[k]) {
                shortest[k] = spent;
            }
            all[r * steps + k] = (float)spent;
        }
    }
    for (size_t k = 0; k < steps; k++) {
        if (marks[k]) {
            printf("%zu %.0f\n", k, shortest[k]);
        }
    }
    const size_t count = steps * repeats;
    qsort(all, count, sizeof *all, ascending);
    qsort(setting, steps, sizeof *setting, ascending);
    printf("all %.0f %.0f %.0f %.0f %.0f\n", (double)all[count / 2], (double)all[(size_t)((double)count * 0.9999)],
           (double)all[count - 1], (double)setting[steps / 2], (double)setting[steps - 1]);
}

static void run_confined(size_t repeats) {
#ifdef __linux__
    const long before = asked;
    if (prctl(PR_SET_SECCOMP, SECCOMP_MODE_STRICT) != 0) {
        fail("seccomp is not to be had");
    }
    if (repeats == 0) {
        syscall(SYS_getppid);
    }
    int good = 1;
    for (size_t k = 0; good && k < steps; k++) {
        drive(k);
        good = step(k);
    }
    char text[64];
    const int length = snprintf(text, sizeof text, "%s %ld\n", good ? "stepped" : "failed", asked - before);
    if (write(1, text, (size_t)length) != length) {
        good = 0;
    }
    syscall(SYS_exit, good ? 0 : 1);
#else
    (void)repeats;
    fail("seccomp is of Linux");
#endif
}

int main(int count, char *words[]) {
    if (count != 5 && count != 6) {
        fprintf(stderr, "usage: worst_case time|cold|count|confined LIBRARY SCRIPT REPEATS [INDICES]\n");
        return 2;
    }
    void *library = dlopen(words[2], RTLD_NOW | RTLD_LOCAL);
    if (library == NULL) {
        fail(dlerror());
    }
    begin(library, words[3]);
    const size_t repeats = (size_t)atol(words[4]);
    const unsigned char *marks = read_marks(count == 6 ? words[5] : NULL);
    if (strcmp(words[1], "time") == 0) {
        time_steps(repeats, marks, NULL);
    } else if (strcmp(words[1], "cold") == 0) {
        unsigned char *memory = malloc(FLUSHED);
        if (memory == NULL) {
            fail("memory");
        }
        memset(memory, 1, FLUSHED);
        time_steps(repeats, marks, memory);
    } else if (strcmp(words[1], "confined") == 0) {
        run_confined(repeats);
    } else {
        for (size_t k = 0; k < steps; k++) {
            drive(k);
            if (!(marks[k] ? measured_step(k) : step(k))) {
                fail("fmi2DoStep");
            }
        }
    }
    return 0;
}

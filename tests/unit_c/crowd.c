/* Many instances in one process, in turn and at the same time: each gives what it gives alone, to the last bit, and
 * returns all its memory.
 *
 *   crowd LIBRARY GUID RESOURCES INSTANCES THREADS STEPS
 *
 * Prints the memory an instance takes. Exits with 1 where something is not so. */
#include <math.h>
#include <pthread.h>
#include <stdint.h>
#include <stdlib.h>
#include <unistd.h>
#ifdef __GLIBC__ /* told by the headers above */
#include <malloc.h>
#endif

#include "loaded.h"

#define T_C 125e-6 /* a control cycle [s] */
enum { ROUNDS = 4 };

/* --- memory, counted */

static long long held, most;

/* Relaxed: a lock would put the threads' lives in an order, and hide from a sanitizer what they share. */
static void count_held(long long bytes) {
    const long long now = __atomic_add_fetch(&held, bytes, __ATOMIC_RELAXED);
    if (now > __atomic_load_n(&most, __ATOMIC_RELAXED)) {
        __atomic_store_n(&most, now, __ATOMIC_RELAXED);
    }
}

static void *allocate(size_t count, size_t size) {
    size_t *memory = calloc(1, count * size + 2 * sizeof(size_t)); /* keeps the alignment of calloc */
    if (memory == NULL) {
        return NULL;
    }
    memory[0] = count * size;
    count_held((long long)memory[0]);
    return memory + 2;
}

static void release(void *given) {
    size_t *memory = (size_t *)given - 2;
    count_held(-(long long)memory[0]);
    free(memory);
}

/* Resident pages of this process; 0 where the system does not tell. */
static long resident(void) {
#ifdef __GLIBC__
    malloc_trim(0); /* what is free goes back to the system first */
#endif
    long size = 0, pages = 0;
    FILE *file = fopen("/proc/self/statm", "r");
    if (file == NULL) {
        return 0;
    }
    if (fscanf(file, "%ld %ld", &size, &pages) != 2) {
        pages = 0;
    }
    fclose(file);
    return pages;
}

/* --- a life, told apart from others by its seed */

static char **arguments;
static Interface unit;
static int steps;

typedef struct Life {
    int seed, faults;
    fmi2Component c;
    uint64_t results;
    double values[MOST];
} Life;

static void live(Life *life, fmi2Status status) {
    life->faults += status != fmi2OK;
}

static void be_born(Life *life) {
    static const fmi2CallbackFunctions callbacks = {tell, allocate, release, NULL, NULL};
    char name[24];
    snprintf(name, sizeof name, "one of many %d", life->seed);
    life->faults = 0;
    life->results = 0xcbf29ce484222325u;
    life->c = fmu.Instantiate(name, fmi2CoSimulation, arguments[2], arguments[3], &callbacks, fmi2False, fmi2False);
    if (life->c == NULL) {
        printf("no instance %d\n", life->seed);
        exit(1);
    }
    live(life, fmu.SetupExperiment(life->c, fmi2False, 0, life->seed, fmi2False, 0));
    live(life, fmu.EnterInitializationMode(life->c));
    live(life, fmu.ExitInitializationMode(life->c));
}

static void go_on(Life *life, int k) {
    for (size_t i = 0; i < unit.input_count; i++) {
        life->values[i] = 1e-3 * sin(0.01 * k * (1 + life->seed) + (double)i);
    }
    live(life, fmu.SetReal(life->c, unit.inputs, unit.input_count, life->values));
    live(life, fmu.DoStep(life->c, life->seed + k * T_C, T_C, fmi2True));
    live(life, fmu.GetReal(life->c, unit.reals, unit.real_count, life->values));
    const unsigned char *bytes = (const unsigned char *)life->values;
    for (size_t i = 0; i < unit.real_count * sizeof *life->values; i++) {
        life->results = (life->results ^ bytes[i]) * 0x100000001b3u;
    }
    if (k % 64 == 0) { /* there and back */
        fmi2FMUstate state = NULL;
        live(life, fmu.GetFMUstate(life->c, &state));
        live(life, fmu.SetFMUstate(life->c, state));
        live(life, fmu.FreeFMUstate(life->c, &state));
    }
}

static void *whole(void *given) {
    Life *life = given;
    be_born(life);
    for (int k = 0; k < steps; k++) {
        go_on(life, k);
    }
    fmu.FreeInstance(life->c);
    return NULL;
}

/* Threads wait for one another, so that they do run at the same time. */
static pthread_mutex_t guard = PTHREAD_MUTEX_INITIALIZER;
static pthread_cond_t opened = PTHREAD_COND_INITIALIZER;
static int awaited;

static void *whole_at_once(void *given) {
    pthread_mutex_lock(&guard);
    awaited--;
    pthread_cond_broadcast(&opened);
    while (awaited > 0) {
        pthread_cond_wait(&opened, &guard);
    }
    pthread_mutex_unlock(&guard);
    return whole(given);
}

static void compare(const Life lives[], const uint64_t alone[], int count, const char *what) {
    for (int i = 0; i < count; i++) {
        must(lives[i].faults == 0, "every call of it");
        must(lives[i].results == alone[i], what);
    }
}

int main(int count, char *given[]) {
    if (count != 7) {
        printf("usage: %s LIBRARY GUID RESOURCES INSTANCES THREADS STEPS\n", given[0]);
        return 2;
    }
    arguments = given;
    const int instances = atoi(given[4]), threads = atoi(given[5]);
    steps = atoi(given[6]);
    if (!load(given[1])) {
        return 2;
    }
    Life *lives = calloc((size_t)instances, sizeof *lives);
    uint64_t *alone = calloc((size_t)instances, sizeof *alone);
    pthread_t *running = calloc((size_t)threads, sizeof *running);
    if (lives == NULL || alone == NULL || running == NULL || threads > instances) {
        return 2;
    }

    be_born(&lives[0]);
    explore(lives[0].c, &unit);
    fmu.FreeInstance(lives[0].c);
    const long long one = most;
    for (int i = 0; i < instances; i++) {
        lives[i].seed = i;
        whole(&lives[i]);
        alone[i] = lives[i].results;
    }
    must(held == 0, "memory returned by instances one after another");
    if (unit.input_count > 0) {
        must(alone[0] != alone[1], "lives that differ");
    }

    /* in turn: each step of all */
    long pages = 0;
    for (int round = 0; round < ROUNDS; round++) {
        most = 0;
        for (int i = 0; i < instances; i++) {
            be_born(&lives[i]);
        }
        for (int k = 0; k < steps; k++) {
            for (int i = 0; i < instances; i++) {
                go_on(&lives[i], k);
            }
        }
        compare(lives, alone, instances, "the same in turn with others as alone");
        for (int i = 0; i < instances; i++) {
            fmu.FreeInstance(lives[i].c);
        }
        must(held == 0, "memory returned by instances side by side");
        must(most <= instances * 2 * one, "no more memory than so many instances alone");
        pages = round == 0 ? resident() : pages;
    }
    /* what the process keeps does not grow from round to round: a leak of a kilobyte an instance would be 600 kB */
    const long growth = (resident() - pages) * sysconf(_SC_PAGESIZE);
    must(growth < 200 * 1024, "memory of the process after further rounds");

    /* at the same time, and for longer */
    steps *= 20;
    for (int i = 0; i < threads; i++) {
        whole(&lives[i]);
        alone[i] = lives[i].results;
    }
    awaited = threads;
    for (int i = 0; i < threads; i++) {
        if (pthread_create(&running[i], NULL, whole_at_once, &lives[i]) != 0) {
            return 2;
        }
    }
    for (int i = 0; i < threads; i++) {
        pthread_join(running[i], NULL);
    }
    compare(lives, alone, threads, "the same in threads as alone");
    must(held == 0, "memory returned by instances in threads");
    printf("%lld bytes an instance, %d instances, %d threads, process grew by %ld bytes, %d faults\n", one, instances,
           threads, growth, faults);
    free(lives);
    free(alone);
    free(running);
    return faults > 0;
}

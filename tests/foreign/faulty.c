/* Another maker's friction whose program misbehaves as its parameter Kind says, at the time of its parameter At; while it
 * is loaded and instantiated as it is compiled to (FAULT). Where the environment has CALLS, it notes its last calls in
 * that file. */
#define _GNU_SOURCE
#define GUID "{acme-friction}"
#define REALS 6
#define BOOLEANS 1

#define LOADING 1
#define INSTANTIATING 2
#ifndef FAULT
#define FAULT 0
#endif

static void crash(void);

/* What the shell does ahead of making an instance, and at its end. */
#if FAULT == INSTANTIATING
#define BEFORE_INSTANTIATION crash();
#endif
#define TERMINATION(unit) terminate(unit)
#define BEFORE_FREEING(unit) before_freeing(unit);
struct Unit;
static int terminate(struct Unit *unit);
static void before_freeing(struct Unit *unit);
#include "shell.h"

#include <fenv.h>
#include <stdio.h>
#include <sys/resource.h>
#include <unistd.h>

enum { SPEED, TORQUE, COULOMB, VISCOUS, AT, KIND };
/* In the order of the table in test_faulty_units.py. */
typedef enum Kind {
    NONE, CRASH, ABORT, STACK, EXIT_0, EXIT_1, LOOP, SLEEP,
    DISCARD, ERROR, FATAL, PENDING, STATUS_99, SPEAKS_AND_FAILS, NOT_A_NUMBER,
    CLOSES_LOW, CLOSES_ALL, SCRIBBLES_LOW, SCRIBBLES_ALL, LOWERS_LIMITS, FORKS,
    ROUNDS_UP, FLUSHES, LOGS_NULL, LOGS_BYTES, LOGS_WITHOUT_END, LOGS_OFTEN, LOGS_ODDLY,
    TERMINATE_CRASHES, TERMINATE_FAILS, TERMINATE_HANGS, FREEING_CRASHES, FREEING_EXITS
} Kind;

static const double STARTS[REALS] = {[COULOMB] = 0.01, [VISCOUS] = 1e-5, [AT] = 1e9};

static volatile int *volatile nowhere;
static volatile double sink;

static void crash(void) { *nowhere = 1; }

static double deeper(double x) {
    volatile double room[4096];
    room[0] = x;
    return room[0] + deeper(x + room[(int)x % 4096]);
}

static void speak(Unit *unit, const char *name, int status, const char *category, const char *message) {
    unit->callbacks->logger(unit->callbacks->componentEnvironment, name, status, category, message);
}

static void note(const char *call) {
    FILE *file = getenv("CALLS") ? fopen(getenv("CALLS"), "a") : NULL;
    if (file) {
        fprintf(file, "%s\n", call);
        fclose(file);
    }
}

static int misbehave(Unit *unit, Kind kind) {
    switch (kind) {
    case CRASH:
        crash();
        break;
    case ABORT:
        abort();
    case STACK:
        sink = deeper(1);
        break;
    case EXIT_0:
        exit(0);
    case EXIT_1:
        exit(1);
    case LOOP:
        for (;;)
            sink += 1;
    case SLEEP:
        sleep(1000);
        break;
    case DISCARD:
    case ERROR:
    case FATAL:
    case PENDING:
        return fmi2Discard + (int)(kind - DISCARD);
    case STATUS_99:
        return 99;
    case SPEAKS_AND_FAILS:
        speak(unit, "u", fmi2OK, "logAll", "the oil is cold");
        return fmi2Error;
    case NOT_A_NUMBER:
        unit->real[TORQUE] = NAN;
        break;
    case CLOSES_LOW:
    case CLOSES_ALL:
        for (int f = 3; f < (kind == CLOSES_LOW ? 200 : 70000); f++)
            close(f);
        break;
    case SCRIBBLES_LOW:
    case SCRIBBLES_ALL:
        for (int f = 3; f < (kind == SCRIBBLES_LOW ? 200 : 70000); f++)
            if (write(f, "\x7f\xff\xff\xff garbage", 12) < 0)
                sink += 1;
        break;
    case LOWERS_LIMITS: {
        const struct rlimit none = {0, 0};
        setrlimit(RLIMIT_AS, &none);
        setrlimit(RLIMIT_FSIZE, &none);
        setrlimit(RLIMIT_NOFILE, &none);
        break;
    }
    case FORKS: /* and both go on */
        if (fork() < 0)
            return fmi2Error;
        unit->real[AT] = 1e9;
        break;
    case ROUNDS_UP:
        fesetround(FE_UPWARD);
        break;
    case FLUSHES:
#if defined(__x86_64__)
        __builtin_ia32_ldmxcsr(__builtin_ia32_stmxcsr() | 0x8040);
#else
        fesetround(FE_TOWARDZERO);
#endif
        break;
    case LOGS_NULL:
        speak(unit, NULL, fmi2Warning, NULL, NULL);
        break;
    case LOGS_BYTES:
        speak(unit, "\xff", fmi2Warning, "\xfe", "caf\xe9 \xff\xfe");
        break;
    case LOGS_WITHOUT_END: {
        const size_t size = 20u << 20;
        char *text = malloc(size);
        memset(text, 'y', size);
        text[size - 1] = 0;
        speak(unit, "u", fmi2Warning, "logAll", text);
        free(text);
        break;
    }
    case LOGS_OFTEN:
        for (int i = 0; i < 1000; i++)
            unit->callbacks->logger(unit->callbacks->componentEnvironment, "u", fmi2Warning, "logAll", "again %d", i);
        break;
    case LOGS_ODDLY:
        speak(unit, "", -7, "", "");
        speak(unit, "another unit", 77, "no such category", "odd");
        break;
    default:
        break;
    }
    return fmi2OK;
}

static int terminate(Unit *unit) {
    const Kind kind = (Kind)unit->real[KIND];
    note("fmi2Terminate");
    if (kind == TERMINATE_CRASHES)
        crash();
    while (kind == TERMINATE_HANGS)
        sink += 1;
    return kind == TERMINATE_FAILS ? fmi2Error : fmi2OK;
}

static void before_freeing(Unit *unit) {
    const Kind kind = (Kind)unit->real[KIND];
    note("fmi2FreeInstance");
    if (kind == FREEING_CRASHES)
        crash();
    if (kind == FREEING_EXITS)
        exit(0);
}

#if FAULT == LOADING
__attribute__((constructor)) static void loaded(void) { crash(); }
#endif
static fmi2Status advance(Unit *unit, double h) {
    double *v = unit->real;
    const int due = unit->state > v[AT] - 1e-9;
    unit->state += h;
    v[TORQUE] = v[COULOMB] * tanh(v[SPEED]) + v[VISCOUS] * v[SPEED];
    return due ? (fmi2Status)misbehave(unit, (Kind)v[KIND]) : fmi2OK;
}

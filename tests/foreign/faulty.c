/* Another maker's friction whose program fails as it is compiled to (FAULT), at the time of its parameter. */
#define GUID "{acme-friction}"
#define REALS 5
#define BOOLEANS 1

#define CRASH 1
#define ABORT 2
#define STACK 3
#define EXIT_0 4
#define EXIT_1 5
#define LOOP 6
#define SLEEP 7
#define LOADING 8
#define INSTANTIATING 9

static void crash(void);

/* What the shell does ahead of making an instance. */
#if FAULT == INSTANTIATING
#define BEFORE_INSTANTIATION crash();
#endif
#include "shell.h"

#include <math.h>
#include <unistd.h>

enum { SPEED, TORQUE, COULOMB, VISCOUS, AT };

static const double STARTS[REALS] = {[COULOMB] = 0.01, [VISCOUS] = 1e-5, [AT] = 1e9};

static volatile int *volatile nowhere;
static volatile double sink;

static void crash(void) { *nowhere = 1; }

static double deeper(double x) {
    volatile double room[4096];
    room[0] = x;
    return room[0] + deeper(x + room[(int)x % 4096]);
}

static void fail(void) {
    if (FAULT == CRASH)
        crash();
    else if (FAULT == ABORT)
        abort();
    else if (FAULT == STACK)
        sink = deeper(1);
    else if (FAULT == EXIT_0)
        exit(0);
    else if (FAULT == EXIT_1)
        exit(1);
    else if (FAULT == SLEEP)
        sleep(1000);
    while (FAULT == LOOP)
        sink += 1;
}

#if FAULT == LOADING
__attribute__((constructor)) static void loaded(void) { crash(); }
#endif
static fmi2Status advance(Unit *unit, double h) {
    double *v = unit->real;
    if (unit->state > v[AT] - 1e-9)
        fail();
    unit->state += h;
    v[TORQUE] = v[COULOMB] * tanh(v[SPEED]) + v[VISCOUS] * v[SPEED];
    return fmi2OK;
}

/* Ten million steps of a unit, the time kept as masters keep it: the results are the same to the last bit, and the
 * unit's own clock stays on the exact grid.
 *
 *   long_run LIBRARY GUID RESOURCES STEPS [OUTPUT INPUT PERIOD STEP]
 *
 * With OUTPUT and INPUT (value references) a second run takes steps of STEP ns: OUTPUT, which the unit samples every
 * PERIOD ns and which reacts to INPUT, must change in those steps, and in no others, in which a multiple of the period
 * lies: at their start or later. Without input (-1) OUTPUT changes by itself, with a multiple at the end of the step or
 * earlier. Exits with 1 where something is not so. */
#include <math.h>
#include <stdint.h>
#include <stdlib.h>

#include "loaded.h"

#define T_C 125e-6 /* a control cycle [s] */

static Interface unit;

static fmi2Component start(char *arguments[], double t) {
    static const fmi2CallbackFunctions callbacks = {tell, calloc, free, NULL, NULL};
    fmi2Component c =
        fmu.Instantiate("long run", fmi2CoSimulation, arguments[2], arguments[3], &callbacks, fmi2False, fmi2False);
    if (c == NULL) {
        exit(1);
    }
    MUST(fmu.SetupExperiment(c, fmi2False, 0, t, fmi2False, 0));
    MUST(fmu.EnterInitializationMode(c));
    MUST(fmu.ExitInitializationMode(c));
    return c;
}

static uint64_t hash(uint64_t seed, const double values[], size_t count) {
    const unsigned char *bytes = (const unsigned char *)values;
    for (size_t i = 0; i < count * sizeof *values; i++) {
        seed = (seed ^ bytes[i]) * 0x100000001b3u;
    }
    return seed;
}

/* What it says of itself: t + h and t_0 + k h are two roundings of the same. */
static void reached(fmi2Component c, double t) {
    static double values[MOST];
    double told = 0;
    MUST(fmu.GetRealStatus(c, fmi2LastSuccessfulTime, &told));
    must(fabs(told - t) <= 4e-16 * fabs(t), "the time that was reached");
    MUST(fmu.GetReal(c, unit.reals, unit.real_count, values));
    for (size_t i = 0; i < unit.real_count; i++) {
        must(isfinite(values[i]), "finite results");
    }
}

/* How masters count: t_0 + k h, or in whole nanoseconds. */
typedef enum Way { PRODUCT, NANOSECONDS } Way;

/* Hash of all results on the way; inputs change every 997 steps. */
static uint64_t run(char *arguments[], double t_0, Way way, int64_t count) {
    static double values[MOST];
    fmi2Component c = start(arguments, t_0);
    double t = t_0;
    uint64_t results = 0xcbf29ce484222325u;
    for (int64_t k = 0; k < count && faults == 0; k++) {
        if (k % 997 == 0) {
            MUST(fmu.GetReal(c, unit.reals, unit.real_count, values));
            results = hash(results, values, unit.real_count);
            for (size_t i = 0; i < unit.input_count; i++) {
                values[i] = 1e-3 * sin(0.37 * (double)(k / 997) + (double)i);
            }
            MUST(fmu.SetReal(c, unit.inputs, unit.input_count, values));
        }
        MUST(fmu.DoStep(c, t, T_C, fmi2True));
        t = way == PRODUCT ? t_0 + (double)(k + 1) * T_C : (double)((k + 1) * 125000) / 1e9;
    }
    MUST(fmu.GetReal(c, unit.reals, unit.real_count, values));
    results = hash(results, values, unit.real_count);
    reached(c, t);
    fmu.FreeInstance(c);
    return results;
}

/* The results behind a step of `h` from t on, and the instance as it was ahead of it. */
static void tried(fmi2Component c, double t, double h, double values[]) {
    fmi2FMUstate state = NULL;
    MUST(fmu.GetFMUstate(c, &state));
    MUST(fmu.DoStep(c, t, h, fmi2True));
    MUST(fmu.GetReal(c, unit.reals, unit.real_count, values));
    MUST(fmu.SetFMUstate(c, state));
    MUST(fmu.FreeFMUstate(c, &state));
}

/* Two instances side by side, one told t = k h, the other the sum of h, which ends `off` a cycle beside it, some 1e-3
 * at most: the other's results are no farther from the one's than those of a step that ends twice as far off. So what
 * is sampled, which such a step does not change, is the same to the last bit, and what runs over the cycle is its value
 * at the sum; of extremes over the step likewise those at instants and those at its end. */
static void summed(char *arguments[], int64_t count) {
    static double early[MOST], exact[MOST], drifted[MOST];
    fmi2Component one = start(arguments, 0), other = start(arguments, 0);
    double t = 0, farthest = 0;
    for (int64_t k = 0; k < count && faults == 0; k++) {
        const double off = fabs(t + T_C - (double)(k + 1) * T_C) / T_C;
        if (k % 997 == 996) {
            tried(one, (double)k * T_C, (1 - 2 * off) * T_C, early);
        }
        MUST(fmu.DoStep(one, (double)k * T_C, T_C, fmi2True));
        MUST(fmu.DoStep(other, t, T_C, fmi2True));
        t += T_C;
        if (k % 997 != 996) {
            continue;
        }
        MUST(fmu.GetReal(one, unit.reals, unit.real_count, exact));
        MUST(fmu.GetReal(other, unit.reals, unit.real_count, drifted));
        farthest = off > farthest ? off : farthest;
        for (size_t i = 0; i < unit.real_count; i++) {
            const double rounding = 1e-15 * fabs(exact[i]); /* of the interpolation */
            must(fabs(drifted[i] - exact[i]) <= fabs(early[i] - exact[i]) + rounding,
                 "the same results with time as a sum of steps");
        }
        for (size_t i = 0; i < unit.input_count; i++) {
            exact[i] = 1e-3 * sin(0.37 * (double)(k / 997) + (double)i);
        }
        MUST(fmu.SetReal(one, unit.inputs, unit.input_count, exact));
        MUST(fmu.SetReal(other, unit.inputs, unit.input_count, exact));
    }
    printf("a sum of %lld steps is off by %.2g cycles\n", (long long)count, farthest);
    reached(one, (double)count * T_C);
    reached(other, t);
    fmu.FreeInstance(one);
    fmu.FreeInstance(other);
}

/* Whether a sampled output changes where it must, counted in whole nanoseconds. An instant within 1.5 % of a cycle
 * ahead of the end of a step may be worked in the next one, or within as much behind it in this one; such pairs of
 * steps are left out. */
static void sampled(char *arguments[], int64_t count) {
    const fmi2ValueReference output = (fmi2ValueReference)atoi(arguments[5]);
    const int given = atoi(arguments[6]);
    const fmi2ValueReference input = (fmi2ValueReference)given;
    const int64_t period = atoll(arguments[7]), step = atoll(arguments[8]), margin = 2500;
    fmi2Component c = start(arguments, 0);
    double before = 0, value = 0;
    int64_t changes = 0, open = 0;
    MUST(fmu.GetReal(c, &output, 1, &before));
    for (int64_t k = 0; k < count && faults == 0; k++) {
        const double measured = 1e-6 * (double)(k % 1000 + 1);
        if (given >= 0) {
            MUST(fmu.SetReal(c, &input, 1, &measured));
        }
        MUST(fmu.DoStep(c, (double)(k * step) / 1e9, (double)step / 1e9, fmi2True));
        MUST(fmu.GetReal(c, &output, 1, &value));
        const bool changed = memcmp(&value, &before, sizeof value) != 0;
        const int64_t from = k * step, to = from + step;
        /* multiples of the period in [from, to), or in (from, to] */
        const bool due =
            given >= 0 ? (to - 1) / period > (from - 1 + period) / period - 1 : to / period > from / period;
        const int64_t past[] = {from % period, to % period}; /* the last multiple */
        bool either = false;
        for (int end = 0; end < 2; end++) {
            either = either || (past[end] > 0 && (past[end] <= margin || period - past[end] <= margin));
        }
        open += either;
        changes += changed;
        if (!either && due != changed) {
            printf("step %lld of %lld ns: %s\n", (long long)k, (long long)step, due ? "no sample" : "a sample");
            faults++;
        }
        before = value;
    }
    must(llabs(changes - count * step / period) <= 1, "the number of samples");
    must(open * 20 <= count, "the cases left out");
    fmu.FreeInstance(c);
}

int main(int count, char *arguments[]) {
    if (count != 5 && count != 9) {
        printf("usage: %s LIBRARY GUID RESOURCES STEPS [OUTPUT INPUT PERIOD STEP]\n", arguments[0]);
        return 2;
    }
    if (!load(arguments[1])) {
        return 2;
    }
    fmi2Component c = start(arguments, 0);
    explore(c, &unit);
    fmu.FreeInstance(c);
    const int64_t steps = atoll(arguments[4]);
    summed(arguments, steps);
    const uint64_t fewer = run(arguments, 0, PRODUCT, steps / 10);
    must(run(arguments, 0, NANOSECONDS, steps / 10) == fewer, "the same results with time in nanoseconds");
    must(run(arguments, 1000, PRODUCT, steps / 10) == fewer, "the same results from 1000 s on");
    must(run(arguments, 1e6, PRODUCT, steps / 10) == fewer, "the same results from 1e6 s on");
    if (count == 9) {
        sampled(arguments, steps);
    }
    printf("%lld steps, results %016llx after a tenth of them, %d faults\n", (long long)steps,
           (unsigned long long)fewer, faults);
    return faults > 0;
}

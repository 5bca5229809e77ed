/* Runs the whole life of an FMU's instances again and again, for use under a leak checker:
 *
 *   lifecycle LIBRARY GUID RESOURCES [STEPS [STEP_SIZE]]
 *   valgrind --leak-check=full --error-exitcode=1 lifecycle build/plant.so <guid> src/plant_fmu/resources
 *
 * Knows no variable: it sets and reads whatever value references answer. Exits with 1 where a call fails that must not,
 * or where a replay from a saved state is not identical to the last bit. */
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "loaded.h"

enum { INSTANCES = 3, ROUNDS = 2 };

/* --- a life */

static void set_up(fmi2Component c) {
    MUST(fmu.SetupExperiment(c, fmi2True, 1e-6, 0, fmi2False, 0));
    MUST(fmu.EnterInitializationMode(c));
    MUST(fmu.ExitInitializationMode(c));
}

/* Small smooth inputs with slopes; sum of all Real variables over the run, for comparison. */
static double run(fmi2Component c, const Interface *unit, int first, int count, double h) {
    static double values[MOST];
    static int orders[MOST];
    double sum = 0;
    for (int k = first; k < first + count; k++) {
        for (size_t i = 0; i < unit->input_count; i++) {
            values[i] = 1e-3 * sin(0.01 * k + (double)i);
            orders[i] = 1;
        }
        MUST(fmu.SetReal(c, unit->inputs, unit->input_count, values));
        for (size_t i = 0; i < unit->input_count; i++) {
            values[i] = 1e-5 / h * cos(0.01 * k + (double)i);
        }
        MUST(fmu.SetRealInputDerivatives(c, unit->inputs, unit->input_count, orders, values));
        MUST(fmu.DoStep(c, k * h, h, fmi2False));
        MUST(fmu.GetReal(c, unit->reals, unit->real_count, values));
        for (size_t i = 0; i < unit->real_count; i++) {
            sum += values[i] * (1 + (double)(k % 7));
        }
    }
    must(isfinite(sum), "finite results");
    return sum;
}

static void derivatives(fmi2Component c, const Interface *unit) {
    double seed[MOST], values[MOST];
    for (size_t i = 0; i < unit->input_count; i++) {
        seed[i] = 1;
    }
    MUST(fmu.GetDirectionalDerivative(c, unit->outputs, unit->output_count, unit->inputs, unit->input_count, seed,
                                      values));
    for (size_t i = 0; i < unit->output_count; i++) {
        must(isfinite(values[i]), "finite directional derivative");
    }
}

/* Save, go on, go back by memory and by bytes, go on: the same to the last bit. */
static void replay(fmi2Component c, const Interface *unit, int first, int count, double h) {
    fmi2FMUstate saved = NULL, read = NULL;
    size_t size = 0;
    MUST(fmu.GetFMUstate(c, &saved));
    MUST(fmu.SerializedFMUstateSize(c, saved, &size));
    char *bytes = malloc(size);
    MUST(fmu.SerializeFMUstate(c, saved, bytes, size));
    double once = run(c, unit, first, count, h);
    MUST(fmu.SetFMUstate(c, saved));
    double again = run(c, unit, first, count, h);
    must(memcmp(&once, &again, sizeof once) == 0, "identical replay from a saved state");
    MUST(fmu.DeSerializeFMUstate(c, bytes, size, &read));
    MUST(fmu.SetFMUstate(c, read));
    again = run(c, unit, first, count, h);
    must(memcmp(&once, &again, sizeof once) == 0, "identical replay from a serialized state");
    MUST(fmu.FreeFMUstate(c, &read));
    MUST(fmu.GetFMUstate(c, &saved)); /* into the memory of the former */
    MUST(fmu.FreeFMUstate(c, &saved));
    free(bytes);
}

int main(int count, char *arguments[]) {
    if (count < 4) {
        printf("usage: %s LIBRARY GUID RESOURCES [STEPS [STEP_SIZE]]\n", arguments[0]);
        return 2;
    }
    int steps = count > 4 ? atoi(arguments[4]) : 2000;
    double h = count > 5 ? atof(arguments[5]) : 125e-6;
    if (!load(arguments[1])) {
        return 2;
    }

    static Interface unit;
    fmi2CallbackFunctions callbacks = {tell, calloc, free, NULL, NULL};
    for (int round = 0; round < ROUNDS; round++) {
        fmi2Component c[INSTANCES];
        double sums[INSTANCES];
        must(fmu.Instantiate("wrong", fmi2CoSimulation, "no GUID", arguments[3], NULL, fmi2False, fmi2False) == NULL,
             "a wrong GUID is refused");
        for (int i = 0; i < INSTANCES; i++) {
            c[i] = fmu.Instantiate("lifecycle", fmi2CoSimulation, arguments[2], arguments[3],
                                   round == 0 ? &callbacks : NULL, fmi2False, fmi2False);
            if (c[i] == NULL) {
                printf("no instance\n");
                return 1;
            }
            set_up(c[i]);
        }
        explore(c[0], &unit);
        for (int i = 0; i < INSTANCES; i++) {
            sums[i] = run(c[i], &unit, 0, steps, h);
        }
        must(memcmp(&sums[0], &sums[1], sizeof *sums) == 0, "two instances, one result");
        replay(c[0], &unit, steps, steps / 10 + 1, h);
        derivatives(c[0], &unit);
        MUST(fmu.Terminate(c[1]));
        for (int i = 0; i < INSTANCES; i++) {
            MUST(fmu.Reset(c[i]));
            set_up(c[i]);
            double sum = run(c[i], &unit, 0, steps, h);
            must(memcmp(&sum, &sums[i], sizeof sum) == 0, "the same result after a reset");
        }
        MUST(fmu.Terminate(c[0]));
        for (int i = 0; i < INSTANCES; i++) {
            fmu.FreeInstance(c[i]); /* terminated or not */
        }
    }
    printf("%s: %zu Real variables, %zu inputs, %zu outputs; %d steps, %d faults\n", arguments[1], unit.real_count,
           unit.input_count, unit.output_count, steps, faults);
    return faults > 0;
}

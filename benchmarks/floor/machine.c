#include "floor.h"
#include "fmi2FunctionTypes.h"

/* The machine as one unit, as an importer steps it: `count` steps of h; a row of table[count/every + 1] at the start
 * and at every `every` steps, of what references[width] name. Returns how many calls failed. */
#ifdef __GNUC__
__attribute__((visibility("default")))
#endif
long machine_steps(fmi2DoStepTYPE *do_step, fmi2GetRealTYPE *get_real, fmi2Component machine, double h, long count,
                   long every, const fmi2ValueReference references[], size_t width, double *table) {
    long failed = get_real(machine, references, width, table) != fmi2OK;
    for (long k = 0; k < count; k++) {
        failed += do_step(machine, (double)k * h, h, fmi2True) != fmi2OK;
        if ((k + 1) % every == 0) {
            table += width;
            failed += get_real(machine, references, width, table) != fmi2OK;
        }
    }
    return failed;
}

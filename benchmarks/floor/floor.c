#include "floor.h"

#include <math.h>

#define MOST_AXES 8

/* The default coupling, as feedsim/simulation/cosim/schedule.py has it, over `total` cycles of T_c.
 * setpoints[axes][positions][2] at every `ratio` cycles; a row of table[total/every + 1] at every `every`: per axis
 * controller and friction, then the plant. energies[axes][3]: residual, its peak, friction work. */
#ifdef __GNUC__
__attribute__((visibility("default")))
#endif
void floor_run(void *plant, void *const controllers[], void *const frictions[], size_t axes, long total, double T_c,
               long ratio, const double *setpoints, size_t positions, long every, double *table, double *energies) {
    double measured[2 * MOST_AXES], M_a[MOST_AXES], M_a_start[MOST_AXES], M_a_slope[MOST_AXES];
    double M_fr[MOST_AXES], M_fr_slope[MOST_AXES] = {0}, n[MOST_AXES], n_start[MOST_AXES];
    PlantMotion motion;
    plant_floor_prepare(plant, T_c, &motion);
    for (size_t i = 0; i < axes; i++) {
        M_fr[i] = friction_floor_torque(frictions[i]);
        n[i] = 0; /* the structure starts at rest */
    }
    plant_floor_measure(plant, &motion, n, measured);
    const double *setpoint = setpoints;
    long due = 0, sent = 0;
    for (long k = 0; k <= total; k++) {
        if (k == due) {
            for (size_t i = 0; i < axes; i++) {
                controller_floor_record(controllers[i], table);
                friction_floor_record(frictions[i], table + CONTROLLER_ROW);
                table += CONTROLLER_ROW + FRICTION_ROW;
            }
            plant_floor_record(plant, &motion, measured, table);
            table += axes * PLANT_AXIS_ROW + PLANT_TOOL_ROW;
            due += every;
        }
        if (k == total) {
            break;
        }
        if (k == sent) {
            setpoint = setpoints + 2 * (k / ratio);
            sent += ratio;
        }
        for (size_t i = 0; i < axes; i++) {
            controller_floor_cycle(controllers[i], setpoint + 2 * positions * i, measured + 2 * i, &M_a[i],
                                   &M_a_slope[i]);
            M_a_start[i] = M_a[i] - T_c * M_a_slope[i];
            n_start[i] = n[i];
        }
        plant_floor_step(plant, &motion, M_a_start, M_a_slope, M_fr, M_fr_slope, T_c, n);
        for (size_t i = 0; i < axes; i++) {
            const double assumed = M_fr[i] + T_c * M_fr_slope[i], before = M_fr[i];
            const double n_end = n_start[i] + (n[i] - n_start[i]) / T_c * T_c;
            M_fr[i] = friction_floor_step(frictions[i], n_start[i], n_end, T_c);
            M_fr_slope[i] = (M_fr[i] - before) / T_c;
            double *energy = energies + 3 * i;
            const double taken = M_fr[i] * n_end;
            energy[0] += 0.5 * T_c * (assumed * n[i] - taken);
            energy[1] = fmax(energy[1], fabs(energy[0]));
            energy[2] += T_c * taken;
        }
        plant_floor_measure(plant, &motion, n, measured);
    }
}

/* Monolithic reference of the coupled feed drives: sampled control and continuous plant with friction in one program,
 * without any co-simulation. Usage: monolithic INPUT OUTPUT. INPUT is plain text as main() reads it, SI units; OUTPUT
 * is rows of doubles, one row per control cycle, columns as in record(). */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "control.h"
#include "system.h"

static double number(FILE *file, const char *what) {
    double value;
    if (fscanf(file, "%lf", &value) != 1) {
        fprintf(stderr, "monolithic: no number for %s\n", what);
        exit(1);
    }
    return value;
}

static System machine;
static State state;
static Control control[MAX_AXES];

static void read_modes(FILE *file, int modes) {
    machine.modes = (modes + 7) / 8 * 8;
    for (int i = 0; i < modes; ++i) {
        double omega = 6.28318530717958647692 * number(file, "frequency");
        machine.stiffness[i] = omega * omega;
        machine.damping[i] = 2 * omega * number(file, "damping");
        for (int a = 0; a < machine.axes; ++a) {
            machine.n_port[a][i] = number(file, "n");
        }
        for (int a = 0; a < machine.axes; ++a) {
            machine.x_port[a][i] = number(file, "x");
        }
        for (int d = 0; d < DIRECTIONS; ++d) {
            machine.tcp_port[d][i] = number(file, "tcp");
        }
    }
}

static void read_mounts(FILE *file, int modes) {
    for (int m = 0; m < machine.mounts; ++m) {
        Mount *p = &machine.mount[m];
        double *const values[] = {&p->K_lin, &p->K_e, &p->F_max, &p->x_2, &p->K_v, &p->c};
        for (size_t i = 0; i < sizeof values / sizeof *values; ++i) {
            *values[i] = number(file, "mount");
        }
        for (int i = 0; i < modes; ++i) {
            p->port[i] = number(file, "mount's mode");
        }
    }
}

static void read_axis(FILE *file, Friction *f, Drive *d) {
    double *const friction[] = {&f->sigma_0, &f->sigma_1, &f->sigma_2, &f->F_C,       &f->F_S, &f->v_s,
                                &f->beta,    &f->F_log,   &f->v_log,   &f->asymmetry, &f->W,   &f->gamma};
    double *const drive[] = {&d->I_P,
                             &d->K_v,
                             &d->k_ffw,
                             &d->T_dyn,
                             &d->T_sym,
                             &d->K_p,
                             &d->T_n,
                             &d->omega_0,
                             &d->D,
                             &d->M_max,
                             &d->f,
                             &d->D_num,
                             &d->D_den,
                             &d->R,
                             &d->L_d,
                             &d->L_q,
                             &d->p,
                             &d->K_t,
                             &d->K_p_current,
                             &d->T_n_current,
                             &d->u_max,
                             &d->symmetry_lag,
                             &d->ramp,
                             &d->integrator,
                             &d->reference_model,
                             &d->ideal_current_loop,
                             &d->emf_feedforward};
    for (size_t i = 0; i < sizeof friction / sizeof *friction; ++i) {
        *friction[i] = number(file, "friction");
    }
    for (size_t i = 0; i < sizeof drive / sizeof *drive; ++i) {
        *drive[i] = number(file, "drive");
    }
}

static void record(FILE *file, const double *x_start, const double *M_a) {
    for (int a = 0; a < machine.axes; ++a) {
        const Control *c = &control[a];
        double n = motor_speed(&machine, &state, a);
        double row[] = {x_start[a] + dot(machine.x_port[a], state.q, machine.modes),
                        n,
                        M_a[a],
                        friction_torque(&machine.friction[a], n, state.z[a], state.c[a], NULL),
                        state.z[a],
                        state.c[a],
                        c->x_e,
                        c->n_s,
                        c->n_ref,
                        c->M_s,
                        c->i_sample[0],
                        c->i_sample[1]};
        fwrite(row, sizeof *row, sizeof row / sizeof *row, file);
    }
    for (int d = 0; d < DIRECTIONS; ++d) {
        double tool = dot(machine.tcp_port[d], state.q, machine.modes);
        fwrite(&tool, sizeof tool, 1, file);
    }
    double E = 0; /* beyond the springs that the modes hold */
    for (int m = 0; m < machine.mounts; ++m) {
        const Mount *p = &machine.mount[m];
        const double x = dot(p->port, state.q, machine.modes);
        E += state.E[m] - p->K_lin * x * x / 2;
    }
    fwrite(&E, sizeof E, 1, file);
}

int main(int argc, char **argv) {
    FILE *input = argc == 3 ? fopen(argv[1], "r") : NULL;
    FILE *output = input != NULL ? fopen(argv[2], "wb") : NULL;
    if (output == NULL) {
        fprintf(stderr, "usage: monolithic INPUT OUTPUT\n");
        return 1;
    }
    machine.axes = (int)number(input, "axes");
    int modes = (int)number(input, "modes"), setpoints = (int)number(input, "setpoints");
    int steps = (int)number(input, "steps per cycle");
    long cycles = (long)number(input, "cycles");
    double T_c = number(input, "T_c"), T_pos = number(input, "T_pos");
    if (machine.axes < 1 || machine.axes > MAX_AXES || modes < 1 || modes > MAX_MODES || setpoints < 1 || steps < 1) {
        fprintf(stderr, "monolithic: counts out of range\n");
        return 1;
    }
    read_modes(input, modes);
    machine.mounts = (int)number(input, "mounts");
    if (machine.mounts < 0 || machine.mounts > MAX_MOUNTS) {
        fprintf(stderr, "monolithic: counts out of range\n");
        return 1;
    }
    read_mounts(input, modes);
    int contacts = 0;
    double x_start[MAX_AXES], M_a[MAX_AXES] = {0}, M_next[MAX_AXES];
    for (int a = 0; a < machine.axes; ++a) {
        Drive *drive = &control[a].drive;
        drive->T_c = T_c;
        drive->T_pos = T_pos;
        x_start[a] = number(input, "start position");
        machine.M_0[a] = number(input, "M_0");
        Contact *contact = &machine.contact[a];
        double *const values[] = {&contact->J, &contact->c, &contact->d, &contact->half};
        for (size_t i = 0; i < sizeof values / sizeof *values; ++i) {
            *values[i] = number(input, "contact");
        }
        contacts += contact->J > 0;
        read_axis(input, &machine.friction[a], drive);
        double *series = malloc(2 * (size_t)setpoints * sizeof *series);
        for (int i = 0; i < 2 * setpoints; ++i) {
            series[i] = number(input, "setpoint");
        }
        drive->x_start = series[0];
        control[a].x_s = series;
        control[a].n_ffw = series + setpoints;
        control[a].setpoints = setpoints;
        control_start(&control[a]);
    }
    if (contacts > 1) {
        fprintf(stderr, "monolithic: more than one contact\n");
        return 1;
    }
    for (long k = 0; k <= cycles; ++k) {
        for (int a = 0; a < machine.axes; ++a) {
            double x_a = x_start[a] + dot(machine.x_port[a], state.q, machine.modes);
            M_next[a] = control_sample(&control[a], k, x_a, motor_speed(&machine, &state, a));
        }
        record(output, x_start, M_a);
        for (int a = 0; a < machine.axes; ++a) {
            if (control[a].drive.ideal_current_loop != 0) {
                M_a[a] = M_next[a]; /* acts at once and is held */
            }
        }
        advance(&machine, &state, T_c, steps, M_a, M_next);
        for (int a = 0; a < machine.axes; ++a) {
            M_a[a] = M_next[a];
        }
    }
    return fclose(output) == 0 ? 0 : 1;
}

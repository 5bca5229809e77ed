/* Levelling mounts that are not linear, in the plant: a table of them as a CSV file, mounts.csv,
 *
 *   mount,K_lin [N/m],K_e [N/m],F_max [N],x_2 [m],K_v [N/m],c [N.s/m],mode_0,mode_1,...
 *
 * a row per direction of each, with the mode shapes there [1/kg^0.5] for the modes of modes.csv in their order; and
 * their forces, F(x) - K_lin x, K_lin the spring that the modes hold.
 *
 * Rubber mounts of a machine swing at some ten Hz, steps of the drives are ten times as fast as they need. So the
 * mounts are looked at every fourth step where that is stable. Between two looks their forces are held, at
 *
 *   sum over the last four looks of w_j F_j = mean of the cubic p through them, over the time T to come, less T^2/12
 * p''
 *
 * the force that acts on a slow mode as p does to the fourth order: held instead of running, a force acts as if it had
 * T^2/12 p'' more. The work of a held force is exact: it is the force times the way. A kink of the law (a reversal,
 * whose slope jumps) leaves the second order. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "csv.h"
#include "numbers.h"
#include "plant.h"
#include "text.h"

enum { MOUNTS_EVERY = 4 };

/* w_j of looks that are T apart. */
static const double even_weights[MOUNT_LOOKS] = {25.0 / 12, -23.0 / 12, 13.0 / 12, -0.25};

/* --- the table */

static const char *const mount_columns[MOUNT_SHAPE] = {"K_lin [N/m]", "K_e [N/m]", "F_max [N]",
                                                       "x_2 [m]",     "K_v [N/m]", "c [N.s/m]"};

static bool mounts_header(CsvRow row, size_t modes) {
    CsvCell cell;
    char name[32];
    if (csv_cells(row) != 1 + MOUNT_SHAPE + modes || !csv_next_cell(&row, &cell) || !csv_equal(cell, "mount")) {
        return false;
    }
    for (size_t i = 0; csv_next_cell(&row, &cell); i++) {
        snprintf(name, sizeof name, "mode_%.0f", i < MOUNT_SHAPE ? 0 : (double)(i - MOUNT_SHAPE));
        if (!csv_equal(cell, i < MOUNT_SHAPE ? mount_columns[i] : name)) {
            return false;
        }
    }
    return true;
}

bool plant_read_mounts(Unit *unit, Plant *plant, const char *text, size_t size, const char *source) {
    Mounts *mounts = &plant->mounts;
    const size_t modes = plant->archive_modes, width = MOUNT_SHAPE + modes;
    Csv csv = csv_open(text, size);
    CsvRow row;
    CsvCell name, cell;
    if (!csv_next_row(&csv, &row) || !mounts_header(row, modes)) {
        return unit_fail(unit,
                         "%s: the table must begin with the header mount,K_lin [N/m],K_e [N/m],F_max [N],x_2 [m],K_v "
                         "[N/m],c [N.s/m],mode_0 ... mode_%.0f, for the modes of modes.csv",
                         source, (double)modes - 1);
    }
    mounts->rows = unit_alloc(unit, csv_lines(text, size) * width, sizeof *mounts->rows);
    if (mounts->rows == NULL) {
        return false;
    }
    for (; csv_next_row(&csv, &row); mounts->ports++) {
        double *values = mounts->rows + mounts->ports * width;
        if (csv_cells(row) != 1 + width) {
            return unit_fail(unit, "%s, line %u: the row has %.0f cells, the header has %.0f", source, csv.line,
                             (double)csv_cells(row), (double)(1 + width));
        }
        csv_next_cell(&row, &name);
        for (size_t i = 0; csv_next_cell(&row, &cell); i++) {
            const bool good = csv_number(cell, &values[i]) && (i >= MOUNT_SHAPE || values[i] >= 0);
            if (!good || (i == MOUNT_X_2 && !(values[i] > 0))) {
                return unit_fail(unit,
                                 "%s, line %u: cell %.0f is '%.*s'; finite numbers are allowed, of the element from 0 "
                                 "on, x_2 above 0",
                                 source, csv.line, (double)(i + 2), (int)text_whole(cell.text, cell.length, 40),
                                 cell.text);
            }
        }
    }
    if (mounts->ports == 0) {
        return unit_fail(unit, "%s: the table has a header but no mount; at least one row is needed", source);
    }
    return true;
}

void plant_free_mounts(Unit *unit, Plant *plant) {
    unit_free(unit, plant->mounts.rows);
    unit_free(unit, plant->mounts.own);
    unit_free(unit, plant->mounts.memory);
}

/* --- with the factors */

bool plant_derive_mounts(Unit *unit, Plant *plant) {
    Mounts *mounts = &plant->mounts;
    const Scalars *v = unit_scalars(unit);
    const size_t ports = mounts->ports, size = plant->size, width = MOUNT_SHAPE + plant->archive_modes;
    mounts->on = false;
    mounts->h = 0;
    if (ports == 0) {
        return true;
    }
    if (v->modes_file[0] != '\0') {
        return unit_fail(unit,
                         "parameter 'modes_file' is %s: the archive's mounts that are not linear belong to its "
                         "own modes; leave modes_file empty",
                         v->modes_file);
    }
    if (mounts->own == NULL) {
        mounts->own = unit_alloc(unit, ports, sizeof *mounts->own);
    }
    if (mounts->memory == NULL) {
        mounts->memory = unit_alloc(unit, ports * (size + 2), sizeof *mounts->memory);
    }
    if (mounts->own == NULL || mounts->memory == NULL) {
        return false;
    }
    mounts->at = (Modal){.size = size, .ports = ports, .shape = mounts->memory};
    mounts->x = mounts->memory + ports * size;
    mounts->held = mounts->x + ports;
    for (size_t i = 0; i < ports; i++) {
        const double *row = mounts->rows + i * width;
        Mount *p = &mounts->own[i];
        memcpy(mounts->at.shape + i * size, row + MOUNT_SHAPE, plant->archive_modes * sizeof *row);
        *p = (Mount){.K_e = v->mounts_K_e * row[MOUNT_K_E],
                     .F_max = v->mounts_F_max * row[MOUNT_F_MAX],
                     .x_2 = v->mounts_x_2 * row[MOUNT_X_2],
                     .K_v = v->mounts_K_v * row[MOUNT_K_V],
                     .c = v->mounts_c * row[MOUNT_C]};
        mounts->on = mounts->on || p->F_max > 0 || (p->K_v > 0 && p->c > 0) || fabs(p->K_e - row[MOUNT_K_LIN]) > 0;
    }
    return true;
}

/* --- the pace */

/* By how much holding changes the force on a mode that turns by `angle` from one look to the next, as a share of it. */
static double mounts_deviation(double angle) {
    const double spread = angle > 0 ? sin(angle / 2) / (angle / 2) : 1;
    double real = 0, imaginary = 0;
    for (int j = 0; j < MOUNT_LOOKS; j++) {
        real += even_weights[j] * cos((j + 0.5) * angle);
        imaginary -= even_weights[j] * sin((j + 0.5) * angle);
    }
    return hypot(spread * real - 1, spread * imaginary);
}

/* Whether no mode's damping changes by more than half of it, by forces that come late: the change of a mode's damping
 * ratio is at most half the share of its stiffness that they are, times the deviation. */
static bool mounts_stable(const Plant *plant, double T) {
    const Modal *modal = &plant->modal[0];
    const Mounts *mounts = &plant->mounts;
    for (size_t k = 0; k < modal->size; k++) {
        const double omega = modal->omega[k];
        double share = 0;
        for (size_t i = 0; omega > 0 && i < mounts->ports; i++) {
            const Mount *p = &mounts->own[i];
            const double root = mounts->at.shape[i * modal->size + k] / omega;
            const double soft = p->K_e - mounts->rows[i * (MOUNT_SHAPE + plant->archive_modes) + MOUNT_K_LIN];
            share += fmax(fabs(soft), fabs(soft + p->F_max / p->x_2 + (p->c > 0 ? p->K_v : 0))) * root * root;
        }
        if (share / 2 * mounts_deviation(omega * T) > fmax(modal->zeta[k] / 2, 1e-5)) {
            return false;
        }
    }
    return true;
}

bool plant_pace_mounts(Unit *unit, Plant *plant, double h) {
    Mounts *mounts = &plant->mounts;
    if (mounts->h != h) {
        mounts->every = MOUNTS_EVERY;
        while (mounts->every > 0 && !mounts_stable(plant, (double)mounts->every * h)) {
            mounts->every /= 2;
        }
        mounts->h = h;
    }
    if (mounts->every > 0) {
        return true;
    }
    char text[NUMBER_TEXT_SIZE];
    return unit_fail(unit,
                     "mounts that are not linear: steps of %s s are too long for them; their forces would change the "
                     "damping of a mode by more than half: take a shorter step, and see that K_e + F_max/x_2 is near "
                     "the stiffness that the modes were made with",
                     number_text(text, h));
}

/* --- a look */

/* Weights of the forces at the last looks for the force that is held over T; times: between the looks, latest first. */
static void mounts_foretell(const double *times, double T, double *w) {
    const double moments[MOUNT_LOOKS] = {1, T / 2, T * T / 6, 0}; /* what is asked of 1, t, t^2, t^3 */
    double at[MOUNT_LOOKS] = {0};
    bool even = true;
    for (int j = 1; j < MOUNT_LOOKS; j++) {
        at[j] = at[j - 1] - times[j - 1];
        even = even && fabs(times[j - 1] - T) <= 1e-9 * T;
    }
    for (int j = 0; j < MOUNT_LOOKS; j++) { /* Lagrange's polynomial of look j, by its coefficients */
        double basis[MOUNT_LOOKS] = {1}, scale = 1;
        int degree = 0;
        if (even) {
            w[j] = even_weights[j];
            continue;
        }
        for (int i = 0; i < MOUNT_LOOKS; i++) {
            if (i == j) {
                continue;
            }
            for (int n = ++degree; n >= 0; n--) {
                basis[n] = (n > 0 ? basis[n - 1] : 0) - at[i] * (n < degree ? basis[n] : 0);
            }
            scale *= at[j] - at[i];
        }
        w[j] = 0;
        for (int n = 0; n < MOUNT_LOOKS; n++) {
            w[j] += basis[n] * moments[n] / scale;
        }
    }
}

/* All ports at the places x, from one block into the other. False where a force is no finite number. */
static bool mounts_look(Plant *plant, MountsHead *head, const MountPort *was, MountPort *now, double next) {
    Mounts *mounts = &plant->mounts;
    const double T = head->time[0], before = head->time[1];
    const double per_T = 1 / T, per_before = 1 / before, per_both = T / (T + before);
    double w[MOUNT_LOOKS], probe = 0;
    mounts_foretell(head->time, next, w);
    for (size_t i = 0; i < mounts->ports; i++) {
        if (mounts->own[i].h != T) {
            mount_prepare(&mounts->own[i], T);
        }
        const double x = mounts->x[i], x_0 = was[i].mount.x, *force = was[i].force;
        const double K_lin = mounts->rows[i * (MOUNT_SHAPE + plant->archive_modes) + MOUNT_K_LIN];
        /* Speeds at both ends, of the parabola through the last three places. */
        const double v = (x - x_0) * per_T, bend = (v - (x_0 - was[i].x_before) * per_before) * per_both;
        MountState state = was[i].mount;
        mount_advance(&mounts->own[i], &state, x, v - bend, v + bend, T);
        const double F = mount_force(&mounts->own[i], &state) - K_lin * x;
        const double held = w[0] * F + w[1] * force[0] + w[2] * force[1] + w[3] * force[2];
        head->E += was[i].held * (x - x_0);
        head->x_max = fmax(head->x_max, fabs(x));
        now[i] = (MountPort){.mount = state, .x_before = x_0, .force = {F, force[0], force[1]}, .held = held};
        mounts->held[i] = -held;
        probe += number_probe(held);
    }
    return !isnan(probe);
}

bool plant_follow_mounts(Unit *unit, Plant *plant, double *state, double *end, double h) {
    Mounts *mounts = &plant->mounts;
    MountsHead *head = plant_mounts_head(plant, end);
    const double next = (double)mounts->every * h;
    *head = *plant_mounts_head(plant, state);
    if (!(head->left > 0)) { /* the first step */
        head->left = (double)mounts->every;
        head->h = h;
        head->time[1] = head->time[2] = next; /* it has stood still that long */
    }
    head->time[0] += h;
    head->left = head->h == h ? head->left - 1 : 0;
    if (head->left > 0) {
        return true;
    }
    const int block = plant_mounts_block(plant, state);
    double *was = plant_mounts_held(unit, plant, block), *now = plant_mounts_held(unit, plant, !block);
    modal_sums(&mounts->at, 0, mounts->ports, end + plant_ports(plant), mounts->x);
    if (!mounts_look(plant, head, (MountPort *)(void *)(was + plant->size), (MountPort *)(void *)(now + plant->size),
                     next)) {
        return false;
    }
    modal_force(&mounts->at, mounts->held, now);
    *head = (MountsHead){.time = {0, head->time[0], head->time[1]},
                         .left = (double)mounts->every,
                         .h = h,
                         .block = !block,
                         .E = head->E,
                         .x_max = head->x_max};
    return true;
}

void plant_show_mounts(Unit *unit, const Plant *plant, double *state) {
    const MountsHead *head = plant_mounts_head(plant, state);
    unit_scalars(unit)->mounts_E = head->E;
    unit_scalars(unit)->mounts_x_max = head->x_max;
}

#include "cells.h"

#include <math.h>
#include <string.h>

/* A scale counts as moved by elastic modes where they hold more than this part of its motion (squares of shapes), and
 * as independent of other scales where more than this part of its compliance remains when those are held. Machines have
 * parts of 0.1 and more; below, a jump of nanometres could be taken back by large deflections elsewhere only. */
static const double independent = 1e-6;

size_t cells_find(const Poses *poses, const double *x) {
    size_t cell = 0;
    for (size_t g = 0; g < poses->grid_axes; g++) {
        const GridAxis *grid = &poses->grid[g];
        size_t i = 0;
        while (i + 1 < grid->cells && x[grid->axis] > grid->boundaries[i]) {
            i++;
        }
        cell += i * grid->stride;
    }
    return cell;
}

bool cells_cross(const Poses *poses, size_t cell, const double *x, Crossing *crossing) {
    for (size_t g = 0; g < poses->grid_axes; g++) {
        const GridAxis *grid = &poses->grid[g];
        const size_t i = cell / grid->stride % grid->cells;
        const double position = x[grid->axis];
        const bool up = i + 1 < grid->cells && position > grid->boundaries[i] + grid->hysteresis;
        const bool down = i > 0 && position < grid->boundaries[i - 1] - grid->hysteresis;
        if (up || down) {
            const size_t lower = up ? cell : cell - grid->stride, upper = lower + grid->stride;
            *crossing = (Crossing){.cell = up ? upper : lower,
                                   .transfer = poses->transfer[g * poses->cells + lower],
                                   .rows = poses->cell[upper].modes,
                                   .columns = poses->cell[lower].modes,
                                   .upwards = up};
            return true;
        }
    }
    return false;
}

/* T from: four partial sums, so that an addition need not wait for the last; the order is the same everywhere. */
static void cells_carry_up(const Crossing *c, const double *from, double *to) {
    for (size_t i = 0; i < c->rows; i++) {
        const double *t = c->transfer + i * c->columns;
        double s0 = 0, s1 = 0, s2 = 0, s3 = 0;
        size_t j = 0;
        for (; j + 4 <= c->columns; j += 4) {
            s0 += t[j] * from[j];
            s1 += t[j + 1] * from[j + 1];
            s2 += t[j + 2] * from[j + 2];
            s3 += t[j + 3] * from[j + 3];
        }
        for (; j < c->columns; j++) {
            s0 += t[j] * from[j];
        }
        to[i] = (s0 + s1) + (s2 + s3);
    }
}

static void cells_carry_down(const Crossing *c, const double *from, double *to) {
    for (size_t i = 0; i < c->rows; i++) {
        const double *t = c->transfer + i * c->columns;
        for (size_t j = 0; j < c->columns; j++) {
            to[j] += t[j] * from[i];
        }
    }
}

void cells_carry(const Crossing *crossing, size_t size, const double *from, double *to) {
    for (size_t i = 0; i < size; i++) {
        to[i] = 0;
    }
    if (crossing->upwards) {
        cells_carry_up(crossing, from, to);
    } else {
        cells_carry_down(crossing, from, to);
    }
}

static void cells_replace(const Crossing *crossing, size_t size, double *values, double *scratch) {
    cells_carry(crossing, size, values, scratch);
    memcpy(values, scratch, size * sizeof *values);
}

/* --- what the scales read */

/* The sum over the elastic modes of x_kA x_kB / omega_k^2 [m/N]. */
static double cells_compliance(const Modal *modal, const double *x_A, const double *x_B) {
    double sum = 0;
    for (size_t k = 0; k < modal->size; k++) {
        const double omega = modal->omega[k];
        sum += omega > 0 ? x_A[k] * x_B[k] / (omega * omega) : 0;
    }
    return sum;
}

static bool cells_moves(const Modal *modal, const double *x) {
    double elastic = 0, all = 0;
    for (size_t k = 0; k < modal->size; k++) {
        const double square = x[k] * x[k];
        all += square;
        elastic += modal->omega[k] > 0 ? square : 0;
    }
    return elastic > independent * all;
}

/* In place, G[axes][axes] = L D L^T of the lower half, forward and backward substitution of f. Scales that do not move
 * by themselves get the force 0. */
static void cells_solve(size_t axes, double *G, double *f) {
    for (size_t i = 0; i < axes; i++) {
        const double whole = G[i * axes + i];
        for (size_t j = 0; j < i; j++) {
            double sum = G[i * axes + j];
            for (size_t m = 0; m < j; m++) {
                sum -= G[i * axes + m] * G[j * axes + m] * G[m * axes + m];
            }
            G[i * axes + j] = G[j * axes + j] > 0 ? sum / G[j * axes + j] : 0;
            G[i * axes + i] -= G[i * axes + j] * G[i * axes + j] * G[j * axes + j];
            f[i] -= G[i * axes + j] * f[j];
        }
        if (!(G[i * axes + i] > independent * whole)) {
            G[i * axes + i] = 0;
        }
    }
    for (size_t i = axes; i-- > 0;) {
        const double pivot = G[i * axes + i];
        f[i] = pivot > 0 ? f[i] / pivot : 0;
        for (size_t j = i + 1; pivot > 0 && j < axes; j++) {
            f[i] -= G[j * axes + i] * f[j];
        }
    }
}

void cells_hold(const Modal *modal, size_t axes, const double *by, double *q, double *work) {
    double *G = work, *force = work + axes * axes;
    const double *scales = modal->shape + (modal->ports - axes) * modal->size;
    for (size_t i = 0; i < axes; i++) {
        const double *x_i = scales + i * modal->size;
        const bool moves = cells_moves(modal, x_i);
        force[i] = by[i];
        for (size_t j = 0; j <= i; j++) {
            G[i * axes + j] = moves ? cells_compliance(modal, x_i, scales + j * modal->size) : 0;
        }
    }
    cells_solve(axes, G, force);
    for (size_t k = 0; k < modal->size; k++) {
        const double omega = modal->omega[k];
        double f = 0;
        for (size_t i = 0; i < axes; i++) {
            f += scales[i * modal->size + k] * force[i];
        }
        q[k] += omega > 0 ? f / (omega * omega) : 0;
    }
}

/* --- a step's end */

static double cells_scale(const Modal *modal, size_t axes, size_t axis, const double *q) {
    return modal_sum(modal, modal->ports - axes + axis, q);
}

size_t cells_scratch(size_t axes, size_t size) {
    return size + axes * (axes + 2);
}

Passage cells_follow(const Poses *poses, const Modal *modal, size_t cell, const double *x, double *q, double *v,
                     double *scratch) {
    const size_t axes = poses->axes;
    Passage passage = {.cell = cell};
    Crossing crossing;
    if (!cells_cross(poses, cell, x, &crossing)) {
        return passage;
    }
    double *reading = scratch + modal->size, *work = reading + axes;
    for (size_t i = 0; i < axes; i++) {
        reading[i] = cells_scale(&modal[cell], axes, i, q);
    }
    passage.kinetic_lost = modal_kinetic_energy(&modal[cell], v);
    passage.elastic_lost = modal_elastic_energy(&modal[cell], q);
    do {
        cells_replace(&crossing, modal->size, q, scratch);
        cells_replace(&crossing, modal->size, v, scratch);
        passage.cell = crossing.cell;
        passage.crossings++;
    } while (cells_cross(poses, passage.cell, x, &crossing));
    const Modal *now = &modal[passage.cell];
    for (size_t i = 0; i < axes; i++) {
        reading[i] -= cells_scale(now, axes, i, q);
        passage.held = fmax(passage.held, fabs(reading[i]));
    }
    cells_hold(now, axes, reading, q, work);
    passage.kinetic_lost -= modal_kinetic_energy(now, v);
    passage.elastic_lost -= modal_elastic_energy(now, q);
    return passage;
}

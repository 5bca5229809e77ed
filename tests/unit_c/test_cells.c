/* Cells of a grid of poses (src/plant_fmu/cells.c): where positions lie, hysteresis, states carried over. */
#include "cells.h"
#include "check.h"
#include "modes.h"

/* Axis 1 has cells about 0, 1, 2, 3; axis 0 about 0, 10, 20. All have SIZE modes or one less; bases are rotations of
 * one another. */
enum { AXES = 2, SIZE = 7, PADDED = 8, CELLS = 12, PORTS = 2 * AXES + 3 };

static const double CENTRES_1[] = {0, 1, 2, 3}, BOUNDARIES_1[] = {0.5, 1.5, 2.5};
static const double CENTRES_0[] = {0, 10, 20}, BOUNDARIES_0[] = {5, 15};
static GridAxis grid[] = {{1, 4, 3, 0.1, CENTRES_1, BOUNDARIES_1}, {0, 3, 1, 2, CENTRES_0, BOUNDARIES_0}};
static PoseCell cell[CELLS];
static double matrices[2][SIZE * SIZE]; /* along each grid axis */
static const double *transfer[2 * CELLS];
static const Poses poses = {
    .axes = AXES, .grid_axes = 2, .most_modes = SIZE, .cells = CELLS, .grid = grid, .cell = cell, .transfer = transfer};

/* Product of plane rotations: orthonormal to rounding. */
static void rotation(double *t, double angle) {
    for (int i = 0; i < SIZE * SIZE; i++) {
        t[i] = i % (SIZE + 1) == 0;
    }
    for (int i = 0; i + 1 < SIZE; i++) {
        const double c = cos(angle * (i + 1)), s = sin(angle * (i + 1));
        for (int j = 0; j < SIZE; j++) {
            const double a = t[i * SIZE + j], b = t[(i + 1) * SIZE + j];
            t[i * SIZE + j] = c * a - s * b;
            t[(i + 1) * SIZE + j] = s * a + c * b;
        }
    }
}

static void set_up(void) {
    rotation(matrices[0], 0.2);
    rotation(matrices[1], -0.3);
    for (size_t i = 0; i < CELLS; i++) {
        cell[i] = (PoseCell){SIZE, NULL};
        transfer[i] = i < 9 ? matrices[0] : NULL;
        transfer[CELLS + i] = i % 3 < 2 ? matrices[1] : NULL;
    }
}

static size_t found(double x_0, double x_1) {
    return cells_find(&poses, (const double[]){x_0, x_1});
}

static void finding(void) {
    CHECK(found(0, 0) == 0);
    CHECK(found(-1e9, -1e9) == 0);
    CHECK(found(1e9, 1e9) == 11);
    CHECK(found(10, 0) == 1);
    CHECK(found(0, 1) == 3);
    CHECK(found(16, 1.7) == 8);
    CHECK(found(5, 0.5) == 0); /* a boundary belongs to the cell below */
    CHECK(found(5.001, 0.501) == 4);
}

/* Cell that one step leads to, `from` itself where it leads nowhere. */
static size_t next(size_t from, double x_0, double x_1) {
    Crossing crossing = {.cell = from};
    const bool crossed = cells_cross(&poses, from, (const double[]){x_0, x_1}, &crossing);
    CHECK(crossed == (crossing.cell != from));
    return crossing.cell;
}

static void hysteresis(void) {
    CHECK(next(0, 0, 0.6) == 0); /* 0.5 + 0.1 rounds to 0.6 */
    CHECK(next(0, 0, 0.6001) == 3);
    CHECK(next(3, 0, 0.4) == 3);
    CHECK(next(3, 0, 0.3999) == 0);
    CHECK(next(0, 7, 0) == 0);
    CHECK(next(0, 7.001, 0) == 1);
    CHECK(next(1, 3, 0) == 1);
    CHECK(next(1, 2.999, 0) == 0);
    CHECK(next(0, -1e9, -1e9) == 0);
    CHECK(next(11, 1e9, 1e9) == 11);
    CHECK(next(0, 1e9, 1e9) == 3); /* neighbours alone, the first grid axis first */
    CHECK(next(9, 1e9, 1e9) == 10);
    CHECK(next(0, (double)NAN, (double)NAN) == 0);
}

static void one_by_one(void) {
    Crossing crossing;
    size_t at = 0, passed = 0;
    while (cells_cross(&poses, at, (const double[]){30, 2.7}, &crossing)) {
        at = crossing.cell;
        passed++;
        CHECK(crossing.upwards);
    }
    CHECK(at == 11 && passed == 5);
    while (cells_cross(&poses, at, (const double[]){12, 1.6}, &crossing)) {
        at = crossing.cell;
        CHECK(!crossing.upwards);
    }
    CHECK(at == 7); /* X back by two faces' worth with its hysteresis: 12 < 15 - 2; Z: 1.6 < 2.5 - 0.1 */
    for (int i = 0; i < 100; i++) { /* resting on a boundary */
        CHECK(!cells_cross(&poses, 7, (const double[]){15, i % 2 == 0 ? 2.45 : 2.55}, &crossing));
    }
}

static void carrying(void) {
    double from[PADDED] = {1, -2, 3, 0.5, -0.25, 4, 7}, up[PADDED], back[PADDED];
    Crossing crossing;
    CHECK(cells_cross(&poses, 0, (const double[]){0, 0.7}, &crossing) && crossing.upwards);
    up[PADDED - 1] = 99;
    cells_carry(&crossing, PADDED, from, up);
    double squares[2] = {0, 0};
    for (int i = 0; i < SIZE; i++) {
        double expected = 0;
        for (int j = 0; j < SIZE; j++) {
            expected += matrices[0][i * SIZE + j] * from[j];
        }
        CHECK_NEAR(up[i], expected, 2e-15); /* sums of seven terms of up to 7 in another order */
        squares[0] += from[i] * from[i];
        squares[1] += up[i] * up[i];
    }
    CHECK_EQUAL(up[PADDED - 1], 0);
    CHECK_NEAR(squares[1], squares[0], 1e-14 * squares[0]);
    CHECK(cells_cross(&poses, 3, (const double[]){0, 0.3}, &crossing) && !crossing.upwards);
    cells_carry(&crossing, PADDED, up, back);
    for (int i = 0; i < PADDED; i++) {
        CHECK_NEAR(back[i], from[i], 1e-14);
    }
}

/* A cell of fewer modes: what it cannot hold is gone, and its tail is 0. */
static void truncating(void) {
    cell[3].modes = 2;
    double from[PADDED] = {1, -2, 3, 0.5, -0.25, 4, 7}, up[PADDED], back[PADDED];
    Crossing crossing;
    CHECK(cells_cross(&poses, 0, (const double[]){0, 0.7}, &crossing));
    CHECK(crossing.rows == 2 && crossing.columns == SIZE);
    cells_carry(&crossing, PADDED, from, up);
    for (int i = 2; i < PADDED; i++) {
        CHECK_EQUAL(up[i], 0);
    }
    CHECK(cells_cross(&poses, 3, (const double[]){0, 0.3}, &crossing));
    CHECK(crossing.rows == 2 && crossing.columns == SIZE);
    cells_carry(&crossing, PADDED, up, back);
    double squares[2] = {0, 0};
    for (int i = 0; i < PADDED; i++) {
        squares[0] += up[i] * up[i];
        squares[1] += back[i] * back[i];
    }
    CHECK_NEAR(squares[1], squares[0], 1e-14 * squares[0]); /* going up to more modes loses nothing */
    cell[3].modes = SIZE;
}

static void following(void) {
    static double memory[CELLS][(10 + PORTS) * PADDED];
    Modal modal[CELLS];
    const double shape[PORTS] = {1};
    CHECK(modal_memory(SIZE, PORTS) == (10 + PORTS) * PADDED);
    for (size_t i = 0; i < CELLS; i++) {
        modal_place(&modal[i], memory[i], SIZE, PORTS);
        for (size_t k = 0; k < SIZE; k++) {
            modal_set_mode(&modal[i], k, (double)(k * (1 + i)), 0.01, shape);
        }
    }
    double q[PADDED] = {1e-3, 2e-3, -1e-3}, v[PADDED] = {1, -2, 3}, scratch[PADDED + AXES * (AXES + 2)];
    CHECK(cells_scratch(AXES, PADDED) == sizeof scratch / sizeof scratch[0]);
    const double q_0[PADDED] = {1e-3, 2e-3, -1e-3};
    Passage passage = cells_follow(&poses, modal, 4, (const double[]){10, 1}, q, v, scratch);
    CHECK(passage.cell == 4 && passage.crossings == 0);
    CHECK_EQUAL(passage.kinetic_lost, 0);
    CHECK_EQUAL(passage.elastic_lost, 0);
    CHECK(memcmp(q, q_0, sizeof q) == 0);

    passage = cells_follow(&poses, modal, 4, (const double[]){30, 3}, q, v, scratch);
    CHECK(passage.cell == 11 && passage.crossings == 3);
    CHECK_NEAR(passage.kinetic_lost, 0, 1e-14); /* of 7 J: rotations lose nothing */
    CHECK_NEAR(modal_kinetic_energy(&modal[11], v), 7, 1e-14);
    /* omega = 5 k before */
    CHECK_NEAR(passage.elastic_lost, (25 * 4e-6 + 100 * 1e-6) / 2 - modal_elastic_energy(&modal[11], q), 1e-18);
    CHECK(passage.elastic_lost < 0); /* the springs there are 12 instead of 5 */
    passage = cells_follow(&poses, modal, 11, (const double[]){10, 1}, q, v, scratch);
    CHECK(passage.cell == 4 && passage.crossings == 3);
}

/* A rigid mode, then elastic ones at omega = 2, 3, 4, ... that move the scales by x_0 and x_1. */
static void scales(Modal *modal, double *memory, const double *x_0, const double *x_1) {
    memset(memory, 0, (10 + PORTS) * PADDED * sizeof *memory);
    modal_place(modal, memory, SIZE, PORTS);
    for (size_t k = 0; k < SIZE; k++) {
        double shape[PORTS] = {1, 1, 1, 1, 1, x_0[k], x_1[k]};
        modal_set_mode(modal, k, k > 0 ? 1 + (double)k : 0, 0.01, shape);
    }
}

static void holding(void) {
    static double memory[(10 + PORTS) * PADDED];
    Modal modal;
    const double x_0[SIZE] = {1, 0.5, -0.3, 0.2, 0.7, 0, 0.1}, x_1[SIZE] = {-1, 0.1, 0.4, 0.2, 0, -0.6, 0.3};
    const double still[SIZE] = {1, 0, 1e-5, 0, 0, 0, 0}, zero[AXES] = {0, 0}, by[AXES] = {2e-9, -5e-9};
    double q[PADDED] = {1, 2e-6, 3e-6}, work[AXES * (AXES + 1)];
    const double q_0[PADDED] = {1, 2e-6, 3e-6};

    scales(&modal, memory, x_0, x_1);
    cells_hold(&modal, AXES, zero, q, work);
    CHECK(memcmp(q, q_0, sizeof q) == 0);
    cells_hold(&modal, AXES, by, q, work);
    double moved[AXES] = {0, 0}, normal[2] = {0, 0}, other[PADDED] = {0};
    for (size_t k = 0; k < SIZE; k++) {
        moved[0] += x_0[k] * (q[k] - q_0[k]);
        moved[1] += x_1[k] * (q[k] - q_0[k]);
    }
    CHECK_NEAR(moved[0], by[0], 1e-20); /* q of 1e-6 rounds at 1e-22 */
    CHECK_NEAR(moved[1], by[1], 1e-20);
    CHECK_EQUAL(q[0], 1); /* the rigid mode stays */
    /* Least energy: of no use to any displacement that leaves the scales alone, here one of modes 1, 2, 3. */
    other[1] = x_0[2] * x_1[3] - x_0[3] * x_1[2];
    other[2] = x_0[3] * x_1[1] - x_0[1] * x_1[3];
    other[3] = x_0[1] * x_1[2] - x_0[2] * x_1[1];
    for (size_t k = 1; k < SIZE; k++) {
        const double omega = modal.omega[k];
        normal[0] += omega * omega * (q[k] - q_0[k]) * other[k];
        normal[1] += fabs(omega * omega * (q[k] - q_0[k]) * other[k]);
    }
    CHECK(normal[1] > 1e-10);
    CHECK_NEAR(normal[0], 0, 1e-12 * normal[1]);

    /* A scale that elastic modes hardly move stays, the other one is held all the same; in either order. */
    for (int turned = 0; turned < 2; turned++) {
        scales(&modal, memory, turned ? still : x_0, turned ? x_0 : still);
        memcpy(q, q_0, sizeof q);
        cells_hold(&modal, AXES, (const double[]){3e-9, 3e-9}, q, work);
        CHECK_NEAR(modal_sum(&modal, turned ? 6 : 5, q) - modal_sum(&modal, turned ? 6 : 5, q_0), 3e-9, 1e-15);
        CHECK_NEAR(modal_sum(&modal, turned ? 5 : 6, q) - modal_sum(&modal, turned ? 5 : 6, q_0), 0, 1e-13);
    }
    /* So does one that moves with another: what that one needs is done. */
    scales(&modal, memory, x_0, x_0);
    memcpy(q, q_0, sizeof q);
    cells_hold(&modal, AXES, (const double[]){3e-9, 3e-9}, q, work);
    CHECK_NEAR(modal_sum(&modal, 5, q) - modal_sum(&modal, 5, q_0), 3e-9, 1e-15);
    for (size_t k = 0; k < PADDED; k++) {
        CHECK(isfinite(q[k]) && fabs(q[k] - q_0[k]) < 1e-7);
    }
}

/* Over a face whose ports read otherwise: the scales must not notice, and what that costs is in the energy. */
static void scales_over_a_face(void) {
    static double memory[CELLS][(10 + PORTS) * PADDED];
    Modal modal[CELLS];
    for (size_t i = 0; i < CELLS; i++) {
        double x_0[SIZE], x_1[SIZE];
        for (size_t k = 0; k < SIZE; k++) {
            x_0[k] = cos((double)(k * (i + 2)));
            x_1[k] = sin((double)(k + i + 1));
        }
        scales(&modal[i], memory[i], x_0, x_1);
    }
    double q[PADDED] = {1e-3, 2e-3, -1e-3}, v[PADDED] = {1, -2, 3}, scratch[PADDED + AXES * (AXES + 2)];
    const double x[AXES] = {modal_sum(&modal[4], 5, q), modal_sum(&modal[4], 6, q)};
    const double before = modal_elastic_energy(&modal[4], q);
    const Passage passage = cells_follow(&poses, modal, 4, (const double[]){30, 3}, q, v, scratch);
    CHECK(passage.cell == 11 && passage.crossings == 3);
    CHECK(passage.held > 1e-4);
    CHECK_NEAR(modal_sum(&modal[11], 5, q), x[0], 1e-17);
    CHECK_NEAR(modal_sum(&modal[11], 6, q), x[1], 1e-17);
    CHECK_NEAR(passage.elastic_lost, before - modal_elastic_energy(&modal[11], q), 1e-18);
    CHECK_NEAR(passage.kinetic_lost, 0, 1e-14);
}

int main(void) {
    set_up();
    finding();
    hysteresis();
    one_by_one();
    carrying();
    truncating();
    following();
    holding();
    scales_over_a_face();
    return CHECK_RESULT;
}

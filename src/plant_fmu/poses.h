/* Modes of a grid of poses, and how their bases change into each other, as the binary file poses.bin:
 *
 *   8 bytes "FSPOSES1", then 8-byte numbers alone (IEEE 754, little-endian, counts among them):
 *   number of axes; number of grid axes G; largest number of modes of a cell
 *   per grid axis: index of the axis; number of cells n; hysteresis [m]; n centres [m], ascending; n - 1 boundaries
 *     [m], each between its two centres
 *   per cell, row-major with the last grid axis fastest: number of modes N, then N rows as modes.h has them
 *   per grid axis, per cell that has an upper neighbour along it: matrix T, rows x columns = upper x lower modes
 *
 * A cell's modes are mass-normalised shapes of one and the same physical coordinates with one and the same mass matrix
 * M, so that T = Phi_upper^T M Phi_lower carries modal coordinates over: q_upper = T q_lower, q_lower = T^T q_upper.
 * Pure functions; the memory is the caller's. */
#ifndef FEEDSIM_POSES_H
#define FEEDSIM_POSES_H

#include <stdbool.h>
#include <stddef.h>

#include "prefix.h"

#define poses_capacity PREFIXED(poses_capacity)
#define poses_read_grid PREFIXED(poses_read_grid)
#define poses_read_cells PREFIXED(poses_read_cells)

typedef struct GridAxis {
    size_t axis;              /* of the machine */
    size_t cells;             /* along this grid axis */
    size_t stride;            /* from a cell's index to that of its upper neighbour */
    double hysteresis;        /* [m] */
    const double *centres;    /* [cells] m */
    const double *boundaries; /* [cells - 1] m */
} GridAxis;

typedef struct PoseCell {
    size_t modes;
    const double *values; /* [modes] rows of modes_width() */
} PoseCell;

typedef struct Poses {
    size_t axes; /* of the machine */
    size_t grid_axes;
    size_t most_modes; /* of a cell */
    size_t cells;      /* of the whole grid */
    const double *numbers, *end, *at;
    GridAxis *grid;          /* [grid_axes] */
    PoseCell *cell;          /* [cells] */
    const double **transfer; /* [grid_axes][cells]: T from the cell to its upper neighbour; NULL where there is none */
} Poses;

/* Upper bound for the numbers in a file of `size` bytes. */
size_t poses_capacity(size_t size);

/* The first part of a file, read and checked: what the grid is. `source` names the file in messages; numbers: room for
 * poses_capacity() of them, grid: room for `axes`; both go on being used by *poses. On a fault false, with a sentence
 * that names source and byte in message[message_size]. */
bool poses_read_grid(const char *bytes, size_t size, const char *source, size_t axes, double *numbers, GridAxis *grid,
                     Poses *poses, char *message, size_t message_size);

/* The rest of it: cell[poses->cells] and transfer[poses->grid_axes * poses->cells], zeroed. */
bool poses_read_cells(Poses *poses, const char *source, const char *const *axis_names, PoseCell *cell,
                      const double **transfer, char *message, size_t message_size);

#endif

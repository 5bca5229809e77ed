/* Which cell of a grid of poses the axes stand in, and the change into a neighbour. Pure functions. */
#ifndef FEEDSIM_CELLS_H
#define FEEDSIM_CELLS_H

#include <stdbool.h>
#include <stddef.h>

#include "modal.h"
#include "poses.h"
#include "prefix.h"

#define cells_find PREFIXED(cells_find)
#define cells_cross PREFIXED(cells_cross)
#define cells_carry PREFIXED(cells_carry)
#define cells_hold PREFIXED(cells_hold)
#define cells_scratch PREFIXED(cells_scratch)
#define cells_follow PREFIXED(cells_follow)

/* A change of cells through one face. */
typedef struct Crossing {
    size_t cell; /* where it leads */
    const double *transfer;
    size_t rows, columns; /* of the transfer */
    bool upwards;
} Crossing;

/* Cell that axis positions x[axes] [m] lie in; a boundary itself belongs to the cell below. */
size_t cells_find(const Poses *poses, const double *x);

/* Whether positions x[axes] [m] lie beyond a face of `cell` by more than the hysteresis, and the change through the
 * first such face. To be repeated with the cell that it leads to: one call never skips a cell. */
bool cells_cross(const Poses *poses, size_t cell, const double *x, Crossing *crossing);

/* Modal coordinates or speeds, from[size] to to[size] (no overlap); what the new cell has no mode for becomes 0. */
void cells_carry(const Crossing *crossing, size_t size, const double *from, double *to);

/* Add to q the elastic displacement of least elastic energy that moves the last `axes` ports, the scales, by
 * by[axes] [m]. A scale that elastic modes do not move, or only together with those before it, stays. work:
 * axes (axes + 1) numbers. */
void cells_hold(const Modal *modal, size_t axes, const double *by, double *q, double *work);

/* What a step's end led through. */
typedef struct Passage {
    size_t cell;                       /* that the axes stand in now */
    size_t crossings;                  /* faces passed, 0 mostly */
    double kinetic_lost, elastic_lost; /* energy before less energy after [J] */
    double held;                       /* largest jump of a scale that was taken back [m] */
} Passage;

/* Numbers of scratch that cells_follow() needs for modal systems of `size` modes. */
size_t cells_scratch(size_t axes, size_t size);

/* From `cell` through as many faces as positions x[axes] ask for, q and v [modal->size] with it; modal[poses->cells]:
 * modal systems of one size, whose last ports are the axes' scales; scratch [cells_scratch()]. Positions are not
 * measured anew on the way: a state that changes a little by being carried over must not turn back at once. In the cell
 * at the end the scales read what they did before. */
Passage cells_follow(const Poses *poses, const Modal *modal, size_t cell, const double *x, double *q, double *v,
                     double *scratch);

#endif

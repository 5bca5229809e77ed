/* Table of modes as a CSV file:
 *
 *   mode,frequency [Hz],damping ratio [1],n_<axis>...,x_<axis>...,tcp_X,tcp_Y,tcp_Z
 *
 * One row per mode, columns in any order; mode shapes are mass-normalised, SI units: n_<axis> rotor against stator
 * (torque in, speed out) [1/(kg^0.5 m)], x_<axis> linear scale, tcp_<direction> tool against workpiece (force in,
 * displacement out) [1/kg^0.5]. Rigid modes have frequency 0 and no damping. Pure functions; the memory is the
 * caller's. */
#ifndef FEEDSIM_MODES_H
#define FEEDSIM_MODES_H

#include <stdbool.h>
#include <stddef.h>

#include "prefix.h"

#define modes_capacity PREFIXED(modes_capacity)
#define modes_width PREFIXED(modes_width)
#define modes_read PREFIXED(modes_read)

#define TOOL_DIRECTIONS 3

/* Columns of a row of values: frequency [Hz], damping ratio, then the axes' n, tcp X Y Z, the axes' x. So the input
 * ports of the structure lie side by side, and so do the displacement outputs. */
enum { MODES_FREQUENCY, MODES_DAMPING, MODES_SHAPES };

/* Number of doubles in a row of values. */
size_t modes_width(size_t axes);

/* Upper bound for the number of modes in a text. */
size_t modes_capacity(const char *text, size_t size);

/* Read and check a table. text[size]: closed by a zero byte that is not counted; `source` names it in messages; axes:
 * names. values: room for modes_capacity() rows of modes_width(); *modes: rows read. On a fault false, with a sentence
 * that names source, line and column in message[message_size]. */
bool modes_read(const char *text, size_t size, const char *source, size_t axes, const char *const *axis_names,
                double *values, size_t *modes, char *message, size_t message_size);

#endif

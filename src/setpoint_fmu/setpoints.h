/* Table of setpoints as a CSV file: header `time [s],X.x_s [m],X.n_ffw [rad/s],Z.x_s [m],...`, a pair of columns per
 * axis in the order of the axis blocks, one row per position cycle. Pure functions; the memory is the caller's. */
#ifndef FEEDSIM_SETPOINTS_H
#define FEEDSIM_SETPOINTS_H

#include <stdbool.h>
#include <stddef.h>

#include "prefix.h"

#define setpoints_axes_capacity PREFIXED(setpoints_axes_capacity)
#define setpoints_read_axes PREFIXED(setpoints_read_axes)
#define setpoints_rows_capacity PREFIXED(setpoints_rows_capacity)
#define setpoints_read_rows PREFIXED(setpoints_read_rows)
#define setpoints_slack PREFIXED(setpoints_slack)
#define setpoints_row PREFIXED(setpoints_row)

#define SETPOINT_NAME_SIZE 32  /* bytes of an axis name, the closing zero included */
#define SETPOINT_AXES_MOST 256 /* in a table */

typedef char SetpointAxis[SETPOINT_NAME_SIZE];

/* A table that was read. Row r has its time at values[r * width], then x_s [m] and n_ffw [rad/s] of each axis. */
typedef struct Setpoints {
    size_t axes, width, rows;
    double first; /* time of the first row [s] */
    double cycle; /* from row to row [s] */
    double *values;
} Setpoints;

/* In what follows text[size] is closed by a zero byte that is not counted, and `source` names it in messages. On a
 * fault the answer is false, with a sentence that names source, line and column in message[message_size]. */

/* Upper bound for the number of axes in a text. */
size_t setpoints_axes_capacity(const char *text, size_t size);

/* Names of the axes, from the header. */
bool setpoints_read_axes(const char *text, size_t size, const char *source, SetpointAxis *names, size_t *axes,
                         char *message, size_t message_size);

/* Upper bound for the number of rows in a text. */
size_t setpoints_rows_capacity(const char *text, size_t size);

/* Rows of a text whose header was read: table->axes and table->values[capacity * (1 + 2 axes)] are given, the rest is
 * found. Rows must be two or more, of finite numbers, their times rising evenly: to a millionth of the cycle, so that
 * the row of a time is a matter of a division. */
bool setpoints_read_rows(const char *text, size_t size, const char *source, Setpoints *table, char *message,
                         size_t message_size);

/* How far the communication point at t [s] that ends a step of h [s] may lie ahead of a row and count as having reached
 * it: importers round time, and so does the table. A part in 10^9 of the time, 2 ns (clocks in whole nanoseconds) or
 * two millionths of the cycle, whichever is most, but never more than a hundredth of the step or the cycle (a clock
 * that adds up steps of 125 us is off by less after an hour), and never less than a few units in the last place. h may
 * be infinite. */
double setpoints_slack(const Setpoints *table, double t, double h);

/* Row that holds at `elapsed` [s] since the start: the last one whose time is not above elapsed + slack; the first
 * before it begins. */
size_t setpoints_row(const Setpoints *table, double elapsed, double slack);

#endif

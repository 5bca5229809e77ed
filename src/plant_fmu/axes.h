/* Table of axes as a CSV file: header `axis,x_0 [m]`, one row per axis in the order of the axis blocks. x_0 is the axis
 * position of the pose that the modes belong to. Pure functions; the memory is the caller's. */
#ifndef FEEDSIM_AXES_H
#define FEEDSIM_AXES_H

#include <stdbool.h>
#include <stddef.h>

#include "prefix.h"

#define axes_capacity PREFIXED(axes_capacity)
#define axes_read PREFIXED(axes_read)

#define AXIS_NAME_SIZE 32 /* bytes of an axis name, the closing zero included */
#define AXES_MOST 256     /* in a table */

typedef struct AxisRow {
    char name[AXIS_NAME_SIZE];
    double x_0; /* [m] */
} AxisRow;

/* Upper bound for the number of axes in a text. */
size_t axes_capacity(const char *text, size_t size);

/* Read and check a table; text[size] is closed by a zero byte that is not counted, `source` names it in messages. On a
 * fault false, with a sentence that names source, line and column in message[message_size]. */
bool axes_read(const char *text, size_t size, const char *source, AxisRow *rows, size_t *axes, char *message,
               size_t message_size);

#endif

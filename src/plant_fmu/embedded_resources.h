/* The archive's axes.csv and modes.csv as bytes, for importers without a file system. The packager writes
 * embedded_resources.c next to this file; the size is 0 where nothing was embedded. */
#ifndef FEEDSIM_EMBEDDED_RESOURCES_H
#define FEEDSIM_EMBEDDED_RESOURCES_H

#include <stddef.h>

#include "prefix.h"

#define embedded_axes PREFIXED(embedded_axes)
#define embedded_axes_size PREFIXED(embedded_axes_size)
#define embedded_modes PREFIXED(embedded_modes)
#define embedded_modes_size PREFIXED(embedded_modes_size)

extern const unsigned char embedded_axes[];
extern const size_t embedded_axes_size;
extern const unsigned char embedded_modes[];
extern const size_t embedded_modes_size;

#endif

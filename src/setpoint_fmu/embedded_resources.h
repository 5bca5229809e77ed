/* The archive's setpoints.csv as bytes, for importers without a file system. The packager writes embedded_resources.c
 * next to this file; the size is 0 where nothing was embedded. */
#ifndef FEEDSIM_EMBEDDED_RESOURCES_H
#define FEEDSIM_EMBEDDED_RESOURCES_H

#include <stddef.h>

#include "prefix.h"

#define embedded_setpoints PREFIXED(embedded_setpoints)
#define embedded_setpoints_size PREFIXED(embedded_setpoints_size)

extern const unsigned char embedded_setpoints[];
extern const size_t embedded_setpoints_size;

#endif

/* The archive's files as bytes, for importers without a file system, those of the parts under the names by which the
 * parts know them. The packager writes embedded_resources.c next to this file; the size is 0 where nothing was
 * embedded. */
#ifndef FEEDSIM_EMBEDDED_RESOURCES_H
#define FEEDSIM_EMBEDDED_RESOURCES_H

#include <stddef.h>

#include "prefix.h"

#define embedded_settings PREFIXED(embedded_settings)
#define embedded_settings_size PREFIXED(embedded_settings_size)

extern const unsigned char embedded_settings[];
extern const size_t embedded_settings_size;
extern const unsigned char machine_plant_embedded_axes[];
extern const size_t machine_plant_embedded_axes_size;
extern const unsigned char machine_plant_embedded_modes[];
extern const size_t machine_plant_embedded_modes_size;
extern const unsigned char machine_setpoint_embedded_setpoints[];
extern const size_t machine_setpoint_embedded_setpoints_size;

#endif

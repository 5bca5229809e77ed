/* Nothing is embedded: a page hands every machine over as files (files.c). */
#include "embedded_resources.h"

const unsigned char embedded_settings[] = {0};
const size_t embedded_settings_size = 0;
const unsigned char machine_plant_embedded_axes[] = {0};
const size_t machine_plant_embedded_axes_size = 0;
const unsigned char machine_plant_embedded_modes[] = {0};
const size_t machine_plant_embedded_modes_size = 0;
const unsigned char machine_setpoint_embedded_setpoints[] = {0};
const size_t machine_setpoint_embedded_setpoints_size = 0;

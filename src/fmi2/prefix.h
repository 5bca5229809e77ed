/* Names that cross files inside a unit carry the unit's own prefix, so that several units link into one program. Each
 * unit's identity.h defines UNIT_NAME, and UNIT_RESOURCES where it has resource files. */
#ifndef FEEDSIM_PREFIX_H
#define FEEDSIM_PREFIX_H

#include "identity.h"

#define PREFIX_JOIN(unit, name) unit##_##name
#define PREFIX_EXPAND(unit, name) PREFIX_JOIN(unit, name)
#define PREFIXED(name) PREFIX_EXPAND(UNIT_NAME, name)

#define MODEL PREFIXED(model)
#define unit_scalars PREFIXED(unit_scalars)
#define unit_axis PREFIXED(unit_axis)
#define unit_axes PREFIXED(unit_axes)
#define unit_axis_name PREFIXED(unit_axis_name)
#define unit_slope PREFIXED(unit_slope)
#define unit_sloped PREFIXED(unit_sloped)
#define unit_state PREFIXED(unit_state)
#define unit_start_time PREFIXED(unit_start_time)
#define unit_resources PREFIXED(unit_resources)
#define unit_location PREFIXED(unit_location)
#define unit_resource_hash PREFIXED(unit_resource_hash)
#define unit_set_axes PREFIXED(unit_set_axes)
#define unit_set_start PREFIXED(unit_set_start)
#define unit_axis_behind PREFIXED(unit_axis_behind)
#define unit_clock_behind PREFIXED(unit_clock_behind)
#define unit_derived_for PREFIXED(unit_derived_for)
#define unit_derived PREFIXED(unit_derived)
#define unit_set_derived PREFIXED(unit_set_derived)
#define unit_show PREFIXED(unit_show)
#define unit_leave_late PREFIXED(unit_leave_late)
#define unit_fail PREFIXED(unit_fail)
#define unit_warn PREFIXED(unit_warn)
#define unit_alloc PREFIXED(unit_alloc)
#define unit_free PREFIXED(unit_free)

#define unit_create PREFIXED(unit_create)
#define unit_destroy PREFIXED(unit_destroy)
#define unit_copy_text PREFIXED(unit_copy_text)
#define unit_keep_start PREFIXED(unit_keep_start)
#define unit_resize_state PREFIXED(unit_resize_state)

#define table_scalars PREFIXED(table_scalars)
#define table_axis PREFIXED(table_axis)
#define table_hash PREFIXED(table_hash)
#define table_causality PREFIXED(table_causality)
#define table_name PREFIXED(table_name)

#define call_begin PREFIXED(call_begin)
#define call_tell PREFIXED(call_tell)

#define log_write PREFIXED(log_write)
#define log_write_list PREFIXED(log_write_list)
#define log_select PREFIXED(log_select)

#define values_missing PREFIXED(values_missing)
#define values_no_arrays PREFIXED(values_no_arrays)
#define values_sound PREFIXED(values_sound)
#define values_get_real PREFIXED(values_get_real)
#define values_set_real PREFIXED(values_set_real)
#define values_get_whole PREFIXED(values_get_whole)
#define values_set_whole PREFIXED(values_set_whole)
#define values_get_string PREFIXED(values_get_string)
#define values_set_string PREFIXED(values_set_string)

#define derivatives_set_inputs PREFIXED(derivatives_set_inputs)
#define derivatives_inputs_finite_now PREFIXED(derivatives_inputs_finite_now)
#define derivatives_get_outputs PREFIXED(derivatives_get_outputs)
#define derivatives_get_directional PREFIXED(derivatives_get_directional)

#define run_derive PREFIXED(run_derive)
#define run_derived_for PREFIXED(run_derived_for)
#define run_refresh PREFIXED(run_refresh)
#define run_step PREFIXED(run_step)
#define run_show_late PREFIXED(run_show_late)
#define run_reset PREFIXED(run_reset)

#define state_save PREFIXED(state_save)
#define state_restore PREFIXED(state_restore)
#define state_known PREFIXED(state_known)
#define state_serialize PREFIXED(state_serialize)
#define state_deserialize PREFIXED(state_deserialize)

#define hash_bytes PREFIXED(hash_bytes)
#define hash_text PREFIXED(hash_text)

#define text_whole PREFIXED(text_whole)
#define text_mend PREFIXED(text_mend)

#define number_parse PREFIXED(number_parse)
#define number_text PREFIXED(number_text)

#define file_read PREFIXED(file_read)
#define file_of_archive PREFIXED(file_of_archive)
#define file_source PREFIXED(file_source)
#define file_hash_agrees PREFIXED(file_hash_agrees)

#define location_path PREFIXED(location_path)

#endif

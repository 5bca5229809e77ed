/* The FMI 2.0 functions that both kinds of FMU have. Each checks its call, hands over to the room that does the work,
 * and turns success into a status. */
#include "fmi2Functions.h"

#include <math.h>
#include <string.h>

#include "location.h"
#include "log.h"
#include "numbers.h"
#include "shell.h"
#include "state.h"
#include "values.h"

static bool given(Unit *unit, const void *pointer, const char *what) {
    return pointer != NULL || unit_fail(unit, "%s is NULL", what);
}

const char *fmi2GetTypesPlatform(void) {
    return fmi2TypesPlatform;
}

const char *fmi2GetVersion(void) {
    return fmi2Version;
}

fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean loggingOn, size_t nCategories,
                               const fmi2String categories[]) {
    BEGIN(SetDebugLogging, "loggingOn = %d, nCategories = %.0f", loggingOn, (double)nCategories);
    if (!values_arrays(unit, nCategories, categories, categories)) {
        return fmi2Error;
    }
    return log_select(unit, loggingOn != fmi2False, nCategories, categories) ? fmi2OK : fmi2Warning;
}

/* --- instances */

static bool hash_digits(const char *text) {
    return strspn(text, "0123456789abcdef") >= HASH_TEXT_SIZE - 1;
}

/* <hash of the table>-<hash of the resources>: the first half is this binary's, the second the model's to check where
 * it has resources. */
static bool accept_guid(Unit *unit, const char *guid) {
    char own[HASH_TEXT_SIZE];
    table_hash(own);
    if (guid == NULL || strlen(guid) != GUID_SIZE - 1 || !hash_digits(guid) || guid[HASH_TEXT_SIZE - 1] != '-' ||
        !hash_digits(guid + HASH_TEXT_SIZE)) {
        return unit_fail(unit,
                         "the GUID '%s' has not the form <16 hexadecimal digits>-<16 hexadecimal digits>; this binary "
                         "has '%s-...'",
                         guid != NULL ? guid : "(NULL)", own);
    }
    if (strncmp(guid, own, HASH_TEXT_SIZE - 1) != 0) {
        return unit_fail(unit,
                         "the GUID '%s' does not belong to this binary, whose table of variables is '%s-...': "
                         "modelDescription.xml and binary are of different builds",
                         guid, own);
    }
    char nothing[HASH_TEXT_SIZE];
    if (!MODEL.has_resources && strcmp(guid + HASH_TEXT_SIZE, hash_text(nothing, HASH_OF_NOTHING)) != 0) {
        return unit_fail(unit,
                         "the GUID '%s' speaks of resources, but the unit '%s' has none: its GUID is '%s-%s'; "
                         "modelDescription.xml and binary do not belong together",
                         guid, MODEL.identifier, own, nothing);
    }
    memcpy(unit->guid, guid, GUID_SIZE);
    return true;
}

static bool accept_location(Unit *unit, const char *location) {
    if (location == NULL || *location == '\0') {
        return true;
    }
#ifdef _WIN32
    const bool drive_letters = true;
#else
    const bool drive_letters = false;
#endif
    const size_t size = strlen(location) + 1;
    unit->location = unit_alloc(unit, size, 1);
    unit->resources = unit_alloc(unit, size, 1);
    if (unit->location == NULL || unit->resources == NULL) {
        return false;
    }
    memcpy(unit->location, location, size);
    if (!location_path(location, drive_letters, unit->resources)) {
        unit_free(unit, unit->resources);
        unit->resources = NULL;
        unit_warn(unit,
                  "the resource location '%s' names no file and is ignored; file: URIs and plain paths are understood",
                  location);
    }
    return true;
}

static bool prepare(Unit *unit, fmi2String instanceName, fmi2Type fmuType, fmi2String guid, fmi2String location) {
    if (instanceName == NULL || *instanceName == '\0') {
        return unit_fail(unit, "the instance name is %s", instanceName == NULL ? "NULL" : "empty");
    }
    if (fmuType != fmi2CoSimulation) {
        return unit_fail(unit, "the unit '%s' is for co-simulation only (type %d was asked for)", MODEL.identifier,
                         (int)fmuType);
    }
    if (!accept_guid(unit, guid) || !accept_location(unit, location)) {
        return false;
    }
    if (MODEL.load != NULL && !MODEL.load(unit)) {
        return false;
    }
    if (!unit_keep_start(unit)) {
        return false;
    }
    run_reset(unit);
    return true;
}

fmi2Component fmi2Instantiate(fmi2String instanceName, fmi2Type fmuType, fmi2String fmuGUID,
                              fmi2String fmuResourceLocation, const fmi2CallbackFunctions *functions,
                              fmi2Boolean visible, fmi2Boolean loggingOn) {
    (void)visible;
    Unit *unit = unit_create(functions, instanceName != NULL ? instanceName : "");
    if (unit == NULL) {
        return NULL;
    }
    log_select(unit, loggingOn != fmi2False, 0, NULL);
    if (!prepare(unit, instanceName, fmuType, fmuGUID, fmuResourceLocation)) {
        unit_destroy(unit);
        return NULL;
    }
    log_write(unit, LOG_EVENTS, "'%s' of GUID %s, resources in '%s'", MODEL.identifier, unit->guid,
              unit->resources != NULL ? unit->resources : "(none)");
    return unit;
}

void fmi2FreeInstance(fmi2Component c) {
    Unit *unit = c;
    if (unit == NULL) {
        return;
    }
    call_tell(unit, CALL_FreeInstance, "called");
    unit_destroy(unit);
}

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean toleranceDefined, fmi2Real tolerance, fmi2Real startTime,
                               fmi2Boolean stopTimeDefined, fmi2Real stopTime) {
    (void)toleranceDefined; /* the models' methods have no tolerance to choose */
    (void)tolerance;
    char text[2][NUMBER_TEXT_SIZE];
    BEGIN(SetupExperiment, "startTime = %s, stopTimeDefined = %d, stopTime = %s", number_text(text[0], startTime),
          stopTimeDefined, number_text(text[1], stopTime));
    if (!isfinite(startTime)) {
        return STATUS(unit_fail(unit, "the start time is not finite: %s", number_text(text[0], startTime)));
    }
    if (stopTimeDefined && !(stopTime >= startTime)) {
        return STATUS(unit_fail(unit, "the stop time of %s s is not after the start time of %s s",
                                number_text(text[0], stopTime), number_text(text[1], startTime)));
    }
    Header *header = unit_header(unit);
    header->start_time = header->time = startTime;
    header->stop_time = stopTimeDefined ? stopTime : INFINITY;
    return fmi2OK;
}

fmi2Status fmi2EnterInitializationMode(fmi2Component c) {
    BEGIN(EnterInitializationMode, "called");
    unit_header(unit)->phase = PHASE_INITIALIZATION;
    return fmi2OK;
}

fmi2Status fmi2ExitInitializationMode(fmi2Component c) {
    BEGIN(ExitInitializationMode, "called");
    if (!run_refresh(unit)) {
        return fmi2Error;
    }
    unit_header(unit)->phase = PHASE_STEPPING;
    char text[NUMBER_TEXT_SIZE];
    log_write(unit, LOG_EVENTS, "initialised, start time %s s", number_text(text, unit_header(unit)->start_time));
    return fmi2OK;
}

fmi2Status fmi2Terminate(fmi2Component c) {
    BEGIN(Terminate, "called");
    unit_header(unit)->phase = PHASE_TERMINATED;
    char text[NUMBER_TEXT_SIZE];
    log_write(unit, LOG_EVENTS, "terminated at %s s", number_text(text, unit_header(unit)->time));
    return fmi2OK;
}

fmi2Status fmi2Reset(fmi2Component c) {
    BEGIN(Reset, "called");
    run_reset(unit);
    log_write(unit, LOG_EVENTS, "start values restored");
    return fmi2OK;
}

/* --- values */

RARE static fmi2Status get_real(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, fmi2Real value[]) {
    BEGIN(GetReal, "nvr = %.0f, vr = %u, ...", (double)nvr, nvr > 0 && vr != NULL ? vr[0] : 0);
    return STATUS(values_get_real(unit, nvr, vr, value));
}

fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, fmi2Real value[]) {
    return values_get_usual(c, nvr, vr, value) ? fmi2OK : get_real(c, vr, nvr, value);
}

fmi2Status fmi2GetInteger(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, fmi2Integer value[]) {
    BEGIN(GetInteger, "nvr = %.0f, vr = %u, ...", (double)nvr, nvr > 0 && vr != NULL ? vr[0] : 0);
    return STATUS(values_get_whole(unit, KIND_INTEGER, nvr, vr, value));
}

fmi2Status fmi2GetBoolean(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, fmi2Boolean value[]) {
    BEGIN(GetBoolean, "nvr = %.0f, vr = %u, ...", (double)nvr, nvr > 0 && vr != NULL ? vr[0] : 0);
    return STATUS(values_get_whole(unit, KIND_BOOLEAN, nvr, vr, value));
}

fmi2Status fmi2GetString(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, fmi2String value[]) {
    BEGIN(GetString, "nvr = %.0f, vr = %u, ...", (double)nvr, nvr > 0 && vr != NULL ? vr[0] : 0);
    return STATUS(values_get_string(unit, nvr, vr, value));
}

RARE static fmi2Status set_real(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2Real value[]) {
    BEGIN(SetReal, "nvr = %.0f, vr = %u, ...", (double)nvr, nvr > 0 && vr != NULL ? vr[0] : 0);
    return STATUS(values_set_real(unit, nvr, vr, value));
}

fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2Real value[]) {
    return values_set_usual(c, nvr, vr, value) ? fmi2OK : set_real(c, vr, nvr, value);
}

fmi2Status fmi2SetInteger(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2Integer value[]) {
    BEGIN(SetInteger, "nvr = %.0f, vr = %u, ...", (double)nvr, nvr > 0 && vr != NULL ? vr[0] : 0);
    return STATUS(values_set_whole(unit, KIND_INTEGER, nvr, vr, value));
}

fmi2Status fmi2SetBoolean(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2Boolean value[]) {
    BEGIN(SetBoolean, "nvr = %.0f, vr = %u, ...", (double)nvr, nvr > 0 && vr != NULL ? vr[0] : 0);
    return STATUS(values_set_whole(unit, KIND_BOOLEAN, nvr, vr, value));
}

fmi2Status fmi2SetString(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2String value[]) {
    BEGIN(SetString, "nvr = %.0f, vr = %u, ...", (double)nvr, nvr > 0 && vr != NULL ? vr[0] : 0);
    return STATUS(values_set_string(unit, nvr, vr, value));
}

/* --- states */

fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *FMUstate) {
    BEGIN(GetFMUstate, "called");
    if (!given(unit, FMUstate, "the pointer to the state")) {
        return fmi2Error;
    }
    Snapshot *snapshot = *FMUstate;
    bool good = state_save(unit, &snapshot);
    *FMUstate = snapshot;
    return STATUS(good);
}

fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate FMUstate) {
    BEGIN(SetFMUstate, "called");
    return STATUS(given(unit, FMUstate, "the state") && state_restore(unit, FMUstate));
}

fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *FMUstate) {
    BEGIN(FreeFMUstate, "called");
    if (FMUstate == NULL || *FMUstate == NULL) {
        return fmi2OK;
    }
    if (!state_known(unit, *FMUstate)) {
        return fmi2Error;
    }
    unit_free(unit, *FMUstate);
    *FMUstate = NULL;
    return fmi2OK;
}

fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate FMUstate, size_t *size) {
    BEGIN(SerializedFMUstateSize, "called");
    if (!given(unit, FMUstate, "the state") || !given(unit, size, "the pointer to the size") ||
        !state_known(unit, FMUstate)) {
        return fmi2Error;
    }
    *size = (size_t)((const Snapshot *)FMUstate)->size;
    return fmi2OK;
}

fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate FMUstate, fmi2Byte serializedState[], size_t size) {
    BEGIN(SerializeFMUstate, "size = %.0f", (double)size);
    return STATUS(given(unit, FMUstate, "the state") && given(unit, serializedState, "the array of bytes") &&
                  state_serialize(unit, FMUstate, serializedState, size));
}

fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte serializedState[], size_t size,
                                   fmi2FMUstate *FMUstate) {
    BEGIN(DeSerializeFMUstate, "size = %.0f", (double)size);
    if (!given(unit, serializedState, "the array of bytes") || !given(unit, FMUstate, "the pointer to the state")) {
        return fmi2Error;
    }
    Snapshot *snapshot = *FMUstate;
    bool good = state_deserialize(unit, serializedState, size, &snapshot);
    *FMUstate = snapshot;
    return STATUS(good);
}

#include "toy.h"

#include <stdarg.h>
#include <stdlib.h>

void log_record(fmi2ComponentEnvironment environment, fmi2String instance, fmi2Status status, fmi2String category,
                fmi2String message, ...) {
    Log *log = environment;
    va_list arguments;
    va_start(arguments, message);
    vsnprintf(log->message, sizeof log->message, message, arguments);
    va_end(arguments);
    snprintf(log->category, sizeof log->category, "%s", category);
    snprintf(log->instance, sizeof log->instance, "%s", instance);
    log->status = status;
    log->count++;
}

Memory memory = {0, 0, -1};

void *memory_allocate(size_t count, size_t size) {
    if (memory.fail_at >= 0 && memory.allocations >= memory.fail_at) {
        return NULL;
    }
    memory.allocations++;
    memory.held++;
    void *bytes = malloc(count * size);
    if (bytes != NULL) {
        memset(bytes, 0xa5, count * size); /* an importer that does not zero it, as the standard says it must */
    }
    return bytes;
}

void memory_free(void *bytes) {
    memory.held -= bytes != NULL;
    free(bytes);
}

const char *toy_guid(void) {
    static char guid[GUID_SIZE];
    char hash[HASH_TEXT_SIZE];
    snprintf(guid, sizeof guid, "%s-" NO_RESOURCES, table_hash(hash));
    return guid;
}

fmi2Component toy_instantiate(Log *log, fmi2Boolean logging) {
    fmi2CallbackFunctions callbacks = {log != NULL ? log_record : NULL, memory_allocate, memory_free, NULL, log};
    return fmi2Instantiate("toy 1", fmi2CoSimulation, toy_guid(), NULL, &callbacks, fmi2False, logging);
}

void toy_enter(fmi2Component c, Phase phase) {
    if (phase == PHASE_INSTANTIATED) {
        return;
    }
    CHECK(fmi2SetupExperiment(c, fmi2False, 0, 0, fmi2False, 0) == fmi2OK);
    CHECK(fmi2EnterInitializationMode(c) == fmi2OK);
    if (phase == PHASE_INITIALIZATION) {
        return;
    }
    CHECK(fmi2ExitInitializationMode(c) == fmi2OK);
    if (phase == PHASE_TERMINATED) {
        CHECK(fmi2Terminate(c) == fmi2OK);
    }
    if (phase == PHASE_FAILED) {
        CHECK(set_real(c, VR_u, 2000) == fmi2OK); /* faster than limit.u */
        CHECK(fmi2DoStep(c, 0, 1, fmi2True) == fmi2Error);
    }
}

fmi2Component toy_in(Phase phase, Log *log) {
    fmi2Component c = toy_instantiate(log, fmi2False);
    CHECK(c != NULL);
    toy_enter(c, phase);
    return c;
}

double get_real(fmi2Component c, fmi2ValueReference vr) {
    double value = NAN;
    CHECK(fmi2GetReal(c, &vr, 1, &value) == fmi2OK);
    return value;
}

fmi2Status set_real(fmi2Component c, fmi2ValueReference vr, double value) {
    return fmi2SetReal(c, &vr, 1, &value);
}

int get_integer(fmi2Component c, fmi2ValueReference vr) {
    int value = -999;
    CHECK(fmi2GetInteger(c, &vr, 1, &value) == fmi2OK);
    return value;
}

fmi2Status set_integer(fmi2Component c, fmi2ValueReference vr, int value) {
    return fmi2SetInteger(c, &vr, 1, &value);
}

int get_boolean(fmi2Component c, fmi2ValueReference vr) {
    int value = -999;
    CHECK(fmi2GetBoolean(c, &vr, 1, &value) == fmi2OK);
    return value;
}

fmi2Status set_boolean(fmi2Component c, fmi2ValueReference vr, int value) {
    return fmi2SetBoolean(c, &vr, 1, &value);
}

const char *get_string(fmi2Component c, fmi2ValueReference vr) {
    fmi2String value = NULL;
    CHECK(fmi2GetString(c, &vr, 1, &value) == fmi2OK);
    return value != NULL ? value : "(NULL)";
}

fmi2Status set_string(fmi2Component c, fmi2ValueReference vr, const char *value) {
    return fmi2SetString(c, &vr, 1, &value);
}

fmi2Status set_slope(fmi2Component c, fmi2ValueReference vr, double value) {
    int order = 1;
    return fmi2SetRealInputDerivatives(c, &vr, 1, &order, &value);
}

void image_of(fmi2Component c, char *bytes, size_t *size) {
    fmi2FMUstate state = NULL;
    CHECK(fmi2GetFMUstate(c, &state) == fmi2OK);
    CHECK(fmi2SerializedFMUstateSize(c, state, size) == fmi2OK);
    CHECK(*size <= IMAGE_SIZE);
    CHECK(fmi2SerializeFMUstate(c, state, bytes, IMAGE_SIZE) == fmi2OK);
    CHECK(fmi2FreeFMUstate(c, &state) == fmi2OK);
    CHECK(state == NULL);
}

bool same_image(fmi2Component c, const char *bytes, size_t size) {
    static char now[IMAGE_SIZE];
    size_t size_now = 0;
    image_of(c, now, &size_now);
    return size_now == size && memcmp(now, bytes, size) == 0;
}

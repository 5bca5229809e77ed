/* Every function in every state: what the standard allows works, what it does not is refused with a message and changes
 * nothing. */
#include "toy.h"

static fmi2Status call_SetDebugLogging(fmi2Component c) {
    return fmi2SetDebugLogging(c, fmi2False, 0, NULL);
}
static fmi2Status call_SetupExperiment(fmi2Component c) {
    return fmi2SetupExperiment(c, fmi2False, 0, 0, fmi2False, 0);
}
static fmi2Status call_SetReal(fmi2Component c) {
    return set_real(c, VR_u, 1);
}
static fmi2Status call_SetInteger(fmi2Component c) {
    return set_integer(c, VR_i, 1);
}
static fmi2Status call_SetBoolean(fmi2Component c) {
    return set_boolean(c, VR_b, 1);
}
static fmi2Status call_SetString(fmi2Component c) {
    return fmi2SetString(c, NULL, 0, NULL); /* the toy has no text that may be set between steps */
}
static fmi2Status call_GetReal(fmi2Component c) {
    const fmi2ValueReference vr = VR_x;
    double value;
    return fmi2GetReal(c, &vr, 1, &value);
}
static fmi2Status call_GetInteger(fmi2Component c) {
    const fmi2ValueReference vr = VR_cells;
    int value;
    return fmi2GetInteger(c, &vr, 1, &value);
}
static fmi2Status call_GetBoolean(fmi2Component c) {
    const fmi2ValueReference vr = VR_positive;
    int value;
    return fmi2GetBoolean(c, &vr, 1, &value);
}
static fmi2Status call_GetString(fmi2Component c) {
    const fmi2ValueReference vr = VR_label;
    fmi2String value;
    return fmi2GetString(c, &vr, 1, &value);
}

/* A state of another instance of the same unit, so that the one under test need not be able to make one. */
static fmi2Component donor;
static fmi2FMUstate donated;
static char serialized[IMAGE_SIZE];
static size_t serialized_size;

static fmi2Status call_GetFMUstate(fmi2Component c) {
    fmi2FMUstate state = NULL;
    fmi2Status status = fmi2GetFMUstate(c, &state);
    fmi2FreeFMUstate(donor, &state);
    return status;
}
static fmi2Status call_SetFMUstate(fmi2Component c) {
    return fmi2SetFMUstate(c, donated);
}
static fmi2Status call_FreeFMUstate(fmi2Component c) {
    fmi2FMUstate state = NULL;
    CHECK(fmi2GetFMUstate(donor, &state) == fmi2OK);
    fmi2Status status = fmi2FreeFMUstate(c, &state);
    fmi2FreeFMUstate(donor, &state); /* where c could not */
    return status;
}
static fmi2Status call_SerializedFMUstateSize(fmi2Component c) {
    size_t size;
    return fmi2SerializedFMUstateSize(c, donated, &size);
}
static fmi2Status call_SerializeFMUstate(fmi2Component c) {
    static char bytes[IMAGE_SIZE];
    return fmi2SerializeFMUstate(c, donated, bytes, sizeof bytes);
}
static fmi2Status call_DeSerializeFMUstate(fmi2Component c) {
    fmi2FMUstate state = NULL;
    fmi2Status status = fmi2DeSerializeFMUstate(c, serialized, serialized_size, &state);
    fmi2FreeFMUstate(donor, &state);
    return status;
}
static fmi2Status call_GetDirectionalDerivative(fmi2Component c) {
    const fmi2ValueReference unknown = VR_y, known = VR_u;
    double seed = 1, value;
    return fmi2GetDirectionalDerivative(c, &unknown, 1, &known, 1, &seed, &value);
}
static fmi2Status call_SetRealInputDerivatives(fmi2Component c) {
    return set_slope(c, VR_u, 1);
}
static fmi2Status call_GetRealOutputDerivatives(fmi2Component c) {
    const fmi2ValueReference vr = VR_x;
    int order = 1;
    double value;
    return fmi2GetRealOutputDerivatives(c, &vr, 1, &order, &value);
}
static fmi2Status call_DoStep(fmi2Component c) {
    return fmi2DoStep(c, 0, 1e-3, fmi2True);
}
static fmi2Status call_GetStatus(fmi2Component c) {
    fmi2Status value;
    return fmi2GetStatus(c, fmi2DoStepStatus, &value);
}
static fmi2Status call_GetRealStatus(fmi2Component c) {
    double value;
    return fmi2GetRealStatus(c, fmi2LastSuccessfulTime, &value);
}
static fmi2Status call_GetIntegerStatus(fmi2Component c) {
    int value;
    return fmi2GetIntegerStatus(c, fmi2DoStepStatus, &value);
}
static fmi2Status call_GetBooleanStatus(fmi2Component c) {
    int value;
    return fmi2GetBooleanStatus(c, fmi2Terminated, &value);
}
static fmi2Status call_GetStringStatus(fmi2Component c) {
    fmi2String value;
    return fmi2GetStringStatus(c, fmi2PendingStatus, &value);
}

/* The table of FMI 2.0, section 4.2.4 (call sequence of co-simulation slaves), columns instantiated, initialization
 * mode, step complete, terminated, error. 'x' allowed, 'd' allowed and answered by fmi2Discard, '.' not allowed. Status
 * functions are also answered after an error, where an importer wants them most. */
static const struct {
    const char *name;
    fmi2Status (*call)(fmi2Component c);
    char allowed[PHASE_COUNT + 1];
} table[] = {
    {"fmi2SetDebugLogging", call_SetDebugLogging, "xxxxx"},
    {"fmi2SetupExperiment", call_SetupExperiment, "x...."},
    {"fmi2EnterInitializationMode", fmi2EnterInitializationMode, "x...."},
    {"fmi2ExitInitializationMode", fmi2ExitInitializationMode, ".x..."},
    {"fmi2Terminate", fmi2Terminate, "..x.."},
    {"fmi2Reset", fmi2Reset, "xxxxx"},
    {"fmi2GetReal", call_GetReal, ".xxxx"},
    {"fmi2GetInteger", call_GetInteger, ".xxxx"},
    {"fmi2GetBoolean", call_GetBoolean, ".xxxx"},
    {"fmi2GetString", call_GetString, ".xxxx"},
    {"fmi2SetReal", call_SetReal, "xxx.."},
    {"fmi2SetInteger", call_SetInteger, "xxx.."},
    {"fmi2SetBoolean", call_SetBoolean, "xxx.."},
    {"fmi2SetString", call_SetString, "xxx.."},
    {"fmi2GetFMUstate", call_GetFMUstate, "xxxxx"},
    {"fmi2SetFMUstate", call_SetFMUstate, "xxxxx"},
    {"fmi2FreeFMUstate", call_FreeFMUstate, "xxxxx"},
    {"fmi2SerializedFMUstateSize", call_SerializedFMUstateSize, "xxxxx"},
    {"fmi2SerializeFMUstate", call_SerializeFMUstate, "xxxxx"},
    {"fmi2DeSerializeFMUstate", call_DeSerializeFMUstate, "xxxxx"},
    {"fmi2GetDirectionalDerivative", call_GetDirectionalDerivative, ".xxxx"},
    {"fmi2SetRealInputDerivatives", call_SetRealInputDerivatives, "xxx.."},
    {"fmi2GetRealOutputDerivatives", call_GetRealOutputDerivatives, "..xxx"},
    {"fmi2DoStep", call_DoStep, "..x.."},
    {"fmi2CancelStep", fmi2CancelStep, "....."},
    {"fmi2GetStatus", call_GetStatus, "..xxx"},
    {"fmi2GetRealStatus", call_GetRealStatus, "..xxx"},
    {"fmi2GetIntegerStatus", call_GetIntegerStatus, "..ddd"},
    {"fmi2GetBooleanStatus", call_GetBooleanStatus, "..xxx"},
    {"fmi2GetStringStatus", call_GetStringStatus, "..xxx"},
};
enum { FUNCTIONS = sizeof table / sizeof *table };

static const char *const phases[PHASE_COUNT] = {"'instantiated'", "'initialization mode'", "'step complete'",
                                                "'terminated'", "'error'"};

static void refused(fmi2Component c, int function, int phase, Log *log) {
    static char before[IMAGE_SIZE];
    size_t size;
    image_of(c, before, &size);
    log->message[0] = '\0';
    if (table[function].call(c) != fmi2Error) {
        printf("%s in %s is not refused\n", table[function].name, phases[phase]);
    }
    CHECK(log->status == fmi2Error);
    CHECK_TEXT(log->category, "logStatusError");
    CHECK_CONTAINS(log->message, table[function].name);
    if (strchr(table[function].allowed, 'x') != NULL || strchr(table[function].allowed, 'd') != NULL) {
        char *allowed = strstr(log->message, "allowed in: ");
        CHECK(allowed != NULL);
        if (allowed == NULL) {
            return;
        }
        for (int other = 0; other < PHASE_COUNT; other++) {
            CHECK((strstr(allowed, phases[other]) != NULL) == (table[function].allowed[other] != '.'));
        }
        *allowed = '\0';
        CHECK_CONTAINS(log->message, phases[phase]);
    } else {
        CHECK_CONTAINS(log->message, "asynchronous");
    }
    CHECK(same_image(c, before, size));
}

static void every_function_in_every_state(void) {
    for (int phase = 0; phase < PHASE_COUNT; phase++) {
        for (int function = 0; function < FUNCTIONS; function++) {
            Log log = {.count = 0};
            fmi2Component c = toy_in((Phase)phase, &log);
            log.count = 0;
            char allowed = table[function].allowed[phase];
            if (allowed == '.') {
                refused(c, function, phase, &log);
                CHECK(log.count == 1);
            } else {
                fmi2Status status = table[function].call(c);
                CHECK(status == (allowed == 'd' ? fmi2Discard : fmi2OK));
                CHECK(log.count == 0);
                if (status != (allowed == 'd' ? fmi2Discard : fmi2OK)) {
                    printf("%s in %s: %s\n", table[function].name, phases[phase], log.message);
                }
            }
            fmi2FreeInstance(c);
        }
    }
}

static void without_an_instance(void) {
    for (int function = 0; function < FUNCTIONS; function++) {
        CHECK(table[function].call(NULL) == fmi2Error);
    }
    fmi2FreeInstance(NULL);
}

static void after_an_error_the_way_out_is_named(void) {
    Log log = {.count = 0};
    fmi2Component c = toy_in(PHASE_FAILED, &log);
    CHECK(call_DoStep(c) == fmi2Error);
    CHECK_CONTAINS(log.message, "fmi2Reset");
    CHECK(fmi2Reset(c) == fmi2OK);
    toy_enter(c, PHASE_STEPPING);
    CHECK(call_DoStep(c) == fmi2OK);
    fmi2FreeInstance(c);
}

static void arrays_that_are_missing(void) {
    Log log = {.count = 0};
    fmi2Component c = toy_in(PHASE_STEPPING, &log);
    fmi2ValueReference vr = VR_u;
    double value = 0;
    int order = 1;
    CHECK(fmi2GetReal(c, NULL, 1, &value) == fmi2Error);
    CHECK_CONTAINS(log.message, "NULL");
    CHECK(fmi2GetReal(c, &vr, 1, NULL) == fmi2Error);
    CHECK(fmi2SetReal(c, &vr, 1, NULL) == fmi2Error);
    CHECK(fmi2GetInteger(c, &vr, 1, NULL) == fmi2Error);
    CHECK(fmi2SetBoolean(c, &vr, 1, NULL) == fmi2Error);
    CHECK(fmi2GetString(c, &vr, 1, NULL) == fmi2Error);
    CHECK(fmi2SetString(c, &vr, 1, NULL) == fmi2Error);
    CHECK(fmi2SetRealInputDerivatives(c, &vr, 1, NULL, &value) == fmi2Error);
    CHECK(fmi2GetRealOutputDerivatives(c, &vr, 1, &order, NULL) == fmi2Error);
    CHECK(fmi2GetDirectionalDerivative(c, &vr, 1, &vr, 1, NULL, &value) == fmi2Error);
    CHECK(fmi2SetDebugLogging(c, fmi2True, 1, NULL) == fmi2Error);
    CHECK(fmi2GetFMUstate(c, NULL) == fmi2Error);
    CHECK(fmi2SetFMUstate(c, NULL) == fmi2Error);
    CHECK(fmi2FreeFMUstate(c, NULL) == fmi2OK);
    CHECK(fmi2SerializedFMUstateSize(c, NULL, NULL) == fmi2Error);
    CHECK(fmi2SerializeFMUstate(c, donated, NULL, 0) == fmi2Error);
    CHECK(fmi2DeSerializeFMUstate(c, NULL, 0, NULL) == fmi2Error);
    /* -1 for a size: nothing is read */
    CHECK(fmi2GetReal(c, &vr, (size_t)-1, &value) == fmi2Error);
    CHECK_CONTAINS(log.message, "fmi2GetReal: no array has 18446744073709551");
    CHECK(fmi2SetReal(c, &vr, (size_t)-1, &value) == fmi2Error);
    CHECK(fmi2SetDebugLogging(c, fmi2True, (size_t)-1, (const fmi2String[]){"logAll"}) == fmi2Error);
    CHECK_CONTAINS(log.message, "fmi2SetDebugLogging: no array has ");
    CHECK(fmi2GetReal(c, NULL, 0, NULL) == fmi2OK);
    CHECK(fmi2SetReal(c, NULL, 0, NULL) == fmi2OK);
    CHECK(fmi2GetRealStatus(c, fmi2LastSuccessfulTime, NULL) == fmi2Discard);
    fmi2FreeInstance(c);
}

int main(void) {
    donor = toy_in(PHASE_STEPPING, NULL);
    CHECK(fmi2GetFMUstate(donor, &donated) == fmi2OK);
    image_of(donor, serialized, &serialized_size);
    CHECK_TEXT(fmi2GetTypesPlatform(), "default");
    CHECK_TEXT(fmi2GetVersion(), "2.0");
    every_function_in_every_state();
    without_an_instance();
    after_an_error_the_way_out_is_named();
    arrays_that_are_missing();
    CHECK(fmi2FreeFMUstate(donor, &donated) == fmi2OK);
    fmi2FreeInstance(donor);
    CHECK(memory.held == 0);
    return CHECK_RESULT;
}

/* Instances: what is checked when one is made, callbacks that are missing or fail, several at once, reset, logging. */
#include <stdlib.h>

#include "toy.h"

static fmi2Component make(const char *name, fmi2Type type, const char *guid, const char *location, Log *log) {
    fmi2CallbackFunctions callbacks = {log_record, memory_allocate, memory_free, NULL, log};
    return fmi2Instantiate(name, type, guid, location, &callbacks, fmi2False, fmi2False);
}

static void what_does_not_belong_is_refused(void) {
    Log log = {.count = 0};
    char guid[GUID_SIZE], hash[HASH_TEXT_SIZE];
    table_hash(hash);
    CHECK(make("", fmi2CoSimulation, toy_guid(), NULL, &log) == NULL);
    CHECK_CONTAINS(log.message, "fmi2Instantiate: the instance name is empty");
    CHECK(log.status == fmi2Error);
    CHECK(make(NULL, fmi2CoSimulation, toy_guid(), NULL, &log) == NULL);
    CHECK_CONTAINS(log.message, "the instance name is NULL");
    CHECK(make("a", fmi2ModelExchange, toy_guid(), NULL, &log) == NULL);
    CHECK_CONTAINS(log.message, "'toy' is for co-simulation only");

    snprintf(guid, sizeof guid, "0123456789abcdef-" NO_RESOURCES);
    CHECK(make("a", fmi2CoSimulation, guid, NULL, &log) == NULL);
    CHECK_CONTAINS(log.message, guid);
    CHECK_CONTAINS(log.message, hash);
    const char *malformed[] = {"",
                               "{}",
                               "0123456789abcdef",
                               "0123456789abcdef0cbf29ce484222325",
                               "0123456789abcdef-cbf29ce48422232X",
                               "0123456789abcdef-cbf29ce4842223251",
                               "0123456789ABCDEF-cbf29ce484222325"};
    for (size_t k = 0; k < sizeof malformed / sizeof *malformed; k++) {
        CHECK(make("a", fmi2CoSimulation, malformed[k], NULL, &log) == NULL);
        CHECK_CONTAINS(log.message, malformed[k]);
        CHECK_CONTAINS(log.message, hash);
        CHECK_CONTAINS(log.message, "has not the form");
    }
    CHECK(make("a", fmi2CoSimulation, NULL, NULL, &log) == NULL);
    CHECK(log.count == 4 + 7 + 1);

    /* A unit without resources has a second half of its own. */
    snprintf(guid, sizeof guid, "%s-ffffffffffffffff", hash);
    CHECK(make("a", fmi2CoSimulation, guid, NULL, &log) == NULL);
    CHECK_CONTAINS(log.message, "speaks of resources, but the unit 'toy' has none");
    CHECK_CONTAINS(log.message, guid);
    CHECK_CONTAINS(log.message, toy_guid());

    /* A model's refusal is told as it said it: both signs of the logger's format are kept. */
    CHECK(make("a", fmi2CoSimulation, toy_guid(), "/refused", &log) == NULL);
    CHECK_TEXT(log.message, "fmi2Instantiate: resources in /refused are refused, 100 % sure, see ##1");
    CHECK(memory.held == 0);
}

static void resource_locations(void) {
    const char *const locations[][2] = {{"file:///a/b%20c/resources", "/a/b c/resources"},
                                        {"file:/a/b", "/a/b"},
                                        {"/a/b/", "/a/b"},
                                        {NULL, NULL},
                                        {"", NULL}};
    for (size_t k = 0; k < sizeof locations / sizeof *locations; k++) {
        Log log = {.count = 0};
        Unit *unit = make("a", fmi2CoSimulation, toy_guid(), locations[k][0], &log);
        CHECK(unit != NULL && log.count == 0);
        if (locations[k][1] == NULL) {
            CHECK(unit_resources(unit) == NULL);
        } else {
            CHECK_TEXT(unit_resources(unit), locations[k][1]);
        }
        fmi2FreeInstance(unit);
    }
    /* A place that cannot be read is the model's trouble only where the model needs it. */
    Log log = {.count = 0};
    fmi2CallbackFunctions callbacks = {log_record, memory_allocate, memory_free, NULL, &log};
    Unit *unit = fmi2Instantiate("a", fmi2CoSimulation, toy_guid(), "http://host/a", &callbacks, fmi2False, fmi2True);
    CHECK(unit != NULL && unit_resources(unit) == NULL);
    CHECK(log.count == 2); /* a warning, then the event of instantiation */
    fmi2FreeInstance(unit);
}

static void whole_run(fmi2Component c) {
    toy_enter(c, PHASE_STEPPING);
    CHECK(set_real(c, VR_u, 1) == fmi2OK);
    CHECK(set_real(c, VR_u, NAN) == fmi2Error);
    for (int k = 0; k < 10; k++) {
        CHECK(fmi2DoStep(c, k, 1, fmi2True) == fmi2OK);
    }
    CHECK_EQUAL(get_real(c, VR_x), 20);
    CHECK(fmi2Terminate(c) == fmi2OK);
}

static void callbacks_may_be_missing(void) {
    fmi2CallbackFunctions partial[] = {
        {NULL, NULL, NULL, NULL, NULL},
        {log_record, NULL, NULL, NULL, &(Log){.count = 0}},
        {NULL, memory_allocate, NULL, NULL, NULL},
        {NULL, NULL, memory_free, NULL, NULL},
        {NULL, memory_allocate, memory_free, NULL, NULL},
    };
    long before = memory.allocations;
    for (int k = -1; k < 5; k++) {
        if (k == 4) {
            CHECK(memory.allocations == before); /* half a pair is not used */
        }
        fmi2Component c =
            fmi2Instantiate("a", fmi2CoSimulation, toy_guid(), NULL, k < 0 ? NULL : &partial[k], fmi2False, fmi2True);
        CHECK(c != NULL);
        whole_run(c);
        fmi2FreeInstance(c);
        CHECK(fmi2Instantiate("", fmi2CoSimulation, toy_guid(), NULL, k < 0 ? NULL : &partial[k], fmi2False,
                              fmi2True) == NULL);
    }
    CHECK(memory.allocations > before);
    CHECK(memory.held == 0);
}

/* Callbacks need not outlive fmi2Instantiate. */
static void callbacks_are_copied(void) {
    Log log = {.count = 0};
    fmi2CallbackFunctions callbacks = {log_record, memory_allocate, memory_free, NULL, &log};
    fmi2Component c = fmi2Instantiate("a", fmi2CoSimulation, toy_guid(), NULL, &callbacks, fmi2False, fmi2False);
    memset(&callbacks, 0, sizeof callbacks);
    CHECK(set_real(c, 1000, 1) == fmi2Error);
    CHECK(log.count == 1);
    CHECK_TEXT(log.instance, "a");
    fmi2FreeInstance(c);
}

/* Whichever allocation fails: an error, no crash, no leak. */
static void memory_runs_out(void) {
    static char bytes[IMAGE_SIZE];
    size_t size;
    fmi2Component donor = toy_in(PHASE_INITIALIZATION, NULL);
    CHECK(set_integer(donor, VR_cells, 8) == fmi2OK);
    CHECK(fmi2ExitInitializationMode(donor) == fmi2OK);
    image_of(donor, bytes, &size);
    fmi2FreeInstance(donor);

    bool whole = false;
    int tries = 0;
    for (; !whole && tries < 1000; tries++) {
        Log log = {.count = 0};
        fmi2FMUstate saved = NULL, read = NULL;
        memory.allocations = 0;
        memory.fail_at = tries;
        fmi2Component c = make("a", fmi2CoSimulation, toy_guid(), "/a/b", &log);
        fmi2Component keeper = NULL;
        if (c != NULL) {
            whole = fmi2SetupExperiment(c, fmi2False, 0, 0, fmi2False, 0) == fmi2OK &&
                    fmi2EnterInitializationMode(c) == fmi2OK && fmi2ExitInitializationMode(c) == fmi2OK &&
                    fmi2GetFMUstate(c, &saved) == fmi2OK && fmi2DeSerializeFMUstate(c, bytes, size, &read) == fmi2OK &&
                    fmi2SetFMUstate(c, read) == fmi2OK && fmi2DoStep(c, 0, 1, fmi2True) == fmi2OK;
            if (!whole) {
                CHECK_CONTAINS(log.message, "out of memory: ");
            }
            keeper = c;
        } else if (tries > 0) { /* without memory for the instance there is nobody to tell */
            CHECK_CONTAINS(log.message, "fmi2Instantiate: out of memory: ");
        }
        memory.fail_at = -1;
        fmi2FreeFMUstate(keeper, &saved);
        fmi2FreeFMUstate(keeper, &read);
        fmi2FreeInstance(keeper);
        CHECK(memory.held == 0);
    }
    CHECK(whole && tries > 10);
}

static void instances_are_independent(void) {
    enum { COUNT = 5 };
    Log logs[COUNT] = {{.count = 0}};
    fmi2Component c[COUNT];
    for (int k = 0; k < COUNT; k++) {
        char name[24];
        snprintf(name, sizeof name, "toy %d", k);
        c[k] = make(name, fmi2CoSimulation, toy_guid(), NULL, &logs[k]);
        CHECK(set_integer(c[k], VR_cells, k + 1) == fmi2OK);
        CHECK(set_real(c[k], VR_gain, k) == fmi2OK);
        toy_enter(c[k], PHASE_STEPPING);
        CHECK(set_real(c[k], VR_u, 1) == fmi2OK);
    }
    for (int step = 0; step < 8; step++) {
        for (int k = 0; k < COUNT; k++) {
            CHECK(fmi2DoStep(c[k], step, 1, fmi2True) == fmi2OK);
        }
    }
    for (int k = 0; k < COUNT; k++) {
        CHECK_EQUAL(get_real(c[k], VR_x), 8 * k);
        CHECK_EQUAL(get_real(c[k], VR_late), (8 - (k + 1)) * k);
        CHECK(logs[k].count == 0);
    }
    CHECK(set_real(c[3], VR_x, 0) == fmi2Error);
    for (int k = 0; k < COUNT; k++) {
        CHECK(logs[k].count == (k == 3));
    }
    CHECK_TEXT(logs[3].instance, "toy 3");
    fmi2FreeInstance(c[2]);
    CHECK(fmi2DoStep(c[4], 8, 1, fmi2True) == fmi2OK);
    for (int k = 0; k < COUNT; k++) {
        if (k != 2) {
            fmi2FreeInstance(c[k]);
        }
    }
}

static void reset_brings_back_the_start(void) {
    static char fresh[IMAGE_SIZE];
    size_t size;
    for (int phase = 0; phase < PHASE_COUNT; phase++) {
        fmi2Component c = toy_in(PHASE_INSTANTIATED, NULL);
        image_of(c, fresh, &size);
        CHECK(set_integer(c, VR_cells, 8) == fmi2OK);
        CHECK(set_real(c, VR_gain, 7) == fmi2OK);
        CHECK(set_string(c, VR_label, "other") == fmi2OK);
        CHECK(set_real(c, AXIS(1, load), 0.75) == fmi2OK);
        CHECK(set_slope(c, VR_w, 0.75) == fmi2OK);
        CHECK(fmi2SetupExperiment(c, fmi2False, 0, 0, fmi2True, 5) == fmi2OK);
        toy_enter(c, (Phase)phase);
        CHECK(fmi2Reset(c) == fmi2OK);
        CHECK(same_image(c, fresh, size));
        whole_run(c);
        CHECK_EQUAL(get_real(c, AXIS(1, load)), -0.5); /* the model's start value, not the table's */
        CHECK_EQUAL(get_real(c, VR_late), 14);         /* three cells */
        fmi2FreeInstance(c);
    }
}

/* --- logging */

/* Categories that come through: e(rror), w(arning), E(vent), c(all). */
static void comes_through(fmi2Component c, Log *log, const char *expected) {
    char seen[8] = "";
    log->count = 0;
    CHECK(set_real(c, 1000, 1) == fmi2Error);
    if (log->count > 0 && strcmp(log->category, "logStatusError") == 0 && log->status == fmi2Error) {
        strcat(seen, "e");
    }
    log->category[0] = '\0';
    fmi2Integer integer;
    CHECK(fmi2GetIntegerStatus(c, fmi2DoStepStatus, &integer) == fmi2Discard);
    if (strcmp(log->category, "logStatusWarning") == 0 && log->status == fmi2Warning) {
        strcat(seen, "w");
    }
    log->category[0] = '\0';
    static double gain = 2;
    gain += 1;
    if (gain == 13) {
        gain += 1;
    }
    CHECK(set_real(c, VR_gain, gain) == fmi2OK); /* coefficients are derived anew in the next step: an event */
    if (strcmp(log->category, "logFmi2Call") == 0 && log->status == fmi2OK) {
        strcat(seen, "c");
    }
    log->category[0] = '\0';
    double time = 0;
    CHECK(fmi2GetRealStatus(c, fmi2LastSuccessfulTime, &time) == fmi2OK);
    CHECK(fmi2DoStep(c, time, 1, fmi2True) == fmi2OK);
    if (strcmp(log->category, "logEvents") == 0 && log->status == fmi2OK) {
        strcat(seen, "E");
    }
    CHECK_TEXT(seen, expected);
}

static void categories(void) {
    Log log = {.count = 0};
    fmi2Component c = toy_in(PHASE_STEPPING, &log);
    comes_through(c, &log, "e"); /* logging off: errors alone */
    CHECK(fmi2SetDebugLogging(c, fmi2True, 0, NULL) == fmi2OK);
    comes_through(c, &log, "ewcE");
    CHECK(fmi2SetDebugLogging(c, fmi2True, 2, (const fmi2String[]){"logEvents", "logStatusWarning"}) == fmi2OK);
    comes_through(c, &log, "wE");
    CHECK(fmi2SetDebugLogging(c, fmi2True, 1, (const fmi2String[]){"logFmi2Call"}) == fmi2OK);
    comes_through(c, &log, "c");
    CHECK(fmi2SetDebugLogging(c, fmi2True, 1, (const fmi2String[]){"logStatusError"}) == fmi2OK);
    comes_through(c, &log, "e");
    CHECK(fmi2SetDebugLogging(c, fmi2True, 1, (const fmi2String[]){"logAll"}) == fmi2OK);
    comes_through(c, &log, "ewcE");
    CHECK(fmi2SetDebugLogging(c, fmi2True, 3, (const fmi2String[]){"logEvents", "nonsense", NULL}) == fmi2Warning);
    CHECK_CONTAINS(log.message, "unknown log category");
    comes_through(c, &log, "E");
    CHECK(fmi2SetDebugLogging(c, fmi2False, 0, NULL) == fmi2OK);
    comes_through(c, &log, "e");
    fmi2FreeInstance(c);

    c = toy_instantiate(&log, fmi2True);
    toy_enter(c, PHASE_STEPPING);
    comes_through(c, &log, "ewcE");
    fmi2FreeInstance(c);
}

static void calls_are_told_with_their_arguments(void) {
    Log log = {.count = 0};
    fmi2Component c = toy_instantiate(&log, fmi2False);
    CHECK(fmi2SetDebugLogging(c, fmi2True, 1, (const fmi2String[]){"logFmi2Call"}) == fmi2OK);
    CHECK(fmi2SetupExperiment(c, fmi2False, 0, 2, fmi2True, 4.5) == fmi2OK);
    CHECK_TEXT(log.message, "fmi2SetupExperiment: startTime = 2, stopTimeDefined = 1, stopTime = 4.5");
    CHECK(set_real(c, VR_gain, 1) == fmi2OK);
    CHECK_TEXT(log.message, "fmi2SetReal: nvr = 1, vr = 12, ...");
    CHECK(fmi2DoStep(c, 2, 0.5, fmi2True) == fmi2Error); /* refused calls are told as well */
    CHECK_CONTAINS(log.message, "fmi2DoStep (t = 2 s, h = 0.5 s): called");
    fmi2FreeInstance(c);
    CHECK_CONTAINS(log.message, "fmi2FreeInstance: called");
}

static void long_messages_are_cut(void) {
    Log log = {.count = 0};
    char name[3000];
    memset(name, '%', sizeof name);
    name[sizeof name - 1] = '\0';
    CHECK(make("a", fmi2CoSimulation, name, NULL, &log) == NULL);
    CHECK_CONTAINS(log.message, "%%%%%");
    CHECK(strlen(log.message) < 2048);
}

/* Cut between two characters, wherever the end of the buffer lies among them. */
static void long_messages_end_with_a_whole_character(void) {
    for (int shift = 0; shift < 4; shift++) {
        Log log = {.count = 0};
        char guid[4000] = "";
        for (int k = 0; k < shift; k++) {
            strcat(guid, "a");
        }
        for (int k = 0; k < 1000; k++) {
            strcat(guid, "\xE2\x82\xAC");
        }
        CHECK(make("a", fmi2CoSimulation, guid, NULL, &log) == NULL);
        const size_t length = strlen(log.message);
        CHECK(length > 2040 && length < 2048);
        CHECK_TEXT(log.message + length - 3, "\xE2\x82\xAC");
    }
    Log log = {.count = 0};
    CHECK(make("a", fmi2CoSimulation, "M\xE4rz", NULL, &log) == NULL); /* Latin-1 */
    CHECK_CONTAINS(log.message, "'M?rz'");
}

int main(void) {
    what_does_not_belong_is_refused();
    resource_locations();
    callbacks_may_be_missing();
    callbacks_are_copied();
    memory_runs_out();
    instances_are_independent();
    reset_brings_back_the_start();
    categories();
    calls_are_told_with_their_arguments();
    long_messages_are_cut();
    long_messages_end_with_a_whole_character();
    CHECK(memory.held == 0);
    return CHECK_RESULT;
}

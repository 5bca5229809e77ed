/* Saved states: bit-identical replays, serialised forms, and what does not belong together. */
#include <stdint.h>
#include <stdlib.h>

#include "toy.h"

/* What a run of `count` steps gives out, from communication point t on: inputs and slopes vary with k. */
static void run(fmi2Component c, double t, int count, double results[]) {
    for (int k = 0; k < count; k++) {
        if (k % 3 > 0) {
            CHECK(set_real(c, VR_u, 0.1 * k + 1 / (k + 3.0)) == fmi2OK);
        }
        if (k % 2 > 0) {
            CHECK(set_slope(c, AXIS(1, F), 1.0 / k) == fmi2OK);
        }
        CHECK(fmi2DoStep(c, t + k * 0.1, 0.1, fmi2True) == fmi2OK);
        results[3 * k] = get_real(c, VR_y);
        results[3 * k + 1] = get_real(c, AXIS(1, s));
        results[3 * k + 2] = get_real(c, VR_late);
    }
}

enum { COUNT = 40 };

static void replays_are_identical(void) {
    double first[3 * COUNT], second[3 * COUNT];
    static char end[IMAGE_SIZE];
    size_t size;
    fmi2FMUstate state = NULL;
    fmi2Component c = toy_in(PHASE_STEPPING, NULL);
    run(c, 0, 10, first);
    CHECK(set_slope(c, VR_u, 3) == fmi2OK);           /* saved between the slope and its step */
    CHECK(set_real(c, AXIS(0, load), 0.5) == fmi2OK); /* and with a tunable parameter not yet in force */
    CHECK(fmi2GetFMUstate(c, &state) == fmi2OK);
    run(c, 1, COUNT, first);
    image_of(c, end, &size);
    for (int again = 0; again < 3; again++) {
        if (again == 1) {
            CHECK(fmi2Terminate(c) == fmi2OK);
        }
        if (again == 2) {
            CHECK(set_real(c, VR_u, 1e6) == fmi2OK);
            CHECK(fmi2DoStep(c, 5, 0.1, fmi2True) == fmi2Error);
        }
        CHECK(fmi2SetFMUstate(c, state) == fmi2OK);
        run(c, 1, COUNT, second);
        CHECK(memcmp(first, second, sizeof first) == 0);
    }
    CHECK(get_integer(c, VR_derivations) ==
          2); /* at the start, and for load: coefficients are the same ones all along */

    /* another instance, by way of bytes */
    static char bytes[IMAGE_SIZE];
    CHECK(fmi2SerializedFMUstateSize(c, state, &size) == fmi2OK);
    CHECK(fmi2SerializeFMUstate(c, state, bytes, size) == fmi2OK);
    fmi2Component other = toy_in(PHASE_INSTANTIATED, NULL);
    fmi2FMUstate read = NULL;
    CHECK(fmi2DeSerializeFMUstate(other, bytes, size, &read) == fmi2OK);
    CHECK(fmi2SetFMUstate(other, read) == fmi2OK);
    run(other, 1, COUNT, second);
    CHECK(memcmp(first, second, sizeof first) == 0);
    CHECK(fmi2FreeFMUstate(other, &read) == fmi2OK);
    CHECK(fmi2FreeFMUstate(c, &state) == fmi2OK);
    fmi2FreeInstance(other);
    fmi2FreeInstance(c);
}

static void a_state_brings_its_parameters(void) {
    Log log = {.count = 0};
    double first[3 * COUNT], second[3 * COUNT];
    fmi2FMUstate state = NULL;
    fmi2Component c = toy_in(PHASE_INITIALIZATION, &log);
    CHECK(set_integer(c, VR_cells, 7) == fmi2OK);
    CHECK(set_boolean(c, VR_inverted, 1) == fmi2OK);
    CHECK(set_string(c, VR_label, "seven") == fmi2OK);
    CHECK(fmi2ExitInitializationMode(c) == fmi2OK);
    run(c, 0, 10, first);
    CHECK(fmi2GetFMUstate(c, &state) == fmi2OK);
    run(c, 1, COUNT, first);

    CHECK(fmi2Reset(c) == fmi2OK);
    toy_enter(c, PHASE_STEPPING); /* three cells: another size of state */
    CHECK_TEXT(get_string(c, VR_label), "toy");
    run(c, 0, 5, second);
    CHECK(fmi2SetFMUstate(c, state) == fmi2OK);
    CHECK_TEXT(get_string(c, VR_label), "seven");
    CHECK(get_integer(c, VR_cells) == 7);
    run(c, 1, COUNT, second);
    CHECK(memcmp(first, second, sizeof first) == 0);
    CHECK(set_real(c, VR_gain, 3) == fmi2OK);
    CHECK(fmi2FreeFMUstate(c, &state) == fmi2OK);
    fmi2FreeInstance(c);
}

static void a_state_brings_its_phase(void) {
    fmi2FMUstate fresh = NULL, initial = NULL, refreshed = NULL, stepping = NULL;
    Log log = {.count = 0};
    fmi2Component c = toy_in(PHASE_INSTANTIATED, &log);
    CHECK(set_real(c, VR_u, 3) == fmi2OK);
    CHECK(fmi2GetFMUstate(c, &fresh) == fmi2OK);
    toy_enter(c, PHASE_INITIALIZATION);
    CHECK(set_real(c, VR_u, 4) == fmi2OK);
    CHECK(set_integer(c, VR_cells, 5) == fmi2OK);
    CHECK(fmi2GetFMUstate(c, &initial) == fmi2OK);
    CHECK_EQUAL(get_real(c, VR_y), 2);
    CHECK(fmi2GetFMUstate(c, &refreshed) == fmi2OK);
    CHECK(fmi2ExitInitializationMode(c) == fmi2OK);
    CHECK(fmi2DoStep(c, 0, 1, fmi2True) == fmi2OK);
    CHECK(fmi2GetFMUstate(c, &stepping) == fmi2OK);

    CHECK(fmi2SetFMUstate(c, initial) == fmi2OK);
    CHECK(set_integer(c, VR_cells, 8) == fmi2OK); /* allowed again */
    CHECK_EQUAL(get_real(c, VR_y), 2);
    CHECK(fmi2SetFMUstate(c, refreshed) == fmi2OK);
    CHECK_EQUAL(get_real(c, VR_y), 2);
    CHECK(get_integer(c, VR_cells) == 5);
    CHECK(fmi2SetFMUstate(c, fresh) == fmi2OK);
    CHECK(fmi2DoStep(c, 0, 1, fmi2True) == fmi2Error);
    CHECK_CONTAINS(log.message, "'instantiated'");
    toy_enter(c, PHASE_INITIALIZATION);
    CHECK_EQUAL(get_real(c, VR_y), 1.5);
    CHECK_EQUAL(get_real(c, VR_late), 100);
    CHECK(fmi2SetFMUstate(c, stepping) == fmi2OK);
    CHECK_EQUAL(get_real(c, VR_x), 8);
    CHECK(fmi2DoStep(c, 0, 1, fmi2True) == fmi2Error);
    CHECK_CONTAINS(log.message, "stands at 1 s");
    CHECK(fmi2DoStep(c, 1, 1, fmi2True) == fmi2OK);

    /* overwriting a state with one of another size */
    CHECK(fmi2GetFMUstate(c, &fresh) == fmi2OK);
    CHECK(fmi2DoStep(c, 2, 1, fmi2True) == fmi2OK);
    CHECK(fmi2SetFMUstate(c, fresh) == fmi2OK);
    CHECK_EQUAL(get_real(c, VR_x), 16);
    CHECK(fmi2FreeFMUstate(c, &fresh) == fmi2OK);
    CHECK(fmi2FreeFMUstate(c, &fresh) == fmi2OK); /* NULL: no effect */
    CHECK(fmi2FreeFMUstate(c, &initial) == fmi2OK);
    CHECK(fmi2FreeFMUstate(c, &refreshed) == fmi2OK);
    CHECK(fmi2FreeFMUstate(c, &stepping) == fmi2OK);
    fmi2FreeInstance(c);
}

/* A bad serialised form is refused, and says why. The heading: magic 8, format 4, byte order 4, GUID 40, whole size 8,
 * fixed size 8, state size 8, checksum 8 bytes. */
static void serialised_forms_that_do_not_fit(void) {
    static char bytes[IMAGE_SIZE], bad[IMAGE_SIZE];
    size_t size;
    Log log = {.count = 0};
    fmi2FMUstate state = NULL;
    fmi2Component c = toy_in(PHASE_STEPPING, &log);
    image_of(c, bytes, &size);

    const struct {
        size_t at;
        char to;
        const char *text[2];
    } changes[] = {
        {0, 'X', {"begins with 'XEEDSIM.'", "expected is 'FEEDSIM'"}},
        {8, 77, {"format version 77", "expected is 1"}},
        {12, 77, {"byte order", "01020304"}},
        {16, '!', {"belongs to GUID '!", toy_guid()}}, /* another table */
        {16 + 32, '!', {"48422232!'", toy_guid()}},    /* other resources */
        {16 + 34, 1, {"damaged", "byte 0 behind its GUID"}},
        {56, 1, {"its heading speaks of", "the serialized state has"}},
        {64, 1, {"bytes of variables", "this instance has"}},
        {72, 1, {"its heading speaks of", "the serialized state has"}},
        {80, 1, {"damaged", "checksum"}},
        {88 + 100, 1, {"damaged", "checksum"}},
    };
    for (size_t k = 0; k < sizeof changes / sizeof *changes; k++) {
        memcpy(bad, bytes, size);
        bad[changes[k].at] = (char)(bad[changes[k].at] == changes[k].to ? 2 : changes[k].to);
        CHECK(fmi2DeSerializeFMUstate(c, bad, size, &state) == fmi2Error);
        CHECK(state == NULL);
        CHECK_CONTAINS(log.message, "fmi2DeSerializeFMUstate: ");
        CHECK_CONTAINS(log.message, changes[k].text[0]);
        CHECK_CONTAINS(log.message, changes[k].text[1]);
    }
    CHECK(fmi2DeSerializeFMUstate(c, bytes, size - 1, &state) == fmi2Error);
    CHECK_CONTAINS(log.message, "its heading speaks of");
    for (size_t shorter = 0; shorter < size; shorter += 7) {
        CHECK(fmi2DeSerializeFMUstate(c, bytes, shorter, &state) == fmi2Error);
    }
    CHECK(state == NULL);

    /* Damage anywhere is found. */
    int missed = 0;
    for (size_t at = 0; at < size; at++) {
        memcpy(bad, bytes, size);
        bad[at] = (char)(bad[at] ^ 0x10);
        missed += fmi2DeSerializeFMUstate(c, bad, size, &state) != fmi2Error;
    }
    CHECK(missed == 0);
    CHECK(state == NULL);

    CHECK(fmi2GetFMUstate(c, &state) == fmi2OK);
    CHECK(fmi2SerializeFMUstate(c, state, bad, size - 1) == fmi2Error);
    CHECK_CONTAINS(log.message, "the array has ");
    CHECK(fmi2FreeFMUstate(c, &state) == fmi2OK);
    fmi2FreeInstance(c);
}

/* A state whose size does not go with its parameters (say, of other data behind the same name) is found when it is set.
 */
static void state_of_another_size(void) {
    static char bytes[IMAGE_SIZE];
    size_t size;
    static char own[IMAGE_SIZE];
    size_t own_size;
    Log log = {.count = 0};
    fmi2FMUstate state = NULL;
    fmi2Component c = toy_in(PHASE_STEPPING, &log);
    image_of(c, bytes, &size);
    uint64_t whole, state_size;
    memcpy(&whole, bytes + 56, 8);
    memcpy(&state_size, bytes + 72, 8);
    CHECK(whole == size);
    whole += 8;
    state_size += 8;
    memcpy(bytes + 56, &whole, 8);
    memcpy(bytes + 72, &state_size, 8);
    uint64_t checksum = hash_bytes(HASH_OF_NOTHING, bytes + 88, (size_t)whole - 88);
    memcpy(bytes + 80, &checksum, 8);
    CHECK(fmi2DeSerializeFMUstate(c, bytes, (size_t)whole, &state) == fmi2OK);
    /* into instances with the same parameters and with others, stepping and not yet */
    for (int k = 0; k < 4; k++) {
        CHECK(fmi2Reset(c) == fmi2OK);
        if (k % 2 > 0) {
            CHECK(set_integer(c, VR_cells, 7) == fmi2OK);
        }
        toy_enter(c, k < 2 ? PHASE_STEPPING : PHASE_INSTANTIATED);
        image_of(c, own, &own_size);
        CHECK(fmi2SetFMUstate(c, state) == fmi2Error);
        CHECK_CONTAINS(log.message, "bytes of model state, its parameters need");
        CHECK(same_image(c, own, own_size));
        if (k >= 2) {
            toy_enter(c, PHASE_STEPPING);
        }
        CHECK(fmi2DoStep(c, 0, 1, fmi2True) == fmi2OK);
        CHECK(get_integer(c, VR_cells) == (k % 2 > 0 ? 7 : 3));
    }
    CHECK(fmi2FreeFMUstate(c, &state) == fmi2OK);
    fmi2Component fresh = toy_in(PHASE_INSTANTIATED, &log); /* without coefficients of its own */
    CHECK(fmi2DeSerializeFMUstate(fresh, bytes, (size_t)whole, &state) == fmi2OK);
    CHECK(fmi2SetFMUstate(fresh, state) == fmi2Error);
    toy_enter(fresh, PHASE_STEPPING);
    CHECK(fmi2DoStep(fresh, 0, 1, fmi2True) == fmi2OK);
    CHECK(fmi2FreeFMUstate(fresh, &state) == fmi2OK);
    fmi2FreeInstance(fresh);
    fmi2FreeInstance(c);
}

/* What the model does not accept, or whose parameters it refuses, is refused at once and leaves the instance as it was:
 * it goes on with its own state and coefficients. */
static void refused_states_leave_the_instance(void) {
    static char own[IMAGE_SIZE];
    size_t size;
    Log log = {.count = 0};
    fmi2FMUstate refused = NULL, broken = NULL;
    fmi2Component other = toy_in(PHASE_STEPPING, &log);
    double results[3 * 13], expected[3 * COUNT], seen[3 * COUNT];
    run(other, 0, 13, results);
    CHECK(fmi2GetFMUstate(other, &refused) == fmi2OK);
    fmi2FreeInstance(other);
    other = toy_in(PHASE_INITIALIZATION, &log);
    CHECK(set_integer(other, VR_cells, 6) == fmi2OK);
    CHECK(fmi2ExitInitializationMode(other) == fmi2OK);
    CHECK(set_real(other, VR_gain, 13) == fmi2OK); /* the next step would refuse it */
    CHECK(fmi2GetFMUstate(other, &broken) == fmi2OK);
    fmi2FreeInstance(other);

    fmi2Component c = toy_in(PHASE_STEPPING, &log);
    run(c, 0, 10, results);
    image_of(c, own, &size);
    fmi2FMUstate saved = NULL;
    CHECK(fmi2GetFMUstate(c, &saved) == fmi2OK);
    run(c, 1, COUNT, expected);
    CHECK(fmi2SetFMUstate(c, saved) == fmi2OK);
    CHECK(fmi2SetFMUstate(c, refused) == fmi2Error);
    CHECK_CONTAINS(log.message, "state of label 'toy' after 13 steps is refused");
    CHECK(same_image(c, own, size));
    CHECK(fmi2SetFMUstate(c, broken) == fmi2Error);
    CHECK_CONTAINS(log.message, "gain 13");
    CHECK(same_image(c, own, size));
    memory.fail_at = memory.allocations; /* no memory to keep the own state in */
    CHECK(fmi2SetFMUstate(c, broken) == fmi2Error);
    memory.fail_at = -1;
    CHECK_CONTAINS(log.message, "out of memory");
    CHECK(same_image(c, own, size));
    run(c, 1, COUNT, seen);
    CHECK(memcmp(seen, expected, sizeof seen) == 0);
    CHECK(fmi2FreeFMUstate(c, &saved) == fmi2OK);
    CHECK(fmi2FreeFMUstate(c, &refused) == fmi2OK);
    CHECK(fmi2FreeFMUstate(c, &broken) == fmi2OK);
    fmi2FreeInstance(c);
}

static void states_of_other_resources_are_refused(void) {
    Log log = {.count = 0};
    fmi2Component c = toy_in(PHASE_INSTANTIATED, &log);
    Unit *unit = c; /* the toy has no resources: give it the identity of a unit that has */
    snprintf(unit->guid, sizeof unit->guid, "%.16s-0123456789abcdef", toy_guid());
    fmi2Component other = toy_in(PHASE_STEPPING, NULL);
    fmi2FMUstate state = NULL;
    CHECK(fmi2GetFMUstate(other, &state) == fmi2OK);
    CHECK(fmi2SetFMUstate(c, state) == fmi2Error);
    CHECK_CONTAINS(log.message, NO_RESOURCES "', this instance has '");
    CHECK_CONTAINS(log.message, "-0123456789abcdef'");
    CHECK(fmi2FreeFMUstate(other, &state) == fmi2OK);
    char garbage[256] = "no state";
    CHECK(fmi2SetFMUstate(c, garbage) == fmi2Error);
    CHECK_CONTAINS(log.message, "not a saved state: it begins with 'no state'");
    fmi2FreeInstance(other);
    fmi2FreeInstance(c);
}

/* Copies and nothing else: no pointer of the instance is in the bytes. */
static void states_hold_no_pointers(void) {
    static char one[IMAGE_SIZE], two[IMAGE_SIZE];
    size_t size_one, size_two;
    double results[30];
    void *shift = malloc(100000); /* the second instance lies elsewhere */
    fmi2Component c = toy_in(PHASE_STEPPING, NULL), d = toy_in(PHASE_STEPPING, NULL);
    run(c, 0, 10, results);
    run(d, 0, 10, results);
    image_of(c, one, &size_one);
    image_of(d, two, &size_two);
    CHECK(size_one == size_two && memcmp(one, two, size_one) == 0);
    free(shift);
    fmi2FreeInstance(c);
    fmi2FreeInstance(d);
}

int main(void) {
    replays_are_identical();
    a_state_brings_its_parameters();
    a_state_brings_its_phase();
    serialised_forms_that_do_not_fit();
    state_of_another_size();
    refused_states_leave_the_instance();
    states_of_other_resources_are_refused();
    states_hold_no_pointers();
    CHECK(memory.held == 0);
    return CHECK_RESULT;
}

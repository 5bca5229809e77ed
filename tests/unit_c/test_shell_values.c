/* Variables by value reference: what may be read and set when, ranges, and calculated values that follow what was set.
 */
#include <stdlib.h>

#include "toy.h"

static void references_run_as_declared(void) {
    /* Counted in variables.def by hand: 18 scalar rows, then three rows for each of the two axes. */
    CHECK(VR_u == 0 && VR_x == 4 && VR_limit_u == 14 && VR_label == 17);
    CHECK(SCALAR_ROWS == 18 && AXIS_ROWS == 3);
    fmi2Component c = toy_in(PHASE_INITIALIZATION, NULL);
    const fmi2ValueReference loads[] = {20, 23};
    double values[2];
    CHECK(fmi2GetReal(c, loads, 2, values) == fmi2OK);
    CHECK_EQUAL(values[0], 0.25); /* from the table */
    CHECK_EQUAL(values[1], -0.5); /* as load() left it */
    fmi2FreeInstance(c);
}

static void everything_can_be_read(void) {
    for (int phase = PHASE_INITIALIZATION; phase < PHASE_COUNT; phase++) {
        fmi2Component c = toy_in((Phase)phase, NULL);
        for (fmi2ValueReference vr = 0; vr < SCALAR_ROWS + 2 * AXIS_ROWS; vr++) {
            double real;
            int whole;
            fmi2String text;
            int kinds = (fmi2GetReal(c, &vr, 1, &real) == fmi2OK) + (fmi2GetInteger(c, &vr, 1, &whole) == fmi2OK) +
                        (fmi2GetBoolean(c, &vr, 1, &whole) == fmi2OK) + (fmi2GetString(c, &vr, 1, &text) == fmi2OK);
            CHECK(kinds == 1);
        }
        CHECK_EQUAL(get_real(c, VR_limit_u), 1000);
        CHECK(get_integer(c, VR_cells) == 3);
        CHECK(get_boolean(c, VR_inverted) == 0);
        CHECK_TEXT(get_string(c, VR_label), "toy");
        fmi2FreeInstance(c);
    }
}

static void what_is_set_is_read(void) {
    fmi2Component c = toy_in(PHASE_INITIALIZATION, NULL);
    const fmi2ValueReference vr[] = {VR_u, AXIS(1, F), VR_gain, AXIS(0, load)};
    const double values[] = {1.5, -7, 3, 0.125};
    double back[4];
    CHECK(fmi2SetReal(c, vr, 4, values) == fmi2OK);
    CHECK(fmi2GetReal(c, vr, 4, back) == fmi2OK);
    for (int k = 0; k < 4; k++) {
        CHECK_EQUAL(back[k], values[k]);
    }
    CHECK(set_integer(c, VR_cells, 8) == fmi2OK && get_integer(c, VR_cells) == 8);
    CHECK(set_boolean(c, VR_inverted, 5) == fmi2OK && get_boolean(c, VR_inverted) == fmi2True);
    CHECK(set_string(c, VR_label, "Achse \xc3\x84") == fmi2OK);
    CHECK_TEXT(get_string(c, VR_label), "Achse \xc3\x84");
    CHECK(set_string(c, VR_label, get_string(c, VR_label) + 6) == fmi2OK); /* out of the instance's own memory */
    CHECK_TEXT(get_string(c, VR_label), "\xc3\x84");

    /* A shorter text leaves nothing of the longer one behind. */
    static char image[IMAGE_SIZE];
    size_t size;
    image_of(c, image, &size);
    CHECK(set_string(c, VR_label, "a longer text") == fmi2OK);
    CHECK(set_string(c, VR_label, "\xc3\x84") == fmi2OK);
    CHECK(same_image(c, image, size));
    fmi2FreeInstance(c);
}

/* A call with one bad element changes nothing at all, and says what is wrong. */
static void refused(Phase phase, fmi2ValueReference vr, double value, const char *const parts[]) {
    static char before[IMAGE_SIZE];
    size_t size;
    Log log = {.count = 0};
    fmi2Component c = toy_in(phase, &log);
    image_of(c, before, &size);
    const fmi2ValueReference both[] = {AXIS(0, F), vr};
    const double values[] = {4, value};
    log.count = 0;
    CHECK(fmi2SetReal(c, both, 2, values) == fmi2Error);
    CHECK(log.count == 1);
    CHECK_CONTAINS(log.message, "fmi2SetReal: ");
    for (int k = 0; parts[k] != NULL; k++) {
        CHECK_CONTAINS(log.message, parts[k]);
    }
    CHECK(same_image(c, before, size));
    fmi2FreeInstance(c);
}
#define REFUSED(phase, vr, value, ...) refused(phase, vr, value, (const char *const[]){__VA_ARGS__, NULL})

static void bad_reals(void) {
    const Phase phases[] = {PHASE_INSTANTIATED, PHASE_INITIALIZATION, PHASE_STEPPING};
    for (int k = 0; k < 3; k++) {
        REFUSED(phases[k], VR_u, NAN, "input 'u'", "not finite", "nan");
        REFUSED(phases[k], VR_u, INFINITY, "input 'u'", "inf");
        REFUSED(phases[k], AXIS(1, F), -INFINITY, "input 'B.F'", "-inf");
        REFUSED(phases[k], VR_w, 10.000001, "input 'w'", "10.000001 1", "-10 to 10");
        REFUSED(phases[k], VR_w, -11, "input 'w'", "-11 1", "-10 to 10");
        REFUSED(phases[k], AXIS(1, load), 1.5, "parameter 'B.load'", "1.5 N", "-1 to 1");
        REFUSED(phases[k], VR_gain, NAN, "parameter 'gain'", "nan");
        REFUSED(phases[k], VR_x, 1, "output 'x'", "calculated");
        REFUSED(phases[k], VR_twice, 1, "local 'twice'", "calculated");
        REFUSED(phases[k], 24, 1, "reference 24", "0 to 23");
        REFUSED(phases[k], 4294967295u, 1, "reference 4294967295", "0 to 23");
        REFUSED(phases[k], VR_cells, 1, "reference 15", "Integer", "parameter", "'cells'", "Real");
        REFUSED(phases[k], VR_label, 1, "String", "'label'", "Real");
    }
    REFUSED(PHASE_INSTANTIATED, VR_feed, 1.25, "'feed'", "1.25 s", "0 to 1");
    REFUSED(PHASE_INITIALIZATION, VR_limit_u, 0, "'limit.u'", "0 m/s", "at least 0.001");
    REFUSED(PHASE_INITIALIZATION, VR_offset, 5.5, "'offset'", "5.5 m/s", "at most 5");
    REFUSED(PHASE_INITIALIZATION, VR_limit_u, INFINITY, "'limit.u'", "not finite");
    REFUSED(PHASE_STEPPING, VR_feed, 0.5, "fixed parameter 'feed'", "initialisation");
    REFUSED(PHASE_STEPPING, VR_limit_u, 0, "fixed parameter 'limit.u'");
}

static void bounds_themselves_are_allowed(void) {
    fmi2Component c = toy_in(PHASE_INITIALIZATION, NULL);
    CHECK(set_real(c, VR_feed, 0) == fmi2OK);
    CHECK(set_real(c, VR_feed, 1) == fmi2OK);
    CHECK(set_real(c, VR_limit_u, 1e-3) == fmi2OK);
    CHECK(set_real(c, VR_offset, 5) == fmi2OK);
    CHECK(set_integer(c, VR_cells, 1) == fmi2OK);
    CHECK(set_integer(c, VR_cells, 8) == fmi2OK);
    fmi2FreeInstance(c);
}

static void bad_others(void) {
    Log log = {.count = 0};
    fmi2Component c = toy_in(PHASE_INITIALIZATION, &log);
    CHECK(set_integer(c, VR_cells, 9) == fmi2Error);
    CHECK_CONTAINS(log.message, "fmi2SetInteger: the value of parameter 'cells' is out of range: 9, allowed is 1 to 8");
    CHECK(set_integer(c, VR_i, -4) == fmi2Error);
    CHECK_CONTAINS(log.message, "input 'i'");
    CHECK(set_integer(c, VR_steps, 1) == fmi2Error);
    CHECK(set_boolean(c, VR_positive, 1) == fmi2Error);
    CHECK(set_boolean(c, VR_i, 1) == fmi2Error);
    CHECK_CONTAINS(log.message, "expected here is type Boolean");
    const fmi2ValueReference both[] = {VR_i, VR_cells};
    CHECK(fmi2SetInteger(c, both, 2, (const int[]){2, 0}) == fmi2Error);
    CHECK(get_integer(c, VR_i) == 0);
    CHECK(set_string(c, VR_label, NULL) == fmi2Error);
    CHECK_CONTAINS(log.message, "'label'");

    char text[STRING_SIZE + 1];
    memset(text, 'a', sizeof text);
    text[STRING_SIZE] = '\0';
    CHECK(set_string(c, VR_label, text) == fmi2Error);
    CHECK_CONTAINS(log.message, "'label' is too long: 1024 bytes, allowed are at most 1023");
    CHECK_TEXT(get_string(c, VR_label), "toy");
    text[STRING_SIZE - 1] = '\0';
    CHECK(set_string(c, VR_label, text) == fmi2OK);
    CHECK_TEXT(get_string(c, VR_label), text);
    CHECK(fmi2ExitInitializationMode(c) == fmi2OK);
    CHECK(set_string(c, VR_label, "x") == fmi2Error);
    CHECK_CONTAINS(log.message, "fixed parameter 'label'");

    double real;
    fmi2ValueReference vr = VR_label;
    CHECK(fmi2GetReal(c, &vr, 1, &real) == fmi2Error);
    CHECK_CONTAINS(log.message,
                   "fmi2GetReal: value reference 17 is the String parameter 'label'; expected here is type Real");
    vr = 99;
    CHECK(fmi2GetReal(c, &vr, 1, &real) == fmi2Error);
    CHECK_CONTAINS(log.message, "fmi2GetReal: value reference 99 does not exist");
    fmi2FreeInstance(c);
}

static void initial_values_follow(void) {
    Log log = {.count = 0};
    fmi2Component c = toy_in(PHASE_INITIALIZATION, &log);
    CHECK_EQUAL(get_real(c, VR_y), 0);
    CHECK_EQUAL(get_real(c, VR_late), 100); /* the toy adds 100 to a state that must arrive zeroed */
    CHECK(set_real(c, VR_u, 8) == fmi2OK);
    CHECK_EQUAL(get_real(c, VR_y), 4);
    CHECK(set_real(c, VR_feed, 0.25) == fmi2OK);
    CHECK_EQUAL(get_real(c, VR_y), 2);
    CHECK_EQUAL(get_real(c, VR_late), 100);
    CHECK(set_integer(c, VR_cells, 8) == fmi2OK); /* another size of state */
    CHECK_EQUAL(get_real(c, VR_late), 100);
    CHECK(set_real(c, AXIS(0, F), 3) == fmi2OK);
    CHECK_EQUAL(get_real(c, AXIS(0, s)), 2.75);

    /* Coefficients are derived when parameters really changed, not with every input. */
    int derivations = get_integer(c, VR_derivations);
    CHECK(set_real(c, VR_u, 9) == fmi2OK);
    CHECK(set_real(c, VR_feed, 0.25) == fmi2OK);
    CHECK_EQUAL(get_real(c, VR_y), 2.25);
    CHECK(get_integer(c, VR_derivations) == derivations);
    CHECK(set_real(c, VR_feed, 0.5) == fmi2OK);
    CHECK(get_integer(c, VR_derivations) == derivations + 1);

    /* A combination that makes no sense is told where it matters, and can be put right. */
    CHECK(set_string(c, VR_label, "refused") == fmi2OK);
    CHECK_TEXT(get_string(c, VR_label), "refused");
    fmi2ValueReference vr = VR_y;
    double value;
    CHECK(fmi2GetReal(c, &vr, 1, &value) == fmi2Error);
    CHECK_CONTAINS(log.message, "fmi2GetReal: label 'refused' is refused");
    CHECK(fmi2ExitInitializationMode(c) == fmi2Error);
    CHECK_CONTAINS(log.message, "fmi2ExitInitializationMode: label");
    CHECK(set_string(c, VR_label, "good") == fmi2OK);
    CHECK_EQUAL(get_real(c, VR_y), 4.5);
    CHECK(fmi2ExitInitializationMode(c) == fmi2OK);
    CHECK_EQUAL(get_real(c, VR_y), 4.5);
    fmi2FreeInstance(c);
}

static void between_steps_outputs_stay(void) {
    fmi2Component c = toy_in(PHASE_STEPPING, NULL);
    CHECK(set_real(c, VR_u, 8) == fmi2OK);
    CHECK(set_real(c, AXIS(1, F), 8) == fmi2OK);
    CHECK_EQUAL(get_real(c, VR_y), 0);
    CHECK_EQUAL(get_real(c, AXIS(1, s)), 0.5);
    CHECK_EQUAL(get_real(c, VR_u), 8);
    CHECK(fmi2DoStep(c, 0, 0.5, fmi2True) == fmi2OK);
    CHECK_EQUAL(get_real(c, VR_y), 8 * 2 * 0.5 + 4);
    CHECK_EQUAL(get_real(c, AXIS(1, s)), 8.5);
    fmi2FreeInstance(c);
}

static void values_before_initialisation_count(void) {
    fmi2Component c = toy_in(PHASE_INSTANTIATED, NULL);
    CHECK(set_real(c, VR_u, 6) == fmi2OK);
    CHECK(set_real(c, VR_feed, 1) == fmi2OK);
    toy_enter(c, PHASE_STEPPING);
    CHECK_EQUAL(get_real(c, VR_y), 6);
    fmi2FreeInstance(c);
}

/* An initial value that is not finite is an error at once, not one step later. */
static void initial_values_are_finite(void) {
    Log log = {.count = 0};
    fmi2Component c = toy_in(PHASE_INITIALIZATION, &log);
    CHECK(set_real(c, VR_u, 1.7e308) == fmi2OK);
    CHECK(set_real(c, VR_feed, 1) == fmi2OK);
    fmi2ValueReference vr = VR_x;
    double value;
    CHECK(fmi2GetReal(c, &vr, 1, &value) == fmi2Error);
    CHECK_CONTAINS(log.message, "fmi2GetReal: local 'twice' is not finite: inf");
    CHECK(fmi2ExitInitializationMode(c) == fmi2Error);
    CHECK_CONTAINS(log.message, "'twice'");
    CHECK(set_real(c, VR_u, 1) == fmi2OK);
    CHECK(fmi2ExitInitializationMode(c) == fmi2OK);
    fmi2FreeInstance(c);
}

int main(void) {
    references_run_as_declared();
    everything_can_be_read();
    what_is_set_is_read();
    bad_reals();
    bounds_themselves_are_allowed();
    bad_others();
    initial_values_follow();
    between_steps_outputs_stay();
    values_before_initialisation_count();
    initial_values_are_finite();
    CHECK(memory.held == 0);
    return CHECK_RESULT;
}

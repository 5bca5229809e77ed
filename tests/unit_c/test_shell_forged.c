/* Serialised states that nobody saved, under a checksum that fits. */
#include <stdint.h>

#include "toy.h"

static void sign(char *bytes, size_t size) {
    const uint64_t checksum = hash_bytes(HASH_OF_NOTHING, bytes + 88, size - 88);
    memcpy(bytes + 80, &checksum, 8);
}

#define HEADER(field) (88 + offsetof(Header, field))
#define SCALAR(field) (88 + SCALARS_AT + offsetof(Scalars, field))
#define OF(value) &(value), sizeof(value)

/* What no sequence of calls can have left behind is refused though the checksum fits. */
static void forged_contents_are_refused(void) {
    static char bytes[IMAGE_SIZE], bad[IMAGE_SIZE];
    size_t size;
    Log log = {.count = 0};
    fmi2FMUstate state = NULL;
    fmi2Component c = toy_in(PHASE_STEPPING, &log);
    const Unit *unit = c;
    image_of(c, bytes, &size);
    const uint32_t five = 5, one = 1, three = 3;
    const int two = 2, nine = 9, far = -4;
    const double nan = NAN, infinite = INFINITY, much = 11, little = 1;
    char text[STRING_SIZE];
    memset(text, 'x', sizeof text);
    const struct {
        size_t at;
        const void *to;
        size_t width;
        const char *text;
    } forged[] = {
        {HEADER(phase), OF(five), "it is in phase 5 of 5"},
        {HEADER(stale), OF(one), "initialised (phase 2), but without initial values"},
        {HEADER(last_step), OF(one), "no step ends with status 1"},
        {HEADER(start_time), OF(nan), "started at nan s"},
        {HEADER(time), OF(infinite), "it stands at inf s"},
        {HEADER(stop_time), OF(nan), "stops at nan s"},
        {SCALAR(w), OF(much), "input 'w' is out of range: 11 1, allowed is -10 to 10"},
        {SCALAR(u), OF(nan), "input 'u' is not finite: nan"},
        {SCALAR(i), OF(far), "input 'i' is out of range: -4"},
        {SCALAR(b), OF(two), "input 'b' is 2; a Boolean is 0 or 1"},
        {SCALAR(x), OF(infinite), "output 'x' is not finite: inf"},
        {SCALAR(twice), OF(nan), "local 'twice' is not finite"},
        {SCALAR(gain), OF(nan), "parameter 'gain' is not finite"},
        {SCALAR(cells), OF(nine), "parameter 'cells' is out of range: 9, allowed is 1 to 8"},
        {SCALAR(label), OF(text), "'label' is too long"},
        {88 + AXES_AT + sizeof(AxisBlock) + offsetof(AxisBlock, load), OF(much), "parameter 'B.load' is out of range"},
        {88 + unit->slopes_at + VR_w * sizeof(double), OF(nan), "slope of input 'w' is nan"},
        {88 + unit->slopes_at + VR_w * sizeof(double), OF(little), "slope of input 'w' is 1; allowed is"},
    };
    for (size_t k = 0; k < sizeof forged / sizeof *forged; k++) {
        memcpy(bad, bytes, size);
        memcpy(bad + forged[k].at, forged[k].to, forged[k].width);
        sign(bad, size);
        CHECK(fmi2DeSerializeFMUstate(c, bad, size, &state) == fmi2Error);
        CHECK(state == NULL);
        CHECK_CONTAINS(log.message, forged[k].text);
    }

    /* The results of a step that failed are what they are. */
    memcpy(bad, bytes, size);
    memcpy(bad + HEADER(phase), &(uint32_t){PHASE_FAILED}, sizeof five);
    memcpy(bad + HEADER(last_step), &three, sizeof three); /* fmi2Error */
    memcpy(bad + SCALAR(x), &nan, sizeof nan);
    sign(bad, size);
    CHECK(fmi2DeSerializeFMUstate(c, bad, size, &state) == fmi2OK);
    CHECK(fmi2FreeFMUstate(c, &state) == fmi2OK);
    CHECK(same_image(c, bytes, size));
    fmi2FreeInstance(c);
}

/* So are initial values that came out infinite: that state can be saved, and goes on elsewhere. */
static void failed_initial_values_can_be_saved(void) {
    static char bytes[IMAGE_SIZE];
    size_t size;
    fmi2FMUstate state = NULL;
    fmi2Component c = toy_in(PHASE_INITIALIZATION, NULL), other = toy_in(PHASE_INSTANTIATED, NULL);
    CHECK(set_real(c, VR_u, 1.7e308) == fmi2OK);
    CHECK(set_real(c, VR_feed, 1) == fmi2OK);
    CHECK(fmi2ExitInitializationMode(c) == fmi2Error); /* twice y */
    image_of(c, bytes, &size);
    CHECK(fmi2DeSerializeFMUstate(other, bytes, size, &state) == fmi2OK);
    CHECK(fmi2SetFMUstate(other, state) == fmi2OK);
    CHECK(set_real(other, VR_u, 1) == fmi2OK);
    CHECK(fmi2ExitInitializationMode(other) == fmi2OK);
    CHECK(fmi2FreeFMUstate(other, &state) == fmi2OK);
    fmi2FreeInstance(other);
    fmi2FreeInstance(c);
}

/* Nothing has moved the clock ahead of the first step. */
static void a_clock_ahead_of_the_start_is_refused(void) {
    static char bytes[IMAGE_SIZE];
    size_t size;
    Log log = {.count = 0};
    fmi2FMUstate state = NULL;
    const double later = 120;
    for (Phase phase = PHASE_INSTANTIATED; phase <= PHASE_INITIALIZATION; phase++) {
        fmi2Component c = toy_in(phase, &log);
        image_of(c, bytes, &size);
        memcpy(bytes + HEADER(time), OF(later));
        sign(bytes, size);
        CHECK(fmi2DeSerializeFMUstate(c, bytes, size, &state) == fmi2Error);
        CHECK_CONTAINS(log.message, "not initialised yet, to start at 0 s, it stands at 120 s");
        memcpy(bytes + HEADER(start_time), OF(later));
        sign(bytes, size);
        CHECK(fmi2DeSerializeFMUstate(c, bytes, size, &state) == fmi2OK);
        CHECK(fmi2FreeFMUstate(c, &state) == fmi2OK);
        fmi2FreeInstance(c);
    }
}

int main(void) {
    a_clock_ahead_of_the_start_is_refused();
    forged_contents_are_refused();
    failed_initial_values_can_be_saved();
    CHECK(memory.held == 0);
    return CHECK_RESULT;
}

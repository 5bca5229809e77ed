/* Steps: input slopes, communication points and stop time, failures, derivatives, status, tunable parameters. */
#include "toy.h"

static double step(fmi2Component c, double t, double h) {
    CHECK(fmi2DoStep(c, t, h, fmi2True) == fmi2OK);
    return get_real(c, VR_x);
}

/* --- slopes: x' = 2 u */

static void slopes_serve_one_step_in_either_order(void) {
    for (int value_first = 0; value_first < 2; value_first++) {
        fmi2Component c = toy_in(PHASE_STEPPING, NULL);
        if (value_first) {
            CHECK(set_real(c, VR_u, 1) == fmi2OK);
        }
        CHECK(set_slope(c, VR_u, 4) == fmi2OK);
        CHECK(set_slope(c, AXIS(1, F), 8) == fmi2OK);
        if (!value_first) {
            CHECK(set_real(c, VR_u, 1) == fmi2OK);
        }
        CHECK_EQUAL(step(c, 0, 0.5), 2 * (0.5 + 4 * 0.125));
        CHECK_EQUAL(get_real(c, AXIS(1, s)), 8 * 0.5 + 0.5);
        CHECK_EQUAL(get_real(c, VR_u), 1);         /* the value is that of the start of the step */
        CHECK_EQUAL(step(c, 0.5, 0.5), 2 * 1 + 1); /* held: the slope is used up */
        CHECK_EQUAL(get_real(c, AXIS(1, s)), 0 + 0.5);
        fmi2FreeInstance(c);
    }
}

static void a_slope_set_early_waits_for_the_first_step(void) {
    fmi2Component c = toy_in(PHASE_INSTANTIATED, NULL);
    CHECK(set_slope(c, VR_u, 4) == fmi2OK);
    toy_enter(c, PHASE_STEPPING);
    CHECK_EQUAL(get_real(c, VR_y), 0);
    CHECK_EQUAL(step(c, 0, 0.5), 2 * 4 * 0.125);
    fmi2FreeInstance(c);
}

static void a_refused_step_keeps_the_slope(void) {
    fmi2Component c = toy_in(PHASE_STEPPING, NULL);
    CHECK(set_slope(c, VR_u, 4) == fmi2OK);
    CHECK(fmi2DoStep(c, 0, -1, fmi2True) == fmi2Error);
    CHECK_EQUAL(step(c, 0, 0.5), 2 * 4 * 0.125);
    fmi2FreeInstance(c);
}

static void bad_slopes(void) {
    static char before[IMAGE_SIZE];
    size_t size;
    Log log = {.count = 0};
    fmi2Component c = toy_in(PHASE_STEPPING, &log);
    image_of(c, before, &size);
    CHECK(set_slope(c, VR_u, NAN) == fmi2Error);
    CHECK_CONTAINS(log.message, "fmi2SetRealInputDerivatives: the slope of input 'u' is not finite: nan");
    const fmi2ValueReference both[] = {VR_u, AXIS(0, F)};
    CHECK(fmi2SetRealInputDerivatives(c, both, 2, (const int[]){1, 1}, (const double[]){1, INFINITY}) == fmi2Error);
    CHECK_CONTAINS(log.message, "'A.F'");
    CHECK(fmi2SetRealInputDerivatives(c, both, 2, (const int[]){1, 2}, (const double[]){1, 1}) == fmi2Error);
    CHECK_CONTAINS(log.message, "order 2 asked for 'A.F'; allowed is order 1");
    CHECK(set_slope(c, VR_x, 1) == fmi2Error);
    CHECK_CONTAINS(log.message, "output 'x'");
    CHECK(set_slope(c, VR_gain, 1) == fmi2Error);
    CHECK(set_slope(c, VR_i, 1) == fmi2Error);
    CHECK(set_slope(c, 77, 1) == fmi2Error);
    CHECK(same_image(c, before, size));
    fmi2FreeInstance(c);
}

static void an_input_that_runs_away_is_refused(void) {
    static char before[IMAGE_SIZE];
    size_t size;
    Log log = {.count = 0};
    fmi2Component c = toy_in(PHASE_STEPPING, &log);
    CHECK(set_slope(c, AXIS(1, F), 1e308) == fmi2OK);
    image_of(c, before, &size);
    CHECK(fmi2DoStep(c, 0, 10, fmi2True) == fmi2Error);
    CHECK_CONTAINS(log.message, "input 'B.F' does not stay finite");
    CHECK(same_image(c, before, size));
    CHECK(set_slope(c, AXIS(1, F), 1) == fmi2OK);
    step(c, 0, 10);
    fmi2FreeInstance(c);
}

/* Slopes of usual size are not looked at again at the end of a step; every way to an unusual one must be noticed. */
static void an_input_may_run_away_after_usual_steps(void) {
    Log log = {.count = 0};
    fmi2Component c = toy_in(PHASE_STEPPING, &log);
    for (int way = 0; way < 4; way++) {
        fmi2FMUstate usual = NULL, wild = NULL;
        CHECK(set_slope(c, AXIS(1, F), 1) == fmi2OK);
        step(c, way, 1); /* from here on all inputs are known to be of usual size */
        CHECK(fmi2GetFMUstate(c, &usual) == fmi2OK);
        CHECK(set_slope(c, AXIS(1, F), way == 0 ? 1e308 : 1e149) == fmi2OK);
        if (way > 1) {
            CHECK(set_real(c, AXIS(1, F), 1.7976931348623157e308) == fmi2OK);
        }
        CHECK(fmi2GetFMUstate(c, &wild) == fmi2OK);
        if (way == 3) {
            CHECK(fmi2SetFMUstate(c, usual) == fmi2OK);
            CHECK(set_slope(c, AXIS(1, F), 1) == fmi2OK);
            step(c, way + 1, 1);
            CHECK(fmi2SetFMUstate(c, wild) == fmi2OK);
        }
        log.count = 0;
        CHECK(fmi2DoStep(c, way + 1, way == 0 ? 10 : way == 1 ? 1e200 : 1e145, fmi2True) == fmi2Error);
        CHECK_CONTAINS(log.message, "input 'B.F' does not stay finite");
        CHECK(fmi2SetFMUstate(c, usual) == fmi2OK);
        fmi2FreeFMUstate(c, &usual);
        fmi2FreeFMUstate(c, &wild);
    }
    fmi2FreeInstance(c);
}

/* --- time */

static fmi2Status step_from(double start, double stop, double t, double h, Log *log) {
    fmi2Component c = toy_in(PHASE_INSTANTIATED, log);
    CHECK(fmi2SetupExperiment(c, fmi2False, 0, start, !isnan(stop), stop) == fmi2OK);
    CHECK(fmi2EnterInitializationMode(c) == fmi2OK);
    CHECK(fmi2ExitInitializationMode(c) == fmi2OK);
    static char before[IMAGE_SIZE];
    size_t size;
    image_of(c, before, &size);
    fmi2Status status = fmi2DoStep(c, t, h, fmi2True);
    CHECK(status == fmi2OK || same_image(c, before, size));
    fmi2FreeInstance(c);
    return status;
}

static void communication_points(void) {
    Log log = {.count = 0};
    /* rounding is no other place ... */
    CHECK(step_from(0, NAN, 0, 1e-3, NULL) == fmi2OK);
    CHECK(step_from(0, NAN, 1e-13, 1e-3, NULL) == fmi2OK);
    CHECK(step_from(10, NAN, 10.000000000002242, 1e-3, NULL) == fmi2OK);
    CHECK(step_from(-5, NAN, -5.000000000000001, 1e-3, NULL) == fmi2OK);
    CHECK(step_from(1e5, NAN, nextafter(1e5, 2e5), 1e-9, NULL) == fmi2OK);
    /* ... a part of a step is */
    CHECK(step_from(0, NAN, 1e-3, 1e-3, &log) == fmi2Error);
    CHECK_CONTAINS(log.message,
                   "fmi2DoStep (t = 0.001 s, h = 0.001 s): the communication point is 0.001 s, but the unit "
                   "stands at 0 s");
    CHECK(step_from(0, NAN, 1e-8, 1e-3, NULL) == fmi2Error);
    CHECK(step_from(10, NAN, 9.999875, 125e-6, NULL) == fmi2Error);
    CHECK(step_from(1e6, NAN, 1e6 - 125e-6, 125e-6, NULL) == fmi2Error); /* 1.25e-10 of t, but a whole step */
    CHECK(step_from(0, NAN, NAN, 1e-3, &log) == fmi2Error);
    CHECK_CONTAINS(log.message, "not finite");
    CHECK(step_from(0, NAN, INFINITY, 1e-3, NULL) == fmi2Error);
}

/* The time is the importer's, not a sum of the unit's own. */
static void the_importers_time_is_taken(void) {
    fmi2Component c = toy_in(PHASE_INSTANTIATED, NULL);
    CHECK(fmi2SetupExperiment(c, fmi2False, 0, 10, fmi2False, 0) == fmi2OK);
    CHECK(fmi2EnterInitializationMode(c) == fmi2OK);
    CHECK(fmi2ExitInitializationMode(c) == fmi2OK);
    double time = NAN;
    step(c, 10.000000000002242, 1e-3);
    CHECK(fmi2GetRealStatus(c, fmi2LastSuccessfulTime, &time) == fmi2OK);
    CHECK_EQUAL(time, 10.000000000002242 + 1e-3);
    fmi2FreeInstance(c);
}

static void step_sizes(void) {
    Log log = {.count = 0};
    const double bad[] = {0, -1e-3, NAN, INFINITY};
    for (int k = 0; k < 4; k++) {
        CHECK(step_from(0, NAN, 0, bad[k], &log) == fmi2Error);
        CHECK_CONTAINS(log.message, "step size must be finite and greater than 0");
    }
    CHECK(step_from(0, NAN, 0, 1e-12, NULL) == fmi2OK);
    CHECK(step_from(0, NAN, 0, 1e4, NULL) == fmi2OK);
}

static void stop_time(void) {
    Log log = {.count = 0};
    CHECK(step_from(0, 2, 0, 2, NULL) == fmi2OK);
    CHECK(step_from(1.9999999999995715, 2, 1.9999999999995715, 4.285e-13, NULL) == fmi2OK);
    CHECK(step_from(2 - 125e-6, 2, 2 - 125e-6, 125e-6 * (1 + 1e-9), NULL) == fmi2OK);
    CHECK(step_from(2 - 125e-6, 2, 2 - 125e-6, 250e-6, &log) == fmi2Error);
    CHECK_CONTAINS(log.message, "the step would end at 2.000125 s, past the stop time of 2 s");
    CHECK(step_from(2, 2, 2, 125e-6, NULL) == fmi2Error);
    CHECK(step_from(-2, -1, -2, 1, NULL) == fmi2OK);
    CHECK(step_from(-2, -1, -2, 1.5, NULL) == fmi2Error);
}

/* Three ways in which masters count the time of 1e5 steps; the second one drifts. */
static void time_as_masters_count_it(void) {
    for (int way = 0; way < 3; way++) {
        fmi2Component c = toy_in(PHASE_INSTANTIATED, NULL);
        const double h = 125e-6;
        CHECK(fmi2SetupExperiment(c, fmi2False, 0, 0.1, fmi2True, 0.1 + 100000 * h) == fmi2OK);
        CHECK(fmi2EnterInitializationMode(c) == fmi2OK);
        CHECK(fmi2ExitInitializationMode(c) == fmi2OK);
        double sum = 0.1;
        int good = 0;
        for (int k = 0; k < 100000; k++, sum += h) {
            double t = way == 0 ? 0.1 + k * h : way == 1 ? sum : (100000000.0 + k * 125000.0) / 1e9;
            good += fmi2DoStep(c, t, h, fmi2True) == fmi2OK;
        }
        CHECK_EQUAL(good, 100000);
        CHECK(fmi2DoStep(c, 0.1 + 100000 * h, h, fmi2True) == fmi2Error);
        fmi2FreeInstance(c);
    }
}

static void experiments(void) {
    Log log = {.count = 0};
    fmi2Component c = toy_in(PHASE_INSTANTIATED, &log);
    CHECK(fmi2SetupExperiment(c, fmi2False, 0, NAN, fmi2False, 0) == fmi2Error);
    CHECK(fmi2SetupExperiment(c, fmi2False, 0, 3, fmi2True, 2) == fmi2Error);
    CHECK_CONTAINS(log.message, "the stop time of 2 s is not after the start time of 3 s");
    CHECK(fmi2SetupExperiment(c, fmi2False, 0, 0, fmi2True, NAN) == fmi2Error);
    CHECK(fmi2SetupExperiment(c, fmi2True, 1e-6, 0, fmi2True, INFINITY) == fmi2OK);
    CHECK(fmi2EnterInitializationMode(c) == fmi2OK);
    CHECK(fmi2ExitInitializationMode(c) == fmi2OK);
    step(c, 0, 1e6);

    /* Without an experiment: from 0, without end. A reset forgets the former one. */
    CHECK(fmi2Reset(c) == fmi2OK);
    CHECK(fmi2SetupExperiment(c, fmi2False, 0, 3, fmi2True, 4) == fmi2OK);
    for (int again = 0; again < 2; again++) {
        CHECK(fmi2Reset(c) == fmi2OK);
        CHECK(fmi2EnterInitializationMode(c) == fmi2OK);
        CHECK(fmi2ExitInitializationMode(c) == fmi2OK);
        CHECK(unit_start_time(c) == 0);
        step(c, 0, 1e6);
    }
    fmi2FreeInstance(c);
}

/* --- failures and status */

static void failed(fmi2Component c, const Log *log, const char *text) {
    fmi2Status last = fmi2OK;
    double time = -1;
    fmi2Boolean terminated = fmi2True;
    fmi2String pending = NULL;
    CHECK_CONTAINS(log->message, text);
    CHECK(fmi2GetStatus(c, fmi2DoStepStatus, &last) == fmi2OK && last == fmi2Error);
    CHECK(fmi2GetRealStatus(c, fmi2LastSuccessfulTime, &time) == fmi2OK);
    CHECK_EQUAL(time, 0.5);
    CHECK(fmi2GetBooleanStatus(c, fmi2Terminated, &terminated) == fmi2OK && !terminated);
    CHECK(fmi2GetStringStatus(c, fmi2PendingStatus, &pending) == fmi2OK && pending != NULL);
    CHECK(fmi2GetRealStatus(c, fmi2DoStepStatus, &time) == fmi2Discard);
    CHECK_CONTAINS(log->message, "fmi2DoStepStatus is not known here");
    CHECK(fmi2GetStatus(c, (fmi2StatusKind)9, &last) == fmi2Discard);
    CHECK(fmi2DoStep(c, 0.5, 0.5, fmi2True) == fmi2Error);
    CHECK_CONTAINS(log->message, "not allowed in state 'error'");
}

static void steps_fail(void) {
    Log log = {.count = 0};
    fmi2Component c = toy_in(PHASE_STEPPING, &log);
    step(c, 0, 0.5);
    CHECK(fmi2SetDebugLogging(c, fmi2True, 0, NULL) == fmi2OK);
    CHECK(set_real(c, VR_u, 999) == fmi2OK);
    CHECK(set_slope(c, VR_u, 4) == fmi2OK);
    CHECK(fmi2DoStep(c, 0.5, 0.5, fmi2True) == fmi2Error);
    failed(c, &log, "fmi2DoStep (t = 0.5 s, h = 0.5 s): the speed of 1001 at 1 exceeds the limit of 1000");
    fmi2FreeInstance(c);

    c = toy_in(PHASE_STEPPING, &log);
    step(c, 0, 0.5);
    CHECK(fmi2SetDebugLogging(c, fmi2True, 0, NULL) == fmi2OK);
    CHECK(set_real(c, VR_u, 500) == fmi2OK);
    CHECK(set_real(c, VR_gain, 1.7e308) == fmi2OK);
    CHECK(fmi2DoStep(c, 0.5, 0.5, fmi2True) == fmi2Error);
    failed(c, &log, "output 'x' is not finite: inf");
    fmi2FreeInstance(c);
}

/* Each is finite, and their sum is not. */
static void results_may_be_huge(void) {
    Log log = {.count = 0};
    fmi2Component c = toy_in(PHASE_STEPPING, &log);
    CHECK(set_real(c, VR_u, 1) == fmi2OK);
    CHECK(set_real(c, VR_gain, 0.8e308) == fmi2OK);
    step(c, 0, 1);
    CHECK_EQUAL(get_real(c, VR_x), 0.8e308);
    CHECK_EQUAL(get_real(c, VR_twice), 1.6e308);
    fmi2FreeInstance(c);
}

static void a_model_may_warn(void) {
    Log log = {.count = 0};
    fmi2Component c = toy_in(PHASE_STEPPING, &log);
    CHECK(fmi2SetDebugLogging(c, fmi2True, 1, (const fmi2String[]){"logStatusWarning"}) == fmi2OK);
    CHECK(set_integer(c, VR_i, -3) == fmi2OK);
    CHECK(fmi2DoStep(c, 0, 0.5, fmi2True) == fmi2OK);
    CHECK_CONTAINS(log.message, "i is -3");
    CHECK(log.status == fmi2Warning);
    fmi2FreeInstance(c);
}

/* --- derivatives */

static void output_derivatives(void) {
    Log log = {.count = 0};
    fmi2Component c = toy_in(PHASE_STEPPING, &log);
    CHECK(set_real(c, VR_u, 3) == fmi2OK);
    CHECK(set_slope(c, VR_u, 4) == fmi2OK);
    step(c, 0, 0.5);
    const fmi2ValueReference vr[] = {VR_x, AXIS(1, s)};
    double value[2] = {NAN, NAN};
    CHECK(fmi2GetRealOutputDerivatives(c, vr, 2, (const int[]){1, 1}, value) == fmi2OK);
    CHECK_EQUAL(value[0], 2 * (3 + 4 * 0.5));
    CHECK_EQUAL(value[1], 0);
    CHECK(fmi2GetRealOutputDerivatives(c, vr, 2, (const int[]){1, 2}, value) == fmi2Error);
    CHECK_CONTAINS(log.message, "order 2 asked for 'B.s'; allowed is order 1 (maxOutputDerivativeOrder)");
    CHECK(fmi2GetRealOutputDerivatives(c, vr, 1, (const int[]){0}, value) == fmi2Error);
    const fmi2ValueReference bad[] = {VR_u, VR_twice, VR_gain, VR_steps, 1000};
    for (int k = 0; k < 5; k++) {
        CHECK(fmi2GetRealOutputDerivatives(c, &bad[k], 1, (const int[]){1}, value) == fmi2Error);
    }
    fmi2FreeInstance(c);
}

static void directional_derivatives(void) {
    Log log = {.count = 0};
    fmi2Component c = toy_in(PHASE_INITIALIZATION, &log);
    CHECK(set_real(c, VR_feed, 0.75) == fmi2OK);
    const fmi2ValueReference unknowns[] = {VR_y, AXIS(0, s), VR_x, AXIS(1, s)}, knowns[] = {VR_u, VR_w, AXIS(1, F)};
    const double seed[] = {4, 10, 7};
    double value[4] = {NAN, NAN, NAN, NAN};
    for (int phase = 0; phase < 2; phase++) {
        CHECK(fmi2GetDirectionalDerivative(c, unknowns, 4, knowns, 3, seed, value) == fmi2OK);
        CHECK_EQUAL(value[0], 0.75 * 4 + 10);
        CHECK_EQUAL(value[1], 0);
        CHECK_EQUAL(value[2], 0);
        CHECK_EQUAL(value[3], 7);
        if (phase == 0) {
            CHECK(fmi2ExitInitializationMode(c) == fmi2OK);
        }
    }
    CHECK(fmi2Reset(c) == fmi2OK);
    CHECK(set_string(c, VR_label, "refused") == fmi2OK);
    toy_enter(c, PHASE_INITIALIZATION);
    CHECK(fmi2GetDirectionalDerivative(c, unknowns, 4, knowns, 3, seed, value) == fmi2Error);
    CHECK_CONTAINS(log.message, "fmi2GetDirectionalDerivative: label 'refused' is refused");
    const fmi2ValueReference input = VR_u, output = VR_y, parameter = VR_gain;
    CHECK(fmi2GetDirectionalDerivative(c, &input, 1, &input, 1, seed, value) == fmi2Error);
    CHECK_CONTAINS(log.message,
                   "unknown of a directional derivative is an output, but value reference 0 is the input 'u'");
    CHECK(fmi2GetDirectionalDerivative(c, &output, 1, &output, 1, seed, value) == fmi2Error);
    CHECK(fmi2GetDirectionalDerivative(c, &output, 1, &parameter, 1, seed, value) == fmi2Error);
    CHECK_CONTAINS(log.message, "parameter 'gain'");
    fmi2FreeInstance(c);
}

/* --- tunable parameters, allocation */

static void tunable_parameters(void) {
    Log log = {.count = 0};
    fmi2Component c = toy_in(PHASE_STEPPING, &log);
    CHECK(set_real(c, VR_u, 1) == fmi2OK);
    CHECK_EQUAL(step(c, 0, 1), 2);
    CHECK(get_integer(c, VR_derivations) == 1);
    CHECK(set_real(c, VR_gain, 3) == fmi2OK);
    CHECK(set_real(c, AXIS(1, load), 1) == fmi2OK);
    CHECK_EQUAL(get_real(c, AXIS(1, s)), 0.5);
    CHECK_EQUAL(step(c, 1, 1), 5);
    CHECK_EQUAL(get_real(c, AXIS(1, s)), -1);
    CHECK(get_integer(c, VR_derivations) == 2); /* once for both, */
    step(c, 2, 1);
    CHECK(get_integer(c, VR_derivations) == 2); /* and not again */
    CHECK(set_real(c, VR_gain, 3) == fmi2OK);
    step(c, 3, 1);
    CHECK(get_integer(c, VR_derivations) == 2); /* nor for the same value */

    /* What the model refuses refuses the step; nothing has moved, and a sensible value puts it right. */
    static char before[IMAGE_SIZE];
    size_t size;
    CHECK(set_real(c, VR_gain, 13) == fmi2OK);
    image_of(c, before, &size);
    CHECK(fmi2DoStep(c, 4, 1, fmi2True) == fmi2Error);
    CHECK_CONTAINS(log.message, "gain 13");
    CHECK(same_image(c, before, size));
    CHECK(set_real(c, VR_gain, 1) == fmi2OK);
    CHECK_EQUAL(step(c, 4, 1), 12);
    fmi2FreeInstance(c);
}

static void steps_do_not_allocate(void) {
    fmi2Component c = toy_in(PHASE_STEPPING, NULL);
    long before = memory.allocations;
    for (int k = 0; k < 100; k++) {
        CHECK(set_real(c, VR_u, k) == fmi2OK);
        CHECK(set_slope(c, VR_u, 1) == fmi2OK);
        step(c, k, 1);
    }
    CHECK(memory.allocations == before);
    fmi2FreeInstance(c);
}

int main(void) {
    slopes_serve_one_step_in_either_order();
    a_slope_set_early_waits_for_the_first_step();
    a_refused_step_keeps_the_slope();
    bad_slopes();
    an_input_that_runs_away_is_refused();
    an_input_may_run_away_after_usual_steps();
    communication_points();
    the_importers_time_is_taken();
    step_sizes();
    stop_time();
    time_as_masters_count_it();
    experiments();
    steps_fail();
    results_may_be_huge();
    a_model_may_warn();
    output_derivatives();
    directional_derivatives();
    tunable_parameters();
    steps_do_not_allocate();
    CHECK(memory.held == 0);
    return CHECK_RESULT;
}

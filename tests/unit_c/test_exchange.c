/* The native cycle loop (src/exchange) with FMI functions of a unit that only notes what it is called with. */
#include <fenv.h>

#include "check.h"
#include "exchange.h"
#include "fmi2FunctionTypes.h"
#include "vectors.h"

typedef struct Notes {
    int calls;
    double seen[32], t[32], h;
    double fail_at; /* time of the step that fails */
} Notes;

static fmi2Status note_set(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Real value[]) {
    Notes *notes = c;
    CHECK(vr != NULL && n == 2);
    notes->seen[notes->calls++] = value[1];
    return fmi2OK;
}

static fmi2Status note_get(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Real value[]) {
    Notes *notes = c;
    CHECK(vr != NULL && n == 1);
    value[0] = 100 + notes->calls++;
    return fmi2Warning; /* goes on */
}

static fmi2Status note_step(fmi2Component c, fmi2Real t, fmi2Real h, fmi2Boolean keep) {
    Notes *notes = c;
    CHECK(keep == fmi2True);
    notes->t[notes->calls++] = t;
    notes->h = h;
    return t >= notes->fail_at ? fmi2Discard : fmi2OK;
}

static unsigned references[2] = {7, 8};

static void tables_are_used_row_by_row(void) {
    double sent[3][2] = {{0, 10}, {0, 11}, {0, 12}}, got[2] = {0, 0};
    Notes setting = {.calls = 0}, getting = {.calls = 0};
    Fault fault = {.cycle = -1, .operation = -1};
    Operation operations[] = {
        {.kind = EXCHANGE_due,
         .what = EXCHANGE_set_real,
         .count = 2,
         .call = (function)note_set,
         .component = &setting,
         .references = references,
         .y = sent,
         .every = 2,
         .next = 1,
         .stride = sizeof sent[0],
         .rows = 3},
        {.kind = EXCHANGE_due,
         .what = EXCHANGE_get_real,
         .count = 1,
         .call = (function)note_get,
         .component = &getting,
         .references = references,
         .y = got,
         .every = 5,
         .next = 5,
         .stride = sizeof got[0],
         .rows = 2},
        {.kind = EXCHANGE_end},
    };
    /* in two slices, which must not matter: due at 1, 3, 5, 7 and at 5 */
    CHECK(exchange_run(operations, 1e-3, 0, 4, &fault) == fmi2OK);
    CHECK(setting.calls == 2 && getting.calls == 0);
    CHECK(exchange_run(operations, 1e-3, 4, 9, &fault) == fmi2OK);
    CHECK(setting.calls == 4 && getting.calls == 1);
    const double expected[] = {10, 11, 12, 10};
    for (int i = 0; i < 4; i++) {
        CHECK_EQUAL(setting.seen[i], expected[i]);
    }
    CHECK_EQUAL(got[0], 100);
    CHECK_EQUAL(got[1], 0);
    CHECK(fault.cycle == -1); /* untouched */
}

/* What the memory of the mark holds while a unit works: whose call it is. */
typedef struct Seen {
    const Fault *mark;
    int64_t cycle[3], operation[3];
    int calls;
} Seen;

static fmi2Status note_mark(fmi2Component c, fmi2Real t, fmi2Real h, fmi2Boolean no_return) {
    (void)t, (void)h, (void)no_return;
    Seen *seen = c;
    seen->cycle[seen->calls] = seen->mark->cycle;
    seen->operation[seen->calls++] = seen->mark->operation;
    return fmi2OK;
}

static void a_mark_says_whose_call_it_is(void) {
    double a = 1, y = 0;
    Fault mark = {.cycle = -1, .operation = -1, .looked_at = -1, .changed_by = -1};
    Seen first = {.mark = &mark}, second = {.mark = &mark};
    Operation operations[] = {
        {.kind = EXCHANGE_line, .count = 1, .y = &y, .a = &y, .b = &a, .s = 1},
        {.kind = EXCHANGE_do_step, .call = (function)note_mark, .component = &first, .h = 1},
        {.kind = EXCHANGE_line, .count = 1, .y = &y, .a = &y, .b = &a, .s = 1},
        {.kind = EXCHANGE_do_step, .call = (function)note_mark, .component = &second, .h = 1},
        {.kind = EXCHANGE_end},
    };
    CHECK(exchange_run_marked(operations, 1, 5, 8, &mark) == fmi2OK);
    CHECK(first.calls == 3 && second.calls == 3);
    for (int k = 0; k < 3; k++) {
        CHECK(first.cycle[k] == 5 + k && first.operation[k] == 1);
        CHECK(second.cycle[k] == 5 + k && second.operation[k] == 3);
    }
    CHECK_EQUAL(y, 6);
}

static void failure_ends_the_loop(void) {
    double a = 1, y = 0;
    Notes notes = {.fail_at = 0.095};
    Fault fault = {.cycle = -1, .operation = -1};
    Operation operations[] = {
        {.kind = EXCHANGE_line, .count = 1, .y = &y, .a = &y, .b = &a, .s = 1},
        {.kind = EXCHANGE_do_step, .call = (function)note_step, .component = &notes, .s = 0.01, .h = 0.02},
        {.kind = EXCHANGE_line, .count = 1, .y = &y, .a = &y, .b = &a, .s = 100},
        {.kind = EXCHANGE_end},
    };
    CHECK(exchange_run(operations, 0.03, 0, 10, &fault) == fmi2Discard);
    CHECK(fault.cycle == 3 && fault.operation == 1);
    CHECK(notes.calls == 4);
    for (int k = 0; k < 4; k++) {
        CHECK_EQUAL(notes.t[k], k * 0.03 + 0.01);
    }
    CHECK_EQUAL(notes.h, 0.02);
    CHECK_EQUAL(y, 3 * 101 + 1);
    Operation unknown = {.kind = EXCHANGE_KIND_COUNT};
    CHECK(exchange_run(&unknown, 1, 0, 1, &fault) == fmi2Fatal);
}

static fmi2Status note_keep(fmi2Component c, fmi2FMUstate *state) {
    *state = c;
    return fmi2OK;
}

static fmi2Status note_back(fmi2Component c, fmi2FMUstate state) {
    CHECK(state == c);
    ((Notes *)c)->calls = 0;
    return fmi2OK;
}

static void states_are_kept_where_y_says(void) {
    Notes notes = {.fail_at = 1};
    Fault fault;
    fmi2FMUstate kept = NULL;
    Operation operations[] = {
        {.kind = EXCHANGE_get_state, .call = (function)note_keep, .component = &notes, .y = &kept},
        {.kind = EXCHANGE_do_step, .call = (function)note_step, .component = &notes, .h = 1},
        {.kind = EXCHANGE_set_state, .call = (function)note_back, .component = &notes, .y = &kept},
        {.kind = EXCHANGE_end},
    };
    CHECK(exchange_run(operations, 0.1, 0, 2, &fault) == fmi2OK);
    CHECK(kept == &notes && notes.calls == 0);
    CHECK_EQUAL(notes.t[0], 0.1);
}

static void arithmetic(void) {
    const double a[] = {1, -2, 0.1}, b[] = {3, 5, 0.7};
    double y[3];
    vector_copy(3, y, a);
    CHECK_EQUAL(y[1], -2);
    vector_line(3, y, a, 0.3, b);
    CHECK_EQUAL(y[2], 0.1 + 0.3 * 0.7);
    vector_rate(3, y, a, b, 0.25);
    CHECK_EQUAL(y[0], -8);
}

static void energies_of_the_bond(void) {
    const double M_fr[] = {2, -1}, n[] = {3, 4}, n_slope[] = {10, 20}, assumed_torque[] = {2.5, -1}, n_end[] = {4, 6};
    double residual[] = {0, 1}, residual_peak[] = {0, 3}, dissipated[] = {0, 1};
    Bond bond = {(address)M_fr,  (address)n, (address)n_slope, (address)assumed_torque,
                 (address)n_end, residual,   residual_peak,    dissipated};
    Operation operations[] = {{.kind = EXCHANGE_bond, .count = 2, .a = &bond, .s = 0.1}, {.kind = EXCHANGE_end}};
    Fault fault;
    CHECK(exchange_run(operations, 0.1, 0, 1, &fault) == fmi2OK);
    /* taken: 2 (3 + 1) = 8 and -1 (4 + 2) = -6; given: 2.5 4 = 10 and -6 */
    CHECK_NEAR(residual[0], 0.1, 1e-15);
    CHECK_EQUAL(residual[1], 1);
    CHECK_EQUAL(residual_peak[0], residual[0]);
    CHECK_EQUAL(residual_peak[1], 3);
    CHECK_NEAR(dissipated[0], 0.8, 1e-15);
    CHECK_NEAR(dissipated[1], 0.4, 1e-15);
    /* what is no number stays visible */
    residual[0] = NAN;
    CHECK(exchange_run(operations, 0.1, 1, 2, &fault) == fmi2OK);
    CHECK(isnan(residual_peak[0]));
    residual[0] = 0;
    CHECK(exchange_run(operations, 0.1, 2, 3, &fault) == fmi2OK);
    CHECK(isnan(residual_peak[0]));
}

/* Parts of a turn that stand behind one another are worked in one go: what is due now and then among them, and a
 * failure in the middle, must come out as if they were worked one by one. */
static void turns_are_worked_part_by_part(void) {
    double value[2] = {0, 5}, sent[2][2] = {{0, 6}, {0, 7}}, got = 0;
    Notes notes = {.fail_at = 2.5};
    Fault fault = {.cycle = -1, .operation = -1};
    Operation operations[] = {
        {.kind = EXCHANGE_set_real,
         .count = 2,
         .call = (function)note_set,
         .component = &notes,
         .references = references,
         .y = value},
        {.kind = EXCHANGE_due,
         .what = EXCHANGE_set_real,
         .count = 2,
         .call = (function)note_set,
         .component = &notes,
         .references = references,
         .y = sent,
         .every = 2,
         .next = 1,
         .stride = sizeof sent[0],
         .rows = 2},
        {.kind = EXCHANGE_do_step, .call = (function)note_step, .component = &notes, .s = 0.5, .h = 1},
        {.kind = EXCHANGE_get_real,
         .count = 1,
         .call = (function)note_get,
         .component = &notes,
         .references = references,
         .y = &got},
        {.kind = EXCHANGE_end},
    };
    CHECK(exchange_run(operations, 1, 0, 4, &fault) == fmi2Discard);
    CHECK(fault.cycle == 2 && fault.operation == 2);
    CHECK(notes.calls == 3 + 4 + 2);
    CHECK_EQUAL(notes.seen[0], 5);
    CHECK_EQUAL(notes.t[1], 0.5);
    CHECK_EQUAL(notes.seen[3], 5);
    CHECK_EQUAL(notes.seen[4], 6);
    CHECK_EQUAL(notes.t[5], 1.5);
    CHECK_EQUAL(got, 106);
    CHECK_EQUAL(notes.t[8], 2.5);
}

static fmi2Status change_rounding(fmi2Component c, fmi2Real t, fmi2Real h, fmi2Boolean no_return) {
    (void)t, (void)h, (void)no_return;
    fesetround(*(int *)c);
    return fmi2OK;
}

static void a_loop_with_a_mark_puts_rounding_back(void) {
    double one = 1, tiny = 1e-30, y[2] = {0, 0};
    int up = FE_UPWARD, nearest = FE_TONEAREST;
    Operation operations[] = {
        {.kind = EXCHANGE_do_step, .call = (function)change_rounding, .component = &nearest},
        {.kind = EXCHANGE_do_step, .call = (function)change_rounding, .component = &up},
        {.kind = EXCHANGE_line, .count = 1, .y = &y[0], .a = &one, .b = &tiny, .s = 1},
        {.kind = EXCHANGE_do_step, .call = (function)change_rounding, .component = &up},
        {.kind = EXCHANGE_line, .count = 1, .y = &y[1], .a = &one, .b = &tiny, .s = 1},
        {.kind = EXCHANGE_end},
    };
    Fault mark = {.looked_at = -1, .changed_by = -1};
    CHECK(exchange_run_marked(operations, 1, 0, 2, &mark) == fmi2OK);
    CHECK(mark.changed_by == 1 && fegetround() == FE_TONEAREST);
    CHECK_EQUAL(y[0], 1);
    CHECK_EQUAL(y[1], 1);
    mark = (Fault){.looked_at = mark.changed_by, .changed_by = -1};
    CHECK(exchange_run_marked(operations, 1, 2, 4, &mark) == fmi2OK);
    CHECK(mark.changed_by == 3);
    mark = (Fault){.looked_at = mark.changed_by, .changed_by = -1};
    CHECK(exchange_run_marked(operations, 1, 4, 6, &mark) == fmi2OK);
    CHECK(mark.changed_by == -1);
}

static void what_is_not_finite_becomes_zero_some_times_in_a_row(void) {
    double given[3][2] = {{NAN, 1}, {2, 3}, {4, INFINITY}}, y[2], count[2] = {0, 0};
    Fault fault = {.cycle = -1, .operation = -1};
    Operation operations[] = {
        {.kind = EXCHANGE_copy, .count = 2, .y = y},
        {.kind = EXCHANGE_finite, .count = 2, .y = y, .a = count, .s = 2},
        {.kind = EXCHANGE_end},
    };
    const double expected[3][4] = {{0, 1, 1, 1}, {2, 3, 0, 1}, {4, 0, 1, 2}}; /* y, in a row, in all */
    for (int i = 0; i < 3; i++) {
        operations[0].a = given[i];
        CHECK(exchange_run(operations, 1, i, i + 1, &fault) == fmi2OK);
        CHECK(y[0] == expected[i][0] && y[1] == expected[i][1]);
        CHECK(count[0] == expected[i][2] && count[1] == expected[i][3]);
    }
    CHECK(exchange_run(operations, 1, 3, 9, &fault) == fmi2Error);
    CHECK(fault.cycle == 4 && fault.operation == 1);
}

int main(void) {
    CHECK_CONTAINS(exchange_interface(), "5: set_real set_slopes do_step");
    tables_are_used_row_by_row();
    a_mark_says_whose_call_it_is();
    failure_ends_the_loop();
    states_are_kept_where_y_says();
    arithmetic();
    energies_of_the_bond();
    turns_are_worked_part_by_part();
    a_loop_with_a_mark_puts_rounding_back();
    what_is_not_finite_becomes_zero_some_times_in_a_row();
    return CHECK_RESULT;
}

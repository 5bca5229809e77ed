/* The response in one call (src/friction_fmu/response.c) against the contact stepped by hand. */
#include "check.h"
#include "contact.h"
#include "friction_values.h"
#include "response.h"

enum { STEPS = 240 };

static const Contact CONTACT = {.lugre = {.sigma_0 = 300,
                                          .sigma_1 = 0.8,
                                          .sigma_2 = 0.006,
                                          .F_C = 1.6,
                                          .F_S = 2.1,
                                          .v_s = 0.6,
                                          .beta = 1.5,
                                          .F_log = 0.4,
                                          .v_log = 3,
                                          .asymmetry = 0.1},
                                .W = 0.04,
                                .gamma = 0.35};
static const double H = 1e-3;

static double speeds[STEPS + 1], M_fr[STEPS + 2], z[STEPS + 2], c[STEPS + 2];

/* Of one contact alone. */
static size_t response(const double values[], const double n[], size_t steps, double h, size_t substeps, size_t every,
                       double z_0, double c_0, double torque[], double z_out[], double c_out[]) {
    return responses(1, values, n, steps, h, substeps, every, &z_0, &c_0, torque, z_out, c_out);
}

/* A sine with reversals within steps and, at the end, standstill. */
static void prepare(void) {
    for (int i = 0; i <= STEPS; i++) {
        speeds[i] = i < 200 ? 1.3 * sin(0.05 * i + 0.7) : 0;
    }
}

/* What is behind the last value must stay as it is. */
static void mark(size_t at) {
    M_fr[at] = z[at] = c[at] = 77;
}

static void check_mark(size_t at) {
    CHECK(M_fr[at] == 77 && z[at] == 77 && c[at] == 77);
}

static void equals_steps_of_the_contact(void) {
    ContactState state = {.z = 1e-3, .c = -0.01};
    mark(STEPS + 1);
    CHECK(response(VALUES, speeds, STEPS, H, 1, 1, state.z, state.c, M_fr, z, c) == STEPS + 1);
    check_mark(STEPS + 1);
    for (int i = 0; i <= STEPS; i++) {
        if (i > 0) {
            state = contact_advance(&CONTACT, state, speeds[i - 1], speeds[i], H);
        }
        CHECK_EQUAL(M_fr[i], contact_torque(&CONTACT, state, speeds[i], NULL));
        CHECK_EQUAL(z[i], state.z);
        CHECK_EQUAL(c[i], state.c);
    }
}

static void every_leaves_out_what_lies_between(void) {
    static double all[STEPS + 1];
    CHECK(response(VALUES, speeds, STEPS, H, 2, 1, 0, 0, all, NULL, NULL) == STEPS + 1);
    const size_t every[] = {1, 2, 7, STEPS - 1, STEPS, STEPS + 1, (size_t)-1};
    for (size_t i = 0; i < sizeof every / sizeof every[0]; i++) {
        const size_t expected = STEPS / every[i] + 1;
        mark(expected);
        CHECK(response(VALUES, speeds, STEPS, H, 2, every[i], 0, 0, M_fr, z, c) == expected);
        check_mark(expected);
        for (size_t k = 0; k < expected; k++) {
            CHECK_EQUAL(M_fr[k], all[k * every[i]]);
        }
    }
    CHECK(response(VALUES, speeds, 0, H, 1, 1, 1e-3, 0, M_fr, z, c) == 1); /* an instant alone */
    CHECK_EQUAL(z[0], 1e-3);
}

/* Greatest difference of M_fr to a fine solution. */
static double error_with(size_t substeps) {
    static double fine[STEPS + 1];
    CHECK(response(VALUES, speeds, STEPS, H, 512, 1, 0, 0, fine, NULL, NULL) == STEPS + 1);
    CHECK(response(VALUES, speeds, STEPS, H, substeps, 1, 0, 0, M_fr, NULL, NULL) == STEPS + 1);
    double error = 0;
    for (int i = 0; i <= STEPS; i++) {
        error = fmax(error, fabs(M_fr[i] - fine[i]));
    }
    return error;
}

static void substeps_are_of_second_order(void) {
    /* |n| h/g is 0.25 at most; (4/512)^2 of the coarser error is missing from the fine solution */
    const double ratio = error_with(1) / error_with(4);
    CHECK(ratio > 14 && ratio < 18);
    /* substeps of an interval are steps of its length over their number */
    const double ends[] = {-0.5, 0.25}, between[] = {-0.5, -0.3125, -0.125, 0.0625, 0.25};
    CHECK(response(VALUES, ends, 1, 0.0078125, 4, 1, 0, 0, M_fr, NULL, NULL) == 2);
    const double torque = M_fr[1];
    CHECK(response(VALUES, between, 4, 0.0078125 / 4, 1, 4, 0, 0, M_fr, NULL, NULL) == 2);
    CHECK_EQUAL(M_fr[1], torque);
}

static void start_beyond_the_zone_is_put_to_its_end(void) {
    CHECK(response(VALUES, speeds, 1, H, 1, 1, 0, -3, M_fr, z, c) == 2);
    CHECK_EQUAL(c[0], -0.02);
}

static size_t count_with(int parameter, double value) {
    double values[PARAMETERS];
    memcpy(values, VALUES, sizeof values);
    values[parameter] = value;
    return response(values, speeds, STEPS, H, 1, 1, 0, 0, M_fr, z, c);
}

static void refusals(void) {
    for (int k = 0; k < REFUSED; k++) {
        const int i = BELOW[k].at;
        CHECK(count_with(i, VALUES[i]) == STEPS + 1);
        mark(0);
        CHECK(count_with(i, BELOW[k].value) == 0);
        CHECK(count_with(i, NAN) == 0);
        CHECK(count_with(i, INFINITY) == 0);
        check_mark(0);
    }
    CHECK(count_with(AT_F_C, 2.1) == STEPS + 1); /* F_C = F_S */
    CHECK(count_with(AT_F_C, 2.11) == 0);
    CHECK(count_with(AT_beta, 10.1) == 0);
    CHECK(count_with(AT_asymmetry, 0.91) == 0);
    CHECK(count_with(AT_gamma, 1.01) == 0);
    CHECK(response(VALUES, speeds, STEPS, H, 0, 1, 0, 0, M_fr, z, c) == 0);
    CHECK(response(VALUES, speeds, STEPS, H, 1, 0, 0, 0, M_fr, z, c) == 0);
    CHECK(response(VALUES, speeds, STEPS, 0, 1, 1, 0, 0, M_fr, z, c) == 0);
    CHECK(response(VALUES, speeds, STEPS, -H, 1, 1, 0, 0, M_fr, z, c) == 0);
    CHECK(response(VALUES, speeds, STEPS, NAN, 1, 1, 0, 0, M_fr, z, c) == 0);
}

static void stops_where_the_torque_is_no_number(void) {
    const double wild[] = {0, 1, NAN, 1}, far[] = {0, 1, INFINITY, 1};
    mark(3);
    CHECK(response(VALUES, wild, 3, H, 1, 1, 0, 0, M_fr, z, c) == 2);
    CHECK(response(VALUES, far, 3, H, 1, 1, 0, 0, M_fr, z, c) == 2);
    check_mark(3);
    CHECK(response(VALUES, wild, 3, H, 1, 1, NAN, 0, M_fr, z, c) == 0);
}

/* Changes of one parameter, and of several: contacts of the same shape of the torque over speed, and of others. */
static void contacts_side_by_side_do_what_each_does_alone(void) {
    enum { COUNT = PARAMETERS + 4, ROWS = STEPS / 3 + 1 };
    static double values[COUNT][PARAMETERS], torque[COUNT][ROWS], z_out[COUNT][ROWS], c_out[COUNT][ROWS];
    double z_0[COUNT], c_0[COUNT];
    for (int i = 0; i < COUNT; i++) {
        memcpy(values[i], VALUES, sizeof values[i]);
        z_0[i] = 1e-4 * i;
        c_0[i] = 1e-3 * (i - 4);
        if (i < PARAMETERS) {
            values[i][i] *= 1 + 1e-7;
        }
    }
    values[PARAMETERS][AT_F_log] = values[PARAMETERS + 1][AT_F_log] = 0; /* no logarithm, whatever v_log is */
    values[PARAMETERS + 1][AT_v_log] *= 2;
    values[PARAMETERS + 2][AT_v_s] = values[AT_v_s][AT_v_s]; /* that of another one which is not the first */
    values[PARAMETERS + 3][AT_beta] = 1;
    CHECK(responses(COUNT, values[0], speeds, STEPS, H, 2, 3, z_0, c_0, torque[0], z_out[0], c_out[0]) == ROWS);
    for (int i = 0; i < COUNT; i++) {
        CHECK(response(values[i], speeds, STEPS, H, 2, 3, z_0[i], c_0[i], M_fr, z, c) == ROWS);
        CHECK(memcmp(torque[i], M_fr, sizeof torque[i]) == 0);
        CHECK(memcmp(z_out[i], z, sizeof z_out[i]) == 0);
        CHECK(memcmp(c_out[i], c, sizeof c_out[i]) == 0);
        CHECK(i == 0 || memcmp(torque[i], torque[0], sizeof torque[i]) != 0);
    }
    values[3][AT_F_C] = -1; /* one that is refused refuses them all */
    mark(0);
    CHECK(responses(COUNT, values[0], speeds, STEPS, H, 2, STEPS, z_0, c_0, M_fr, z, c) == 0);
    CHECK(responses(0, values[0], speeds, STEPS, H, 1, 1, z_0, c_0, M_fr, z, c) == 0);
    check_mark(0);
}

int main(void) {
    prepare();
    equals_steps_of_the_contact();
    every_leaves_out_what_lies_between();
    substeps_are_of_second_order();
    start_beyond_the_zone_is_put_to_its_end();
    refusals();
    stops_where_the_torque_is_no_number();
    contacts_side_by_side_do_what_each_does_alone();
    return CHECK_RESULT;
}

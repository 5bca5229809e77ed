/* Table of setpoints (src/setpoint_fmu/setpoints.c): what is read, what every fault is answered with, which row holds.
 */
#include <float.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "check.h"
#include "setpoints.h"

#define HEADER "time [s],X.x_s [m],X.n_ffw [rad/s],Z_2.x_s [m],Z_2.n_ffw [rad/s]\n"
#define ROWS "0,1,2,3,4\n0.001,1.5,2.5,3.5,-4.5e-3\n0.002,6,7,8,9\n"

enum { MOST_AXES = 8, MOST_VALUES = 400 };

static SetpointAxis names[MOST_AXES];
static double values[MOST_VALUES];
static Setpoints table;
static char message[512];

static bool read(const char *text) {
    const size_t size = strlen(text);
    table = (Setpoints){.values = values};
    message[0] = '\0';
    CHECK(setpoints_axes_capacity(text, size) <= MOST_AXES);
    if (!setpoints_read_axes(text, size, "t.csv", names, &table.axes, message, sizeof message)) {
        return false;
    }
    CHECK(table.axes <= setpoints_axes_capacity(text, size));
    CHECK(setpoints_rows_capacity(text, size) * (1 + 2 * table.axes) <= MOST_VALUES);
    return setpoints_read_rows(text, size, "t.csv", &table, message, sizeof message) &&
           table.rows <= setpoints_rows_capacity(text, size);
}

static void refuse(const char *text, const char *where, const char *what) {
    CHECK(!read(text));
    CHECK_CONTAINS(message, where);
    CHECK_CONTAINS(message, what);
}

static void test_reading(void) {
    CHECK(read(HEADER ROWS));
    CHECK(table.axes == 2 && table.width == 5 && table.rows == 3);
    CHECK_TEXT(names[0], "X");
    CHECK_TEXT(names[1], "Z_2");
    CHECK_EQUAL(table.first, 0);
    CHECK_EQUAL(table.cycle, 0.001);
    CHECK_EQUAL(values[5], 0.001);
    CHECK_EQUAL(values[9], -4.5e-3);
    CHECK_EQUAL(values[14], 9);
    /* byte-order mark, CRLF, blank lines, blanks around cells, no newline at the end */
    CHECK(read("\xEF\xBB\xBF time [s], X.x_s [m] ,X.n_ffw [rad/s]\r\n\r\n-0.5, 1 ,2\r\n\n0.5,3,4"));
    CHECK(table.axes == 1 && table.rows == 2);
    CHECK_EQUAL(table.first, -0.5);
    CHECK_EQUAL(table.cycle, 1);
    /* the longest name, and a table that starts late */
    CHECK(read("time [s],A234567890123456789012345678901.x_s [m],A234567890123456789012345678901.n_ffw [rad/s]\n"
               "1000,1,2\n1000.00025,3,4\n1000.0005,3,4\n"));
    CHECK(strlen(names[0]) == 31);
}

static void test_faults_of_the_header(void) {
    refuse("", "t.csv", "must begin with the header time [s],X.x_s [m]");
    refuse("t,X.x_s [m],X.n_ffw [rad/s]\n" ROWS, "t.csv", "must begin with the header");
    refuse("time [ms],X.x_s [m],X.n_ffw [rad/s]\n0,1,2\n", "t.csv", "must begin with the header");
    refuse("time [s]\n0\n1\n", "line 1", "there is no axis");
    refuse("time [s],X.x_s [m]\n0,1\n1,1\n", "line 1", "X.n_ffw [rad/s] is missing");
    refuse("time [s],X.x_s [m],X.n_ffw [rad/s],Z.x_s [m]\n0,1,2,3\n", "line 1", "Z.n_ffw [rad/s] is missing");
    refuse("time [s],X.x_s [mm],X.n_ffw [rad/s]\n", "line 1, column 2", "'X.x_s [mm]': expected is the position");
    refuse("time [s],X.n_ffw [rad/s],X.x_s [m]\n", "line 1, column 2", "expected is the position setpoint");
    refuse("time [s],X.x_s [m],X.n_ffw [rpm]\n", "line 1, column 3", "expected is the speed feedforward");
    refuse("time [s],X.x_s [m],Z.n_ffw [rad/s]\n", "line 1, column 3", "of the axis before it");
    refuse("\ntime [s],X.x_s [m],XX.n_ffw [rad/s]\n", "line 2, column 3", "of the axis before it");
    refuse("time [s],.x_s [m],.n_ffw [rad/s]\n", "line 1, column 2", "expected is the position setpoint");
    refuse("time [s],3X.x_s [m],3X.n_ffw [rad/s]\n", "line 1, column 2", "an axis name is a letter");
    refuse("time [s],a.b.x_s [m],a.b.n_ffw [rad/s]\n", "line 1, column 2", "an axis name is a letter");
    refuse("time [s],\xC3\xA4.x_s [m],\xC3\xA4.n_ffw [rad/s]\n", "line 1, column 2", "an axis name is a letter");
    refuse("time [s],A2345678901234567890123456789012.x_s [m],y\n", "line 1, column 2", "at most 30 letters");
    refuse("time [s],X.x_s [m],X.n_ffw [rad/s],X.x_s [m],X.n_ffw [rad/s]\n", "line 1, column 4", "appears twice");
    refuse("time [s],X.x_s [m],X.n_ffw [rad/s],\n", "line 1, column 4", "'': expected is the position");
}

static void test_faults_of_rows(void) {
    refuse(HEADER, "t.csv", "0 rows; at least two");
    refuse(HEADER "0,1,2,3,4\n", "t.csv", "1 rows; at least two");
    refuse(HEADER ROWS "0.003,1,2,3\n", "line 5", "a row has 5 cells, this one has 4");
    refuse(HEADER ROWS "0.003,1,2,3,4,5\n", "line 5", "this one has 6");
    refuse(HEADER "0,1,2,3,4\n\n0.001,1,nan,3,4\n", "line 4", "X.n_ffw [rad/s] is 'nan', which is no finite number");
    refuse(HEADER "0,1,2,3,inf\n", "line 2", "Z_2.n_ffw [rad/s] is 'inf'");
    refuse(HEADER "0,1e999,2,3,4\n", "line 2", "X.x_s [m] is '1e999'");
    refuse(HEADER "0,1,2,,4\n", "line 2", "Z_2.x_s [m] is ''");
    refuse(HEADER "0,1,2,0x10,4\n", "line 2", "Z_2.x_s [m] is '0x10'");
    refuse(HEADER "0;1;2;3;4\n", "line 2", "time [s] is '0;1;2;3;4'");
    refuse(HEADER "nan,1,2,3,4\n", "line 2", "time [s] is 'nan'");
    refuse(HEADER ROWS "0.002,1,2,3,4\n", "line 5", "is 0.002, the row before has 0.002; times must rise");
    refuse(HEADER "0,1,2,3,4\n-0.001,1,2,3,4\n", "line 3", "times must rise");
    refuse(HEADER ROWS "0.0031,1,2,3,4\n", "line 5", "is 0.0031, the row before has 0.002; rows must be even in time");
    refuse(HEADER ROWS "0.0030001,1,2,3,4\n", "line 5", "the first two are 0.001 s apart");
    refuse(HEADER ROWS "0.004,1,2,3,4\n", "line 5", "rows must be even in time"); /* one is missing */
}

static void test_span_that_is_no_number(void) {
    refuse(HEADER "-1e308,1,2,3,4\n1e308,1,2,3,4\n", "t.csv: the times run from -1e+308 s to 1e+308 s",
           "no finite number");
    refuse(HEADER "-1e308,1,2,3,4\n0,1,2,3,4\n1e308,1,2,3,4\n", "t.csv", "no finite number");
}

static void test_most_axes(void) {
    static char text[64 * (SETPOINT_AXES_MOST + 2)];
    static SetpointAxis many[SETPOINT_AXES_MOST];
    size_t axes = 0;
    snprintf(text, sizeof text, "time [s]");
    for (int i = 0; i < SETPOINT_AXES_MOST; i++) {
        snprintf(text + strlen(text), sizeof text - strlen(text), ",A%d.x_s [m],A%d.n_ffw [rad/s]", i, i);
    }
    CHECK(setpoints_read_axes(text, strlen(text), "t.csv", many, &axes, message, sizeof message));
    CHECK(axes == SETPOINT_AXES_MOST);
    snprintf(text + strlen(text), sizeof text - strlen(text), ",B.x_s [m],B.n_ffw [rad/s]");
    CHECK(!setpoints_read_axes(text, strlen(text), "t.csv", many, &axes, message, sizeof message));
    CHECK_CONTAINS(message, "t.csv, line 1, column 514: 'B.x_s [m]': these are more axes than the 256");
}

/* Each row is a millionth late against the one before: nothing to see from row to row, but they add up. */
static void test_drift(void) {
    char text[4000] = "time [s],X.x_s [m],X.n_ffw [rad/s]\n";
    double time = 0, cycle = 1e-3;
    for (int i = 0; i < 50; i++, time += cycle, cycle *= 1 + 1e-8) {
        snprintf(text + strlen(text), sizeof text - strlen(text), "%.17g,1,2\n", time);
    }
    refuse(text, "t.csv: the time of row", "allowed is a millionth of the cycle");
}

static size_t at(double t, double h) {
    return setpoints_row(&table, t, setpoints_slack(&table, t, h));
}

static void test_row(void) {
    CHECK(read(HEADER ROWS));
    CHECK(at(0, INFINITY) == 0);
    CHECK(at(0.0005, 1e-4) == 0);
    CHECK(at(0.0009, 1e-4) == 0);
    CHECK(at(0.001, 1e-4) == 1);
    CHECK(at(0.0009999999999, 1e-4) == 1); /* an importer's rounding */
    CHECK(at(0.000999999, 1e-3) == 1);     /* a clock in whole nanoseconds, as in three steps of a third of 1 ms */
    CHECK(at(0.00099, 1e-5) == 0);
    CHECK(at(0.000999, 1e-6) == 0);
    CHECK(at(0.0009999, 1e-7) == 0); /* smaller steps than anybody takes are told apart, too */
    CHECK(at(0.0019999999999, 1e-4) == 2);
    CHECK(at(0.002, 1e-4) == 2);
    CHECK(at(5, 1e-4) == 2); /* held */
    CHECK(at(1e300, 1e-4) == 2);
    CHECK(setpoints_row(&table, -1, 0) == 0);
    CHECK(setpoints_row(&table, -1e300, 0) == 0);
    /* a late start: the time of the experiment is large, the one since its start small */
    CHECK(setpoints_row(&table, 0.000999999, setpoints_slack(&table, 1000.000999999, 125e-6)) == 1);
    CHECK(setpoints_row(&table, 0.000998, setpoints_slack(&table, 1000.000998, 1e-6)) == 0);
    /* steps that end between rows, after starts that are late */
    const double starts[] = {0, 1000, 86400, 31557600};
    for (size_t i = 0; i < sizeof starts / sizeof *starts; i++) {
        const double end = starts[i] + 0.00095;
        CHECK(setpoints_row(&table, end - starts[i], setpoints_slack(&table, end, end - starts[i])) == 0);
        CHECK(setpoints_row(&table, end - starts[i], setpoints_slack(&table, end, 10)) == 0);
    }
    /* no slack is as much as a noticeable part of a step or of a cycle, at any time */
    for (double t = 1e-6; t < 1e12; t *= 10) {
        CHECK(setpoints_slack(&table, t, 1e-5) <= fmax(0.01 * 1e-5, 16 * DBL_EPSILON * t));
        CHECK(setpoints_slack(&table, t, 10) <= fmax(1e-5, 16 * DBL_EPSILON * t));
        CHECK(setpoints_slack(&table, t, 10) >= 16 * DBL_EPSILON * t);
    }
    /* 1 ns short, by a clock in whole nanoseconds, of a row of a shorter cycle */
    const Setpoints quick = {.axes = 1, .width = 3, .rows = 100, .cycle = 1e-4};
    CHECK(setpoints_row(&quick, 99999e-9, setpoints_slack(&quick, 99999e-9, 33333e-9)) == 1);
    CHECK(setpoints_row(&quick, 99e-6, setpoints_slack(&quick, 99e-6, 33e-6)) == 0);
}

static void test_first_row_at_another_time(void) {
    CHECK(read("time [s],X.x_s [m],X.n_ffw [rad/s]\n0.5,1,2\n0.6,3,4\n0.7,5,6\n"));
    CHECK(at(0, 1e-3) == 0);
    CHECK(at(0.59, 1e-3) == 0);
    CHECK(at(0.6, 1e-3) == 1);
    CHECK(read("time [s],X.x_s [m],X.n_ffw [rad/s]\n-0.2,1,2\n-0.1,3,4\n0,5,6\n0.1,7,8\n"));
    CHECK(at(0, INFINITY) == 2);
    CHECK(at(0.1, 0.1) == 3);
}

/* Every row of a long table with a cycle that no binary number is, at k T as importers compute it. */
static void test_every_row(void) {
    table = (Setpoints){.axes = 1, .width = 3, .rows = 3600001, .first = 0, .cycle = 0.001};
    size_t wrong = 0;
    double sum = 0;
    for (size_t k = 1; k < table.rows; k++) {
        const double exact = (double)k * 0.001, before = exact - 125e-6;
        sum += 0.001;
        wrong += at(exact, 125e-6) != k;
        wrong += at(sum, 1e-3) != k;
        wrong += at(before, 125e-6) != k - 1;
        wrong += at(exact - 1e-6, 1e-6) != k - 1;
    }
    CHECK(wrong == 0);
}

int main(void) {
    test_reading();
    test_faults_of_the_header();
    test_faults_of_rows();
    test_span_that_is_no_number();
    test_most_axes();
    test_drift();
    test_row();
    test_first_row_at_another_time();
    test_every_row();
    return CHECK_RESULT;
}

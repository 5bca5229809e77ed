/* Mode and axis tables (src/plant_fmu/modes.c, axes.c, src/fmi2/csv.c): what is read, and what every fault is answered
 * with. */
#include <locale.h>
#include <stdlib.h>
#include <string.h>

#include "axes.h"
#include "check.h"
#include "csv.h"
#include "modes.h"

#define HEADER "mode,frequency [Hz],damping ratio [1],n_X,n_Z,x_X,x_Z,tcp_X,tcp_Y,tcp_Z\n"
#define ROW_0 "0,0,0,1,2,3,4,5,6,7\n"
#define ROW_1 "1,21.5,0.02,-1.5e-3,2,3,4,5,6,7\n"

enum { AXES = 2, WIDTH = 2 + 2 * AXES + 3, CAPACITY = 10 };
static const char *const AXIS_NAMES[AXES] = {"X", "Z"};

static void refuse_axes(const char *text, const char *where, const char *what);

static double values[CAPACITY * WIDTH];
static size_t modes;
static char message[300];

static bool read(const char *text) {
    memset(values, 0, sizeof values);
    modes = 0;
    message[0] = '\0';
    CHECK(modes_width(AXES) == WIDTH && modes_capacity(text, strlen(text)) <= CAPACITY);
    return modes_read(text, strlen(text), "table.csv", AXES, AXIS_NAMES, values, &modes, message, sizeof message);
}

static void refuse(const char *text, const char *where, const char *what) {
    CHECK(!read(text));
    CHECK_CONTAINS(message, "table.csv");
    CHECK_CONTAINS(message, where);
    CHECK_CONTAINS(message, what);
}

/* frequency, damping, n_X, n_Z, tcp_X, tcp_Y, tcp_Z, x_X, x_Z */
static const double EXPECTED[2 * WIDTH] = {0, 0, 1, 2, 5, 6, 7, 3, 4, 21.5, 0.02, -1.5e-3, 2, 5, 6, 7, 3, 4};

static void check_expected(const char *text) {
    CHECK(read(text));
    CHECK_TEXT(message, "");
    CHECK(modes == 2);
    for (int i = 0; i < 2 * WIDTH; i++) {
        CHECK_EQUAL(values[i], EXPECTED[i]);
    }
}

static void good_tables(void) {
    check_expected(HEADER ROW_0 ROW_1);
    check_expected("\xEF\xBB\xBF" HEADER ROW_0 ROW_1); /* byte-order mark */
    check_expected("mode,frequency [Hz],damping ratio [1],n_X,n_Z,x_X,x_Z,tcp_X,tcp_Y,tcp_Z\r\n"
                   "0,0,0,1,2,3,4,5,6,7\r\n1,21.5,0.02,-1.5e-3,2,3,4,5,6,7\r\n");
    check_expected("\n" HEADER "\n" ROW_0 "  \n" ROW_1 "\n\n");     /* blank lines */
    check_expected(HEADER ROW_0 "1,21.5,0.02,-1.5e-3,2,3,4,5,6,7"); /* no newline at the end */
    check_expected(HEADER ROW_0 "1 ,\t21.5 , 2.0E-02,-.0015,+2,3.,4,5,6,7\n");
    check_expected("tcp_Z,tcp_X,tcp_Y,x_Z,x_X,n_Z,n_X,damping ratio [1],frequency [Hz],mode\n"
                   "7,5,6,4,3,2,1,0,0,0\n7,5,6,4,3,2,-1.5e-3,0.02,21.5,1\n"); /* columns in any order */
    CHECK(read(HEADER "0,0,0,1,1,1,1,0,0,0\n"));   /* the tool may stand still: a single axis on a bench */
    CHECK(read(HEADER "0,5,3.5,1,1,1,1,0,0,0\n")); /* over-damped */
}

static void faults_of_the_header(void) {
    refuse("", "table.csv: ", "the table is empty");
    refuse("\xEF\xBB\xBF\r\n", "table.csv: ", "the table is empty");
    refuse(HEADER, "table.csv: ", "no mode");
    refuse("mode,frequency [Hz],n_X,n_Z,x_X,x_Z,tcp_X,tcp_Y,tcp_Z\n", "line 1", "'damping ratio [1]' is missing");
    refuse("frequency [Hz],damping ratio [1],n_X,n_Z,x_X,x_Z,tcp_X,tcp_Y,tcp_Z\n", "line 1", "'mode' is missing");
    refuse("mode,frequency [Hz],damping ratio [1],n_X,x_X,x_Z,tcp_X,tcp_Y,tcp_Z\n", "line 1", "'n_Z' is missing");
    refuse("mode,frequency [Hz],damping ratio [1],n_X,n_Z,x_X,x_Z,tcp_X,tcp_Y\n", "line 1", "'tcp_Z' is missing");
    refuse("\nmode,n_X,frequency [Hz],damping ratio [1],n_X,n_Z,x_X,x_Z,tcp_X,tcp_Y,tcp_Z\n", "line 2",
           "'n_X' appears twice");
    refuse("mode,frequency [Hz],damping ratio [1],n_X,n_Z,n_B,x_X,x_Z,x_B,tcp_X,tcp_Y,tcp_Z\n", "line 1",
           "'n_B' is a port of an axis that the archive does not have; it has X, Z");
    refuse("mode,frequency [rad/s],damping ratio [1],n_X\n", "line 1", "'frequency [rad/s]' is unknown");
    refuse("mode;frequency [Hz];damping ratio [1];n_X\n", "line 1", "separated by commas");
}

static void faults_of_a_row(void) {
    refuse(HEADER ROW_0 "1,nan,0.02,1,2,3,4,5,6,7\n", "line 3", "'frequency [Hz]': 'nan' is no finite number");
    refuse(HEADER ROW_0 "1,20,inf,1,2,3,4,5,6,7\n", "line 3", "'damping ratio [1]': 'inf'");
    refuse(HEADER "0,0,0,1e999,2,3,4,5,6,7\n", "line 2", "'n_X': '1e999'");
    refuse(HEADER "0,0,0,1,2,three,4,5,6,7\n", "line 2", "'x_X': 'three'");
    refuse(HEADER "0,0,0,1,2,,4,5,6,7\n", "line 2", "'x_X': ''");
    refuse(HEADER "0,0,0,1,2,0x10,4,5,6,7\n", "line 2", "'x_X': '0x10'");
    refuse(HEADER "0,0,0,1,2,3 4,4,5,6,7\n", "line 2", "'x_X': '3 4'");
    refuse(HEADER "first,0,0,1,2,3,4,5,6,7\n", "line 2", "'mode': 'first'");
    refuse(HEADER ROW_0 "1,-20,0.02,1,2,3,4,5,6,7\n", "line 3", "'frequency [Hz]' is -20; it must not be negative");
    refuse(HEADER ROW_0 "1,20,-0.02,1,2,3,4,5,6,7\n", "line 3",
           "'damping ratio [1]' is -0.02; it must not be negative");
    refuse(HEADER "0,0,0.02,1,2,3,4,5,6,7\n", "line 2", "'damping ratio [1]' is 0.02 at frequency 0 Hz");
    refuse(HEADER "0,0,0,1,2,3,4,5,6\n", "line 2", "the row has 9 cells, the header has 10");
    refuse(HEADER "0,0,0,1,2,3,4,5,6,7,8\n", "line 2", "the row has 11 cells");
    refuse(HEADER "0,0,0,1,0,3,4,5,6,7\n1,20,0.02,1,0,3,4,5,6,7\n", "table.csv: ", "'n_Z' is 0 in every row");
    refuse(HEADER "0,0,0,1,2,0,4,5,6,7\n", "table.csv: ", "'x_X' is 0 in every row");
}

/* A cell is repeated up to 40 bytes, and no character is cut in two. */
static void messages_keep_characters_whole(void) {
#define A39 "aaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaa"
    refuse(HEADER "0,0,0," A39 "\xC3\xA4xyz,2,3,4,5,6,7\n", "line 2", "'n_X': '" A39 "' is");
    refuse(HEADER "0,0,0,a" A39 "\xC3\xA4xyz,2,3,4,5,6,7\n", "line 2", "'n_X': 'a" A39 "' is");
    refuse(HEADER "0,0,0,\xC3\xA4"
                  "aaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaa\xE2\x82\xAC,2,3,4,5,6,7\n",
           "line 2",
           "'n_X': '\xC3\xA4"
           "aaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaa' is");
    refuse(A39 "\xC3\xA4,frequency [Hz]\n", "line 1", "column '" A39 "' is unknown");
    refuse_axes("axis,x_0 [m]\n" A39 "\xC3\xA4,1\n", "line 2", "'" A39 "': column 'axis'");
#undef A39
}

static void messages_fit(void) {
    char small[24];
    memset(small, '#', sizeof small);
    CHECK(!modes_read(HEADER, strlen(HEADER), "a/rather/long/path/of/a/table.csv", AXES, AXIS_NAMES, values, &modes,
                      small, sizeof small));
    CHECK(strlen(small) == sizeof small - 1);
}

/* A byte of value zero in the middle ends no table: it is a fault of its cell. */
static void zero_bytes(void) {
    const char text[] = HEADER "0,0,0,1,2,3\0,4,5,6,7\n";
    CHECK(!modes_read(text, sizeof text - 1, "table.csv", AXES, AXIS_NAMES, values, &modes, message, sizeof message));
    CHECK_CONTAINS(message, "line 2: column 'x_X'");
}

static void numbers_ignore_the_locale(void) {
    static const char *const with_comma[] = {"de_DE.UTF-8", "de_AT.UTF-8", "fr_FR.UTF-8", "de_DE", "German"};
    for (size_t i = 0; i < sizeof with_comma / sizeof with_comma[0]; i++) {
        if (setlocale(LC_ALL, with_comma[i]) != NULL) {
            check_expected(HEADER ROW_0 ROW_1);
        }
    }
    setlocale(LC_ALL, "C");
}

/* --- axes --------------------------------------------------------------------------------------------------------- */

static AxisRow axis_rows[CAPACITY];
static size_t axes;

static bool read_axes(const char *text) {
    axes = 0;
    message[0] = '\0';
    CHECK(axes_capacity(text, strlen(text)) <= CAPACITY);
    return axes_read(text, strlen(text), "axes.csv", axis_rows, &axes, message, sizeof message);
}

static void refuse_axes(const char *text, const char *where, const char *what) {
    CHECK(!read_axes(text));
    CHECK_CONTAINS(message, where);
    CHECK_CONTAINS(message, what);
}

static void axis_tables(void) {
    CHECK(read_axes("\xEF\xBB\xBF"
                    "axis , x_0 [m]\r\n X,0.8\r\n\r\nZ_1 ,-1e-1\r\n"));
    CHECK(axes == 2);
    CHECK_TEXT(axis_rows[0].name, "X");
    CHECK_TEXT(axis_rows[1].name, "Z_1");
    CHECK_EQUAL(axis_rows[0].x_0, 0.8);
    CHECK_EQUAL(axis_rows[1].x_0, -0.1);
    refuse_axes("", "axes.csv: ", "header axis,x_0 [m]");
    refuse_axes("x_0 [m],axis\nX,1\n", "axes.csv: ", "header axis,x_0 [m]");
    refuse_axes("axis,x_0 [m]\n", "axes.csv: ", "no axis");
    refuse_axes("axis,x_0 [m]\nX,0.8\nX,0.1\n", "line 3", "'X,0.1': column 'axis': the name appears twice");
    refuse_axes("axis,x_0 [m]\nX,zero\n", "line 2", "'x_0 [m]' is no finite number");
    refuse_axes("axis,x_0 [m]\nX,inf\n", "line 2", "'x_0 [m]' is no finite number");
    refuse_axes("axis,x_0 [m]\nX\n", "line 2", "two cells");
    refuse_axes("axis,x_0 [m]\nX,1,2\n", "line 2", "two cells");
    refuse_axes("axis,x_0 [m]\n1X,1\n", "line 2", "begins with no digit");
    refuse_axes("axis,x_0 [m]\nX.1,1\n", "line 2", "letters, digits and _");
    refuse_axes("axis,x_0 [m]\ntool,1\n", "line 2", "is not tool, tcp or pose");
    refuse_axes("axis,x_0 [m]\nan_axis_whose_name_is_far_too_long,1\n", "line 2", "at most 31");
}

static void most_axes(void) {
    static char text[16 * (AXES_MOST + 3)];
    static AxisRow many[AXES_MOST];
    size_t count = 0;
    snprintf(text, sizeof text, "axis,x_0 [m]\n");
    for (int i = 0; i < AXES_MOST; i++) {
        snprintf(text + strlen(text), sizeof text - strlen(text), "A%d,%d\n", i, i);
    }
    CHECK(axes_read(text, strlen(text), "axes.csv", many, &count, message, sizeof message));
    CHECK(count == AXES_MOST);
    snprintf(text + strlen(text), sizeof text - strlen(text), "B,0\n");
    CHECK(!axes_read(text, strlen(text), "axes.csv", many, &count, message, sizeof message));
    CHECK_CONTAINS(message, "axes.csv, line 258: 'B,0': these are more axes than the 256");
}

/* A cell may be longer than an int counts; its length must not be cut off on the way. */
static void cells_have_any_length(void) {
    CsvCell cell;
    CHECK(sizeof cell.length == sizeof(size_t));
}

int main(void) {
    good_tables();
    faults_of_the_header();
    faults_of_a_row();
    messages_keep_characters_whole();
    messages_fit();
    zero_bytes();
    numbers_ignore_the_locale();
    axis_tables();
    most_axes();
    cells_have_any_length();
    return CHECK_RESULT;
}

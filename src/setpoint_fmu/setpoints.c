#include "setpoints.h"

#include <float.h>
#include <limits.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "csv.h"
#include "numbers.h"
#include "text.h"

#define UNEVEN 1e-6 /* of the cycle: times that were written with all their digits are even far better than that */

enum { SHOWN = 40 }; /* characters of a faulty cell in a message */

#define SETPOINTS_QUOTED(number) #number
#define SETPOINTS_TEXT(number) SETPOINTS_QUOTED(number)

static const char *const suffixes[] = {".x_s [m]", ".n_ffw [rad/s]"};

/* --- header */

size_t setpoints_axes_capacity(const char *text, size_t size) {
    Csv csv = csv_open(text, size);
    CsvRow row;
    return csv_next_row(&csv, &row) ? csv_cells(row) / 2 + 1 : 1;
}

/* ASCII only, whatever the locale: the name becomes the first part of FMI variable names. */
static bool setpoints_letter(char c) {
    return (c >= 'A' && c <= 'Z') || (c >= 'a' && c <= 'z');
}

static bool setpoints_legal_name(const char *text, size_t length) {
    if (length < 1 || length >= SETPOINT_NAME_SIZE || !setpoints_letter(text[0])) {
        return false;
    }
    for (size_t i = 1; i < length; i++) {
        if (!setpoints_letter(text[i]) && text[i] != '_' && !(text[i] >= '0' && text[i] <= '9')) {
            return false;
        }
    }
    return true;
}

/* Length of the axis name that `cell` has ahead of `suffix`; 0 where it does not end so. */
static size_t setpoints_name_length(CsvCell cell, const char *suffix) {
    const size_t length = cell.length, tail = strlen(suffix);
    return length > tail && memcmp(cell.text + length - tail, suffix, tail) == 0 ? length - tail : 0;
}

/* The fault of an axis's first column, or NULL after its name was entered as that of axis `count`. */
static const char *setpoints_read_name(CsvCell cell, SetpointAxis *names, size_t count) {
    const size_t length = setpoints_name_length(cell, suffixes[0]);
    if (length == 0) {
        return "expected is the position setpoint of an axis, as X.x_s [m]";
    }
    if (count == SETPOINT_AXES_MOST) {
        return "these are more axes than the " SETPOINTS_TEXT(SETPOINT_AXES_MOST) " that a table may have";
    }
    if (!setpoints_legal_name(cell.text, length)) {
        return "an axis name is a letter followed by at most 30 letters, digits or _";
    }
    memcpy(names[count], cell.text, length);
    names[count][length] = '\0';
    for (size_t i = 0; i < count; i++) {
        if (strcmp(names[i], names[count]) == 0) {
            return "the axis appears twice";
        }
    }
    return NULL;
}

/* The fault of an axis's second column, or NULL. */
static const char *setpoints_match_name(CsvCell cell, const char *name) {
    const size_t length = setpoints_name_length(cell, suffixes[1]);
    const bool same = length == strlen(name) && memcmp(cell.text, name, length) == 0;
    return same ? NULL : "expected is the speed feedforward of the axis before it, as X.n_ffw [rad/s]";
}

bool setpoints_read_axes(const char *text, size_t size, const char *source, SetpointAxis *names, size_t *axes,
                         char *message, size_t message_size) {
    Csv csv = csv_open(text, size);
    CsvRow row;
    CsvCell cell;
    if (!csv_next_row(&csv, &row) || !csv_next_cell(&row, &cell) || !csv_equal(cell, "time [s]")) {
        snprintf(message, message_size,
                 "%s: the table must begin with the header time [s],X.x_s [m],X.n_ffw [rad/s],... (a pair of columns "
                 "per axis)",
                 source);
        return false;
    }
    size_t column = 1;
    const char *fault = NULL;
    while (fault == NULL && csv_next_cell(&row, &cell)) {
        const size_t axis = (column - 1) / 2;
        fault = column % 2 == 1 ? setpoints_read_name(cell, names, axis) : setpoints_match_name(cell, names[axis]);
        column++;
    }
    if (fault != NULL) {
        const int shown = (int)text_whole(cell.text, cell.length, SHOWN);
        snprintf(message, message_size, "%s, line %u, column %lu: '%.*s': %s", source, csv.line, (unsigned long)column,
                 shown, cell.text, fault);
        return false;
    }
    if (column == 1 || column % 2 == 0) {
        snprintf(message, message_size, "%s, line %u: %s%s", source, csv.line,
                 column == 1 ? "there is no axis" : names[(column - 2) / 2],
                 column == 1 ? "; expected is time [s],X.x_s [m],X.n_ffw [rad/s],..."
                             : ".n_ffw [rad/s] is missing; every axis has two columns");
        return false;
    }
    *axes = (column - 1) / 2;
    return true;
}

/* --- rows */

size_t setpoints_rows_capacity(const char *text, size_t size) {
    return csv_lines(text, size);
}

/* Name of a column for messages, written to text[column_size]. */
static void setpoints_column(const char *header, size_t size, size_t column, char *text, size_t text_size) {
    Csv csv = csv_open(header, size);
    CsvRow row;
    CsvCell cell = {"", 0};
    csv_next_row(&csv, &row);
    for (size_t i = 0; i <= column && csv_next_cell(&row, &cell); i++) {
    }
    snprintf(text, text_size, "%.*s", (int)cell.length, cell.text); /* short: the header was read */
}

/* Allowed distance from an even time at t: what is written of it, and its rounding to a double. */
static double setpoints_uneven(double cycle, double t) {
    return UNEVEN * cycle + 4 * DBL_EPSILON * fabs(t);
}

/* The fault of the time of row `count`, described in `message`; the rows before it are sound. */
static bool setpoints_check_time(const Setpoints *table, size_t count, const char *source, unsigned line, char *message,
                                 size_t message_size) {
    char text[4][NUMBER_TEXT_SIZE];
    if (count == 0) {
        return true;
    }
    const double *row = table->values + count * table->width;
    const double time = *row, before = *(row - table->width), step = time - before;
    if (!(step > 0)) {
        snprintf(message, message_size, "%s, line %u: time [s] is %s, the row before has %s; times must rise", source,
                 line, number_text(text[0], time), number_text(text[1], before));
        return false;
    }
    const double cycle = table->values[table->width] - table->values[0];
    if (fabs(step - cycle) > 2 * setpoints_uneven(cycle, time)) {
        snprintf(
            message, message_size,
            "%s, line %u: time [s] is %s, the row before has %s; rows must be even in time to a millionth, and the "
            "first two are %s s apart",
            source, line, number_text(text[0], time), number_text(text[1], before), number_text(text[2], cycle));
        return false;
    }
    return true;
}

static bool setpoints_read_row(CsvRow row, const char *text, size_t size, const char *source, unsigned line,
                               const Setpoints *table, size_t count, char *message, size_t message_size) {
    double *values = table->values + count * table->width;
    const CsvRow whole = row;
    CsvCell cell;
    size_t column = 0;
    for (; csv_next_cell(&row, &cell); column++) {
        if (column < table->width && !csv_number(cell, &values[column])) {
            char name[SETPOINT_NAME_SIZE + 16];
            setpoints_column(text, size, column, name, sizeof name);
            const int shown = (int)text_whole(cell.text, cell.length, SHOWN);
            snprintf(message, message_size, "%s, line %u: %s is '%.*s', which is no finite number with a decimal point",
                     source, line, name, shown, cell.text);
            return false;
        }
    }
    if (column != table->width) {
        const int shown = (int)text_whole(whole.at, (size_t)(whole.end - whole.at), SHOWN);
        snprintf(message, message_size, "%s, line %u: '%.*s': a row has %lu cells, this one has %lu", source, line,
                 shown, whole.at, (unsigned long)table->width, (unsigned long)column);
        return false;
    }
    return setpoints_check_time(table, count, source, line, message, message_size);
}

static bool setpoints_check_span(const Setpoints *table, const char *source, char *message, size_t message_size) {
    if (!isfinite(table->cycle)) {
        char text[2][NUMBER_TEXT_SIZE];
        const double last = table->values[(table->rows - 1) * table->width];
        snprintf(message, message_size, "%s: the times run from %s s to %s s, a span that is no finite number", source,
                 number_text(text[0], table->first), number_text(text[1], last));
        return false;
    }
    return true;
}

/* Row by row the distances are even; their small differences must not add up. */
static bool setpoints_check_drift(const Setpoints *table, const char *source, char *message, size_t message_size) {
    for (size_t i = 0; i < table->rows; i++) {
        const double time = table->values[i * table->width], even = table->first + (double)i * table->cycle;
        if (fabs(time - even) > setpoints_uneven(table->cycle, fmax(fabs(table->first), fabs(time)))) {
            char text[2][NUMBER_TEXT_SIZE];
            snprintf(
                message, message_size,
                "%s: the time of row %.0f is %s s, rows even in time would have it at %s s; allowed is a millionth "
                "of the cycle (times must be written with all their digits)",
                source, (double)i + 1, number_text(text[0], time), number_text(text[1], even));
            return false;
        }
    }
    return true;
}

bool setpoints_read_rows(const char *text, size_t size, const char *source, Setpoints *table, char *message,
                         size_t message_size) {
    Csv csv = csv_open(text, size);
    CsvRow row;
    size_t count = 0;
    table->width = 1 + 2 * table->axes;
    csv_next_row(&csv, &row); /* the header */
    while (csv_next_row(&csv, &row)) {
        if (!setpoints_read_row(row, text, size, source, csv.line, table, count, message, message_size)) {
            return false;
        }
        count++;
    }
    if (count < 2 || count > INT_MAX) { /* the row in use is an FMI Integer */
        snprintf(message, message_size, "%s: the table has %.0f rows; at least two are needed, at most %d are allowed",
                 source, (double)count, INT_MAX);
        return false;
    }
    table->rows = count;
    table->first = table->values[0];
    table->cycle = (table->values[(count - 1) * table->width] - table->first) / (double)(count - 1);
    return setpoints_check_span(table, source, message, message_size) &&
           setpoints_check_drift(table, source, message, message_size);
}

/* --- look-up */

/* Of two numbers; fmax() and fmin() think of what is none, and are calls. */
static inline double larger(double a, double b) {
    return a > b ? a : b;
}

static inline double smaller(double a, double b) {
    return a < b ? a : b;
}

double setpoints_slack(const Setpoints *table, double t, double h) {
    const double rounding = larger(larger(1e-9 * fabs(t), 2e-9), 2 * UNEVEN * table->cycle);
    return larger(16 * DBL_EPSILON * fabs(t), smaller(rounding, 0.01 * smaller(h, table->cycle)));
}

size_t setpoints_row(const Setpoints *table, double elapsed, double slack) {
    const double position = (elapsed - table->first + slack) / table->cycle;
    if (!(position > 0)) {
        return 0;
    }
    return position < (double)(table->rows - 1) ? (size_t)position : table->rows - 1;
}

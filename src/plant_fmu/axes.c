#include "axes.h"

#include <stdio.h>
#include <string.h>

#include "csv.h"
#include "text.h"

#define AXES_QUOTED(number) #number
#define AXES_TEXT(number) AXES_QUOTED(number)

size_t axes_capacity(const char *text, size_t size) {
    return csv_lines(text, size);
}

/* ASCII only, whatever the locale: the name becomes the first part of FMI variable names. */
static bool axes_letter(char c) {
    return (c >= 'A' && c <= 'Z') || (c >= 'a' && c <= 'z') || c == '_';
}

static bool axes_legal_name(CsvCell cell) {
    if (cell.length < 1 || cell.length >= AXIS_NAME_SIZE || !axes_letter(cell.text[0])) {
        return false;
    }
    for (size_t i = 1; i < cell.length; i++) {
        const char c = cell.text[i];
        if (!axes_letter(c) && !(c >= '0' && c <= '9')) {
            return false;
        }
    }
    return !csv_equal(cell, "tool") && !csv_equal(cell, "tcp") && !csv_equal(cell, "pose");
}

/* The fault of a row, or NULL after it was entered as row `count`. */
static const char *axes_read_row(CsvRow row, AxisRow *rows, size_t count) {
    CsvCell name, x_0;
    if (csv_cells(row) != 2) {
        return "a row has two cells, axis and x_0 [m], separated by a comma";
    }
    csv_next_cell(&row, &name);
    csv_next_cell(&row, &x_0);
    if (count == AXES_MOST) {
        return "these are more axes than the " AXES_TEXT(AXES_MOST) " that a machine may have";
    }
    if (!axes_legal_name(name)) {
        return "column 'axis': a name has letters, digits and _, at most 31, begins with no digit, and is not tool, "
               "tcp or pose";
    }
    for (size_t i = 0; i < count; i++) {
        if (csv_equal(name, rows[i].name)) {
            return "column 'axis': the name appears twice";
        }
    }
    if (!csv_number(x_0, &rows[count].x_0)) {
        return "column 'x_0 [m]' is no finite number with a decimal point";
    }
    memcpy(rows[count].name, name.text, name.length);
    rows[count].name[name.length] = 0;
    return NULL;
}

bool axes_read(const char *text, size_t size, const char *source, AxisRow *rows, size_t *axes, char *message,
               size_t message_size) {
    Csv csv = csv_open(text, size);
    CsvRow row;
    CsvCell axis, x_0;
    const bool header = csv_next_row(&csv, &row) && csv_cells(row) == 2 && csv_next_cell(&row, &axis) &&
                        csv_next_cell(&row, &x_0) && csv_equal(axis, "axis") && csv_equal(x_0, "x_0 [m]");
    if (!header) {
        snprintf(message, message_size, "%s: the table must begin with the header axis,x_0 [m]", source);
        return false;
    }
    size_t count = 0;
    while (csv_next_row(&csv, &row)) {
        const char *fault = axes_read_row(row, rows, count);
        if (fault != NULL) {
            const int shown = (int)text_whole(row.at, (size_t)(row.end - row.at), 40);
            snprintf(message, message_size, "%s, line %u: '%.*s': %s", source, csv.line, shown, row.at, fault);
            return false;
        }
        count++;
    }
    if (count == 0) {
        snprintf(message, message_size, "%s: the table has a header but no axis; at least one row is needed", source);
        return false;
    }
    *axes = count;
    return true;
}

#include "modes.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "csv.h"
#include "numbers.h"
#include "text.h"

#define CELL_SHOWN 40 /* bytes of a cell that a message repeats, fewer where that would divide a character */
#define HEADER_SIZE 80

static const char *const directions[TOOL_DIRECTIONS] = {"X", "Y", "Z"};

/* What is read, and where complaints go. */
typedef struct ModesReader {
    const char *source;
    size_t axes, width;
    const char *const *axis_names;
    char *message;
    size_t message_size;
} ModesReader;

#ifdef __GNUC__
__attribute__((format(printf, 3, 4)))
#endif
static bool modes_fail(const ModesReader *reader, unsigned line, const char *format, ...) {
    const int length = line > 0 ? snprintf(reader->message, reader->message_size, "%s, line %u: ", reader->source, line)
                                : snprintf(reader->message, reader->message_size, "%s: ", reader->source);
    if (length >= 0 && (size_t)length < reader->message_size) {
        va_list arguments;
        va_start(arguments, format);
        vsnprintf(reader->message + length, reader->message_size - (size_t)length, format, arguments);
        va_end(arguments);
    }
    return false;
}

static int modes_shown(CsvCell cell) {
    return (int)text_whole(cell.text, cell.length, CELL_SHOWN);
}

size_t modes_width(size_t axes) {
    return MODES_SHAPES + 2 * axes + TOOL_DIRECTIONS;
}

size_t modes_capacity(const char *text, size_t size) {
    return csv_lines(text, size);
}

/* Header of a column of values; the column behind the last stands for the mode's number, which is read for form only.
 */
static const char *modes_header(const ModesReader *reader, size_t column, char header[HEADER_SIZE]) {
    const size_t axes = reader->axes;
    if (column == MODES_FREQUENCY) {
        snprintf(header, HEADER_SIZE, "frequency [Hz]");
    } else if (column == MODES_DAMPING) {
        snprintf(header, HEADER_SIZE, "damping ratio [1]");
    } else if (column < MODES_SHAPES + axes) {
        snprintf(header, HEADER_SIZE, "n_%s", reader->axis_names[column - MODES_SHAPES]);
    } else if (column < MODES_SHAPES + axes + TOOL_DIRECTIONS) {
        snprintf(header, HEADER_SIZE, "tcp_%s", directions[column - MODES_SHAPES - axes]);
    } else if (column < reader->width) {
        snprintf(header, HEADER_SIZE, "x_%s", reader->axis_names[column - MODES_SHAPES - axes - TOOL_DIRECTIONS]);
    } else {
        snprintf(header, HEADER_SIZE, "mode");
    }
    return header;
}

/* Column that a header cell names; beyond width: none. */
static size_t modes_column(const ModesReader *reader, CsvCell cell) {
    char header[HEADER_SIZE];
    size_t column = 0;
    while (column <= reader->width && !csv_equal(cell, modes_header(reader, column, header))) {
        column++;
    }
    return column;
}

static bool modes_fail_unknown(const ModesReader *reader, unsigned line, CsvCell cell) {
    if (cell.length > 2 && (strncmp(cell.text, "n_", 2) == 0 || strncmp(cell.text, "x_", 2) == 0)) {
        char names[200] = "";
        size_t length = 0;
        for (size_t i = 0; i < reader->axes && length < sizeof names; i++) {
            length += (size_t)snprintf(names + length, sizeof names - length, "%s%s", i > 0 ? ", " : "",
                                       reader->axis_names[i]);
        }
        return modes_fail(reader, line, "column '%.*s' is a port of an axis that the archive does not have; it has %s",
                          modes_shown(cell), cell.text, names);
    }
    return modes_fail(
        reader, line,
        "column '%.*s' is unknown; a mode table has mode, frequency [Hz], damping ratio [1], n_ and x_ of "
        "each axis, tcp_X, tcp_Y, tcp_Z, separated by commas",
        modes_shown(cell), cell.text);
}

static bool modes_check_header(const ModesReader *reader, unsigned line, CsvRow header) {
    CsvRow row = header;
    CsvCell cell;
    while (csv_next_cell(&row, &cell)) {
        if (modes_column(reader, cell) > reader->width) {
            return modes_fail_unknown(reader, line, cell);
        }
    }
    for (size_t column = 0; column <= reader->width; column++) {
        char name[HEADER_SIZE];
        size_t count = 0;
        modes_header(reader, column, name);
        for (row = header; csv_next_cell(&row, &cell);) {
            count += csv_equal(cell, name);
        }
        if (count != 1) {
            return modes_fail(reader, line, "column '%s' %s", name, count > 1 ? "appears twice" : "is missing");
        }
    }
    return true;
}

static bool modes_read_row(const ModesReader *reader, unsigned line, CsvRow header, CsvRow row, double *values) {
    const size_t expected = csv_cells(header), found = csv_cells(row);
    if (found != expected) {
        return modes_fail(reader, line, "the row has %lu cells, the header has %lu", (unsigned long)found,
                          (unsigned long)expected);
    }
    CsvCell name, cell;
    while (csv_next_cell(&header, &name) && csv_next_cell(&row, &cell)) {
        const size_t column = modes_column(reader, name);
        double value;
        if (!csv_number(cell, &value)) {
            return modes_fail(reader, line, "column '%.*s': '%.*s' is no finite number with a decimal point",
                              (int)name.length, name.text, modes_shown(cell), cell.text);
        }
        if (column < MODES_SHAPES && value < 0) {
            return modes_fail(reader, line, "column '%.*s' is %.*s; it must not be negative", (int)name.length,
                              name.text, modes_shown(cell), cell.text);
        }
        if (column < reader->width) {
            values[column] = value;
        }
    }
    if (values[MODES_FREQUENCY] <= 0 && values[MODES_DAMPING] > 0) {
        char damping[NUMBER_TEXT_SIZE];
        return modes_fail(reader, line,
                          "column 'damping ratio [1]' is %s at frequency 0 Hz; a rigid mode must have none: 0",
                          number_text(damping, values[MODES_DAMPING]));
    }
    return true;
}

/* Every axis needs a rotor that turns and a scale that moves; a direction in which the tool stands still is legitimate.
 */
static bool modes_check_ports(const ModesReader *reader, const double *values, size_t modes) {
    for (size_t column = MODES_SHAPES; column < reader->width; column++) {
        bool moves = column >= MODES_SHAPES + reader->axes && column < MODES_SHAPES + reader->axes + TOOL_DIRECTIONS;
        for (size_t mode = 0; mode < modes; mode++) {
            moves = moves || fabs(values[mode * reader->width + column]) > 0;
        }
        if (!moves) {
            char name[HEADER_SIZE];
            return modes_fail(reader, 0, "column '%s' is 0 in every row: no mode moves that port",
                              modes_header(reader, column, name));
        }
    }
    return true;
}

bool modes_read(const char *text, size_t size, const char *source, size_t axes, const char *const *axis_names,
                double *values, size_t *modes, char *message, size_t message_size) {
    const ModesReader reader = {source, axes, modes_width(axes), axis_names, message, message_size};
    Csv csv = csv_open(text, size);
    CsvRow header, row;
    if (!csv_next_row(&csv, &header)) {
        return modes_fail(&reader, 0, "the table is empty; it must begin with a header row");
    }
    if (!modes_check_header(&reader, csv.line, header)) {
        return false;
    }
    size_t count = 0;
    while (csv_next_row(&csv, &row)) {
        if (!modes_read_row(&reader, csv.line, header, row, values + count * reader.width)) {
            return false;
        }
        count++;
    }
    if (count == 0) {
        return modes_fail(&reader, 0, "the table has a header but no mode; at least one row is needed");
    }
    *modes = count;
    return modes_check_ports(&reader, values, count);
}

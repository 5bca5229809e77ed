#include "poses.h"

#include <math.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include "modes.h"
#include "numbers.h"

#define MARK "FSPOSES1"
#define MARK_SIZE 8
#define NUMBER_SIZE 8
#define PLACE_SIZE 120

/* Rows and columns of a change between orthonormal bases are no longer than 1. Bases come from an eigensolver, whose
 * vectors are orthonormal to some 1e-10; what is wrong by more than this is another matrix. */
static const double longest = 1 + 1e-6;

/* What is read, and where complaints go. */
typedef struct Reader {
    Poses *poses;
    const char *source;
    const char *const *axis_names;
    char *message;
    size_t message_size;
} Reader;

#ifdef __GNUC__
__attribute__((format(printf, 3, 4)))
#endif
static bool poses_fail(const Reader *reader, const double *where, const char *format, ...) {
    const int length = where != NULL
                           ? snprintf(reader->message, reader->message_size, "%s, byte %lu: ", reader->source,
                                      (unsigned long)(MARK_SIZE + NUMBER_SIZE * (where - reader->poses->numbers)))
                           : snprintf(reader->message, reader->message_size, "%s: ", reader->source);
    if (length >= 0 && (size_t)length < reader->message_size) {
        va_list arguments;
        va_start(arguments, format);
        vsnprintf(reader->message + length, reader->message_size - (size_t)length, format, arguments);
        va_end(arguments);
    }
    return false;
}

/* --- numbers */

size_t poses_capacity(size_t size) {
    return size / NUMBER_SIZE;
}

static double poses_number(const unsigned char *bytes) {
    uint64_t bits = 0;
    double number;
    for (int i = NUMBER_SIZE - 1; i >= 0; i--) {
        bits = bits << 8 | bytes[i];
    }
    memcpy(&number, &bits, sizeof number);
    return number;
}

static bool poses_decode(const Reader *reader, const char *bytes, size_t size, double *numbers) {
    Poses *poses = reader->poses;
    poses->numbers = poses->at = poses->end = numbers;
    if (size < MARK_SIZE || memcmp(bytes, MARK, MARK_SIZE) != 0) {
        return poses_fail(reader, NULL, "the file does not begin with %s; it is no grid of poses, or of another format",
                          MARK);
    }
    if (size % NUMBER_SIZE != 0) {
        return poses_fail(reader, NULL,
                          "the file has %lu bytes; a grid of poses has a multiple of 8: it was cut off or altered",
                          (unsigned long)size);
    }
    for (size_t i = MARK_SIZE; i < size; i += NUMBER_SIZE) {
        const double number = poses_number((const unsigned char *)bytes + i);
        if (!isfinite(number)) {
            return poses_fail(reader, numbers + (i - MARK_SIZE) / NUMBER_SIZE, "%s is no finite number",
                              isnan(number) ? "nan" : "inf");
        }
        numbers[(i - MARK_SIZE) / NUMBER_SIZE] = number;
    }
    poses->end = numbers + (size - MARK_SIZE) / NUMBER_SIZE;
    return true;
}

static size_t poses_left(const Reader *reader) {
    return (size_t)(reader->poses->end - reader->poses->at);
}

/* Upper bound for a count of what takes a number each at least: no product of sizes overflows then. */
static size_t poses_room(const Reader *reader) {
    const size_t left = poses_left(reader);
    return left > reader->poses->cells ? left : reader->poses->cells;
}

/* The next `rows` times `columns` numbers; `what` names them. */
static const double *poses_take(const Reader *reader, size_t rows, size_t columns, const char *what) {
    Poses *poses = reader->poses;
    const double *taken = poses->at;
    if (columns > 0 && rows > poses_left(reader) / columns) {
        poses_fail(reader, poses->at, "%s: %lu x %lu numbers are needed, but the file ends after %lu", what,
                   (unsigned long)rows, (unsigned long)columns, (unsigned long)poses_left(reader));
        return NULL;
    }
    poses->at += rows * columns;
    return taken;
}

/* The next number as a count. */
static bool poses_count(const Reader *reader, const char *what, size_t least, size_t most, size_t *count) {
    char text[NUMBER_TEXT_SIZE];
    const double *number = poses_take(reader, 1, 1, what);
    if (number == NULL) {
        return false;
    }
    if (*number != floor(*number) || *number < (double)least || *number > (double)most) {
        number_text(text, *number);
        if (least == most) {
            return poses_fail(reader, number, "%s is %s; allowed is %lu", what, text, (unsigned long)least);
        }
        return poses_fail(reader, number, "%s is %s; allowed are whole numbers from %lu to %lu", what, text,
                          (unsigned long)least, (unsigned long)most);
    }
    *count = (size_t)*number;
    return true;
}

/* --- grid */

static bool poses_check_centres(const Reader *reader, const GridAxis *grid, size_t g) {
    char text[3][NUMBER_TEXT_SIZE];
    const double *c = grid->centres, *b = grid->boundaries;
    for (size_t i = 0; i + 1 < grid->cells; i++) {
        if (!(c[i] < c[i + 1])) {
            return poses_fail(reader, c + i + 1, "grid axis %lu: centre %lu is at %s m, allowed is more than %s m",
                              (unsigned long)g, (unsigned long)i + 1, number_text(text[0], c[i + 1]),
                              number_text(text[1], c[i]));
        }
        if (!(c[i] < b[i] && b[i] < c[i + 1])) {
            return poses_fail(reader, b + i,
                              "grid axis %lu: boundary %lu is at %s m, allowed is between its centres, %s m and %s m",
                              (unsigned long)g, (unsigned long)i, number_text(text[0], b[i]),
                              number_text(text[1], c[i]), number_text(text[2], c[i + 1]));
        }
    }
    return true;
}

static bool poses_read_grid_axis(const Reader *reader, size_t g) {
    Poses *poses = reader->poses;
    GridAxis *grid = &poses->grid[g];
    const double *where = poses->at;
    if (!poses_count(reader, "index of a grid axis", 0, poses->axes - 1, &grid->axis)) {
        return false;
    }
    for (size_t i = 0; i < g; i++) {
        if (poses->grid[i].axis == grid->axis) {
            return poses_fail(reader, where, "axis %lu is grid axis %lu and %lu; allowed is once",
                              (unsigned long)grid->axis, (unsigned long)i, (unsigned long)g);
        }
    }
    if (!poses_count(reader, "number of cells along a grid axis", 1, poses_room(reader) / poses->cells, &grid->cells)) {
        return false;
    }
    poses->cells *= grid->cells;
    const double *hysteresis = poses_take(reader, 1, 1, "hysteresis");
    if (hysteresis == NULL) {
        return false;
    }
    if (*hysteresis < 0) {
        char text[NUMBER_TEXT_SIZE];
        return poses_fail(reader, hysteresis, "grid axis %lu: the hysteresis is %s m; it must not be negative",
                          (unsigned long)g, number_text(text, *hysteresis));
    }
    grid->hysteresis = *hysteresis;
    grid->centres = poses_take(reader, 1, grid->cells, "centres of a grid axis");
    grid->boundaries =
        grid->centres != NULL ? poses_take(reader, 1, grid->cells - 1, "boundaries of a grid axis") : NULL;
    return grid->boundaries != NULL && poses_check_centres(reader, grid, g);
}

bool poses_read_grid(const char *bytes, size_t size, const char *source, size_t axes, double *numbers, GridAxis *grid,
                     Poses *poses, char *message, size_t message_size) {
    const Reader reader = {poses, source, NULL, message, message_size};
    size_t own_axes;
    memset(poses, 0, sizeof *poses);
    poses->axes = axes;
    poses->cells = 1;
    poses->grid = grid;
    if (!poses_decode(&reader, bytes, size, numbers) ||
        !poses_count(&reader, "number of axes (those of axes.csv)", axes, axes, &own_axes) ||
        !poses_count(&reader, "number of grid axes", 1, axes, &poses->grid_axes) ||
        !poses_count(&reader, "largest number of modes", 1, poses_room(&reader), &poses->most_modes)) {
        return false;
    }
    for (size_t g = 0; g < poses->grid_axes; g++) {
        if (!poses_read_grid_axis(&reader, g)) {
            return false;
        }
    }
    size_t stride = 1;
    for (size_t g = poses->grid_axes; g-- > 0;) {
        grid[g].stride = stride;
        stride *= grid[g].cells;
    }
    return true;
}

/* --- cells and transfers */

/* "cell 3 (X 0.1 m, Z 0.325 m)" */
static const char *poses_place(const Reader *reader, size_t cell, char place[PLACE_SIZE]) {
    size_t length = (size_t)snprintf(place, PLACE_SIZE, "cell %lu (", (unsigned long)cell);
    for (size_t g = 0; g < reader->poses->grid_axes && length < PLACE_SIZE; g++) {
        const GridAxis *grid = &reader->poses->grid[g];
        char text[NUMBER_TEXT_SIZE];
        length += (size_t)snprintf(place + length, PLACE_SIZE - length, "%s%s %s m", g > 0 ? ", " : "",
                                   reader->axis_names[grid->axis],
                                   number_text(text, grid->centres[cell / grid->stride % grid->cells]));
    }
    if (length < PLACE_SIZE) {
        snprintf(place + length, PLACE_SIZE - length, ")");
    }
    return place;
}

static bool poses_check_mode(const Reader *reader, const char *place, size_t mode, const double *row) {
    char text[NUMBER_TEXT_SIZE];
    if (row[MODES_FREQUENCY] < 0) {
        return poses_fail(reader, row + MODES_FREQUENCY, "%s, mode %lu: frequency %s Hz; it must not be negative",
                          place, (unsigned long)mode, number_text(text, row[MODES_FREQUENCY]));
    }
    if (row[MODES_DAMPING] < 0) {
        return poses_fail(reader, row + MODES_DAMPING, "%s, mode %lu: damping ratio %s; it must not be negative", place,
                          (unsigned long)mode, number_text(text, row[MODES_DAMPING]));
    }
    if (row[MODES_FREQUENCY] <= 0 && row[MODES_DAMPING] > 0) {
        return poses_fail(reader, row + MODES_DAMPING,
                          "%s, mode %lu: damping ratio %s at frequency 0 Hz; a rigid mode must have none: 0", place,
                          (unsigned long)mode, number_text(text, row[MODES_DAMPING]));
    }
    return true;
}

/* As in modes.c: rotors and scales must move, the tool may stand still. */
static bool poses_check_ports(const Reader *reader, const char *place, const PoseCell *cell) {
    const size_t axes = reader->poses->axes, width = modes_width(axes);
    for (size_t i = 0; i < 2 * axes; i++) {
        const size_t column = MODES_SHAPES + (i < axes ? i : i + TOOL_DIRECTIONS);
        bool moves = false;
        for (size_t mode = 0; mode < cell->modes; mode++) {
            moves = moves || fabs(cell->values[mode * width + column]) > 0;
        }
        if (!moves) {
            return poses_fail(reader, cell->values + column, "%s: %s_%s is 0 in every mode: no mode moves that port",
                              place, i < axes ? "n" : "x", reader->axis_names[i < axes ? i : i - axes]);
        }
    }
    return true;
}

static bool poses_read_cell(const Reader *reader, size_t index) {
    Poses *poses = reader->poses;
    PoseCell *cell = &poses->cell[index];
    const size_t width = modes_width(poses->axes);
    char place[PLACE_SIZE], what[PLACE_SIZE + 40];
    poses_place(reader, index, place);
    snprintf(what, sizeof what, "%s: number of modes", place);
    if (!poses_count(reader, what, 1, poses->most_modes, &cell->modes)) {
        return false;
    }
    snprintf(what, sizeof what, "%s: modes", place);
    cell->values = poses_take(reader, cell->modes, width, what);
    if (cell->values == NULL) {
        return false;
    }
    for (size_t mode = 0; mode < cell->modes; mode++) {
        if (!poses_check_mode(reader, place, mode, cell->values + mode * width)) {
            return false;
        }
    }
    return poses_check_ports(reader, place, cell);
}

static bool poses_check_lengths(const Reader *reader, const char *what, const double *t, size_t count, size_t step,
                                size_t terms, size_t term_step, const char *name) {
    for (size_t i = 0; i < count; i++) {
        double sum = 0;
        for (size_t j = 0; j < terms; j++) {
            const double entry = t[i * step + j * term_step];
            sum += entry * entry;
        }
        if (!(sum <= longest * longest)) {
            char text[NUMBER_TEXT_SIZE];
            return poses_fail(reader, t + i * step,
                              "%s: %s %lu has the length %s; a change between orthonormal bases has 1 at most", what,
                              name, (unsigned long)i, number_text(text, sqrt(sum)));
        }
    }
    return true;
}

static bool poses_read_transfer(const Reader *reader, size_t g, size_t lower) {
    Poses *poses = reader->poses;
    const size_t upper = lower + poses->grid[g].stride;
    const size_t rows = poses->cell[upper].modes, columns = poses->cell[lower].modes;
    char place[PLACE_SIZE], what[PLACE_SIZE + 60];
    snprintf(what, sizeof what, "transfer from %s to cell %lu", poses_place(reader, lower, place),
             (unsigned long)upper);
    const double *t = poses_take(reader, rows, columns, what);
    poses->transfer[g * poses->cells + lower] = t;
    return t != NULL && poses_check_lengths(reader, what, t, rows, columns, columns, 1, "row") &&
           poses_check_lengths(reader, what, t, columns, 1, rows, columns, "column");
}

bool poses_read_cells(Poses *poses, const char *source, const char *const *axis_names, PoseCell *cell,
                      const double **transfer, char *message, size_t message_size) {
    const Reader reader = {poses, source, axis_names, message, message_size};
    size_t most = 0;
    poses->cell = cell;
    poses->transfer = transfer;
    for (size_t i = 0; i < poses->cells; i++) {
        if (!poses_read_cell(&reader, i)) {
            return false;
        }
        most = cell[i].modes > most ? cell[i].modes : most;
    }
    if (most != poses->most_modes) {
        return poses_fail(&reader, poses->numbers + 2,
                          "largest number of modes is said to be %lu, but no cell has more than %lu",
                          (unsigned long)poses->most_modes, (unsigned long)most);
    }
    for (size_t g = 0; g < poses->grid_axes; g++) {
        const GridAxis *grid = &poses->grid[g];
        for (size_t i = 0; i < poses->cells; i++) {
            if (i / grid->stride % grid->cells + 1 < grid->cells && !poses_read_transfer(&reader, g, i)) {
                return false;
            }
        }
    }
    return poses->at == poses->end ||
           poses_fail(&reader, poses->at, "%lu numbers too many: nothing may follow the last transfer",
                      (unsigned long)poses_left(&reader));
}

/* Rows and cells of a comma-separated table in memory, without copying: byte-order mark, CRLF and blank lines are
 * passed over, blanks around a cell do not count, quotes have no meaning. Pure functions. */
#ifndef FEEDSIM_CSV_H
#define FEEDSIM_CSV_H

#include <stdbool.h>
#include <stddef.h>

#include "prefix.h"

#define csv_open PREFIXED(csv_open)
#define csv_lines PREFIXED(csv_lines)
#define csv_next_row PREFIXED(csv_next_row)
#define csv_cells PREFIXED(csv_cells)
#define csv_next_cell PREFIXED(csv_next_cell)
#define csv_equal PREFIXED(csv_equal)
#define csv_number PREFIXED(csv_number)

typedef struct Csv {
    const char *at, *end;
    unsigned line; /* of the row last read, the file's first line is 1 */
} Csv;

typedef struct CsvRow {
    const char *at, *end;
    bool done;
} CsvRow;

typedef struct CsvCell {
    const char *text;
    size_t length;
} CsvCell;

/* A table of `size` bytes, which a zero byte closes (not counted). */
Csv csv_open(const char *text, size_t size);

/* Number of lines, an upper bound for the number of rows. */
size_t csv_lines(const char *text, size_t size);

/* The next row that is not blank; false at the end. */
bool csv_next_row(Csv *csv, CsvRow *row);

/* Number of cells that are left in the row. */
size_t csv_cells(CsvRow row);

/* The next cell of the row; false at its end. */
bool csv_next_cell(CsvRow *row, CsvCell *cell);

bool csv_equal(CsvCell cell, const char *text);

/* The cell as a finite number, decimal point under every locale; false if it is anything else. */
bool csv_number(CsvCell cell, double *value);

#endif

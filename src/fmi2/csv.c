#include "csv.h"

#include <string.h>

#include "numbers.h"

static bool csv_blank(char c) {
    return c == ' ' || c == '\t' || c == '\r';
}

Csv csv_open(const char *text, size_t size) {
    Csv csv = {text, text + size, 0};
    if (size >= 3 && memcmp(text, "\xEF\xBB\xBF", 3) == 0) {
        csv.at += 3;
    }
    return csv;
}

size_t csv_lines(const char *text, size_t size) {
    size_t lines = 1;
    for (size_t i = 0; i < size; i++) {
        lines += text[i] == '\n';
    }
    return lines;
}

bool csv_next_row(Csv *csv, CsvRow *row) {
    while (csv->at < csv->end) {
        const char *start = csv->at, *end = start;
        while (end < csv->end && *end != '\n') {
            end++;
        }
        csv->at = end < csv->end ? end + 1 : end;
        csv->line++;
        while (start < end && csv_blank(*start)) {
            start++;
        }
        if (start < end) {
            *row = (CsvRow){start, end, false};
            return true;
        }
    }
    return false;
}

size_t csv_cells(CsvRow row) {
    size_t count = 0;
    for (CsvCell cell; csv_next_cell(&row, &cell); count++) {
    }
    return count;
}

bool csv_next_cell(CsvRow *row, CsvCell *cell) {
    if (row->done) {
        return false;
    }
    const char *start = row->at, *end = start;
    while (end < row->end && *end != ',') {
        end++;
    }
    row->done = end == row->end;
    row->at = end + 1;
    while (start < end && csv_blank(*start)) {
        start++;
    }
    while (end > start && csv_blank(end[-1])) {
        end--;
    }
    *cell = (CsvCell){start, (size_t)(end - start)};
    return true;
}

bool csv_equal(CsvCell cell, const char *text) {
    return strlen(text) == cell.length && memcmp(text, cell.text, cell.length) == 0;
}

bool csv_number(CsvCell cell, double *value) {
    const char *end;
    return cell.length > 0 && number_parse(cell.text, &end, value) && end == cell.text + cell.length;
}

/* Numbers as text, the same under every locale: the decimal separator is always the point. */
#ifndef FEEDSIM_NUMBERS_H
#define FEEDSIM_NUMBERS_H

#include <stdbool.h>

#include "prefix.h"

/* Read the decimal number that `text` starts with: [+-] digits [. digits] [e [+-] digits], at least one digit in the
 * mantissa; correctly rounded. No leading space, no hexadecimal, no "inf" or "nan"; a number too large for a double is
 * refused. On success *value is the number and *end (where end is not NULL) the first character behind it; false leaves
 * both untouched. */
bool number_parse(const char *text, const char **end, double *value);

/* 0 for a finite number, else no number: a sum of these tells whether all are finite, without a decision for each. */
static inline double number_probe(double value) {
    return value - value;
}

/* The same for a number that is not beyond TAME in size: a tame value that changes by a tame slope over less than
 * TAME_STEP seconds stays finite. */
#define TAME 1e150
#define TAME_STEP 1e150
static inline double number_probe_tame(double value) {
    return number_probe(value * (1e308 / TAME));
}

#define NUMBER_TEXT_SIZE 32

/* Shortest of %.15g, %.16g and %.17g that reads back as `value`, written to text[NUMBER_TEXT_SIZE]; returns text. */
char *number_text(char *text, double value);

#endif

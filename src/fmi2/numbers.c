#include "numbers.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define LONGEST 512 /* characters of a number; 17 digits and an exponent are what a double holds */

static bool digit(char c) {
    return c >= '0' && c <= '9';
}

static const char *digits(const char *text) {
    while (digit(*text)) {
        text++;
    }
    return text;
}

#define SEPARATOR_SIZE 16

/* The decimal separator of the current locale, which may be more than one character: what is printed between two
 * digits. localeconv() would tell it out of memory that all threads share. */
static size_t separator_of_locale(char *separator) {
    char printed[SEPARATOR_SIZE + 2];
    const int length = snprintf(printed, sizeof printed, "%.1f", 0.0);
    const size_t width = length > 2 && (size_t)length < sizeof printed ? (size_t)length - 2 : 0;
    memcpy(separator, printed + 1, width);
    separator[width] = '\0';
    return width;
}

bool number_parse(const char *text, const char **end, double *value) {
    const char *whole = text + (*text == '+' || *text == '-');
    const char *point = digits(whole);
    const char *fraction = point + (*point == '.');
    const char *behind = digits(fraction);
    if (behind - whole == fraction - point) { /* no digit on either side of the point */
        return false;
    }
    const char *last = behind;
    if (*last == 'e' || *last == 'E') {
        const char *power = last + 1 + (last[1] == '+' || last[1] == '-');
        if (digit(*power)) {
            last = digits(power);
        }
    }

    /* strtod is exact, but expects the separator of the current locale. Whole numbers get one too: 12 is 12., 1e5 is
     * 1.e5. */
    char separator[SEPARATOR_SIZE];
    const size_t width = separator_of_locale(separator);
    size_t head = (size_t)(point - text), tail = (size_t)(last - fraction);
    char copy[LONGEST];
    if (width == 0 || head + width + tail >= sizeof copy) {
        return false;
    }
    memcpy(copy, text, head);
    memcpy(copy + head, separator, width);
    memcpy(copy + head + width, fraction, tail);
    copy[head + width + tail] = '\0';

    double number = strtod(copy, NULL);
    if (!isfinite(number)) {
        return false;
    }
    *value = number;
    if (end != NULL) {
        *end = last;
    }
    return true;
}

char *number_text(char *text, double value) {
    if (!isfinite(value)) {
        snprintf(text, NUMBER_TEXT_SIZE, "%s", isnan(value) ? "nan" : value > 0 ? "inf" : "-inf");
        return text;
    }
    for (int digit_count = 15; digit_count <= 17; digit_count++) {
        snprintf(text, NUMBER_TEXT_SIZE, "%.*g", digit_count, value);
        if (strtod(text, NULL) == value) {
            break;
        }
    }
    char separator[SEPARATOR_SIZE];
    const size_t width = separator_of_locale(separator);
    char *point = width > 0 ? strstr(text, separator) : NULL;
    if (point != NULL) {
        *point = '.';
        memmove(point + 1, point + width, strlen(point + width) + 1);
    }
    return text;
}

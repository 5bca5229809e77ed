/* Assertions for the C tests. A test program is one file with a main() that ends in `return CHECK_RESULT;`: that prints
 * "<program>: N passed, N failed" and is non-zero where a check failed (or none was made). A failed check prints its
 * place and the values, and the program goes on. */
#ifndef CHECK_H
#define CHECK_H

#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>

static int check_passed, check_failed;

static inline bool check_count(bool good) {
    ++*(good ? &check_passed : &check_failed);
    return good;
}

static inline void check_that(bool good, const char *text, const char *file, int line) {
    if (!check_count(good)) {
        printf("%s:%d: not true: %s\n", file, line, text);
    }
}

static inline void check_near(double actual, double expected, double tolerance, const char *text, const char *file,
                              int line) {
    if (!check_count(fabs(actual - expected) <= tolerance)) { /* false where anything is NaN */
        printf("%s:%d: %s is %.17g, expected %.17g within %g (off by %g)\n", file, line, text, actual, expected,
               tolerance, actual - expected);
    }
}

static inline void check_contains(const char *text, const char *part, const char *file, int line) {
    if (!check_count(strstr(text, part) != NULL)) {
        printf("%s:%d: '%s' is not in '%s'\n", file, line, part, text);
    }
}

static inline void check_text(const char *actual, const char *expected, const char *file, int line) {
    if (!check_count(strcmp(actual, expected) == 0)) {
        printf("%s:%d: '%s' is not '%s'\n", file, line, actual, expected);
    }
}

static inline int check_result(const char *file) {
    printf("%s: %d passed, %d failed\n", file, check_passed, check_failed);
    fflush(stdout);
    return check_failed > 0 || check_passed == 0;
}

#define CHECK(condition) check_that((condition), #condition, __FILE__, __LINE__)
/* |actual - expected| <= tolerance */
#define CHECK_NEAR(actual, expected, tolerance)                                                                        \
    check_near((actual), (expected), (tolerance), #actual, __FILE__, __LINE__)
/* equal to the last bit but for the sign of zero; values are printed */
#define CHECK_EQUAL(actual, expected) check_near((actual), (expected), 0, #actual, __FILE__, __LINE__)
#define CHECK_CONTAINS(text, part) check_contains((text), (part), __FILE__, __LINE__)
#define CHECK_TEXT(actual, expected) check_text((actual), (expected), __FILE__, __LINE__)
#define CHECK_RESULT check_result(__FILE__)

#endif

/* Numbers as text: exact, and the same under every locale. */
#include <locale.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdlib.h>

#include "check.h"

/* The functions under test see a C library whose locale writes `locale_separator` in place of the point: no such locale
 * need be installed. (Where some are, they are tried as well: see installed_locales.) */
static const char *locale_separator = ".";

static double stub_strtod(const char *text, char **end) {
    char copy[1024];
    const char *found = strstr(text, locale_separator);
    if (strcmp(locale_separator, ".") == 0 || found == NULL) {
        return strchr(text, '.') != NULL && found == NULL ? NAN : strtod(text, end); /* the point means nothing there */
    }
    snprintf(copy, sizeof copy, "%.*s.%s", (int)(found - text), text, found + strlen(locale_separator));
    return strtod(copy, NULL);
}

static int stub_snprintf(char *text, size_t size, const char *format, ...) {
    char copy[1024];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(copy, sizeof copy, format, arguments);
    va_end(arguments);
    char *point = strcmp(locale_separator, ".") != 0 ? strchr(copy, '.') : NULL;
    if (point == NULL) {
        return snprintf(text, size, "%s", copy);
    }
    return snprintf(text, size, "%.*s%s%s", (int)(point - copy), copy, locale_separator, point + 1);
}

#undef strtod /* a C library may have macros of these names */
#undef snprintf
#define strtod stub_strtod
#define snprintf stub_snprintf
#include "numbers.c"
#undef strtod
#undef snprintf

static void reads(const char *text, double expected, size_t length) {
    double value = -77;
    const char *end = NULL;
    CHECK(number_parse(text, &end, &value));
    CHECK_EQUAL(value, expected);
    CHECK(end == text + length);
    CHECK(number_parse(text, NULL, &value));
}

static void refuses(const char *text) {
    double value = -77;
    const char *end = NULL;
    if (number_parse(text, &end, &value)) {
        printf("'%s' is read as %g\n", text, value);
    }
    CHECK(!number_parse(text, &end, &value) && value == -77 && end == NULL);
}

static void what_is_a_number(void) {
    reads("0", 0, 1);
    reads("-12.5", -12.5, 5);
    reads("+3", 3, 2);
    reads(".5", 0.5, 2);
    reads("5.", 5, 2);
    reads("1e3", 1000, 3);
    reads("1.25E-2x", 0.0125, 7);
    reads("1.5e+2,7", 150, 6);
    reads("1e", 1, 1);
    reads("1e+", 1, 1);
    reads("1,5", 1, 1);
    reads("1.5.5", 1.5, 3);
    reads("0x10", 0, 1);
    reads("1_000", 1, 1);
    reads("1e-400", 0, 6);
    reads("0.000000000000000000000000000000000000000000000000000000000000000000000000000001e77", 0.1, 83);
    refuses("");
    refuses(".");
    refuses("-");
    refuses("+.e1");
    refuses(" 1");
    refuses("nan");
    refuses("inf");
    refuses("-infinity");
    refuses("e5");
    refuses(",5");
    refuses("--1");
    refuses("1e999");
    refuses("-1e309");
}

static void exact_to_the_last_bit(void) {
    reads("0.1", 0.1, 3);
    reads("9007199254740993", 9007199254740992.0, 16); /* half way: to even */
    reads("9007199254740993.00000000000000000000000000000000000000000000000000001", 9007199254740994.0, 70);
    reads("2.2250738585072011e-308", 0x0.fffffffffffffp-1022, 23);
    reads("4.9406564584124654e-324", 0x1p-1074, 23);
    reads("1.7976931348623157e308", 0x1.fffffffffffffp+1023, 22);
    reads("0.0031830988618379067", 0.0031830988618379067, 21);
}

static void very_long_numbers(void) {
    char text[600];
    memset(text, '0', sizeof text);
    memcpy(text, "0.", 2);
    memcpy(text + 400, "1e399", 6);
    reads(text, 1, 405);
    memset(text, '1', sizeof text);
    text[sizeof text - 1] = '\0';
    refuses(text);
}

/* Seeded; all bit patterns alike, so that every magnitude occurs. */
static void round_trips(int count) {
    uint64_t random = 20210;
    for (int k = 0; k < count; k++) {
        double value, back = NAN;
        do {
            random ^= random << 13;
            random ^= random >> 7;
            random ^= random << 17;
            memcpy(&value, &random, sizeof value);
        } while (!isfinite(value));
        char text[NUMBER_TEXT_SIZE], *shown = number_text(text, value);
        const char *end = NULL;
        bool good = number_parse(shown, &end, &back) && *end == '\0' && memcmp(&back, &value, sizeof value) == 0 &&
                    strspn(shown, "0123456789.e+-") == strlen(shown);
        if (!good) {
            printf("%a is shown as '%s' and read as %a\n", value, shown, back);
        }
        CHECK(good);
    }
}

static void shows(double value, const char *expected) {
    char text[NUMBER_TEXT_SIZE];
    CHECK_TEXT(number_text(text, value), expected);
}

static void how_numbers_are_shown(void) {
    shows(0, "0");
    shows(0.1, "0.1");
    shows(-1234.5, "-1234.5");
    shows(125e-6, "0.000125");
    shows(0.1 + 0.2, "0.30000000000000004");
    shows(1e300, "1e+300");
    shows(-1.5e-7, "-1.5e-07");
    shows(INFINITY, "inf");
    shows(-INFINITY, "-inf");
    shows(NAN, "nan");
    shows(-0x1.fffffffffffffp+1023, "-1.7976931348623157e+308");
}

static void everything(void) {
    what_is_a_number();
    exact_to_the_last_bit();
    very_long_numbers();
    round_trips(2000);
    how_numbers_are_shown();
}

static void installed_locales(void) {
    const char *const names[] = {"de_DE.UTF-8", "de_DE.utf8",  "de_DE",
                                 "fr_FR.UTF-8", "ps_AF.UTF-8", "German_Germany.1252"};
    for (size_t k = 0; k < sizeof names / sizeof *names; k++) {
        if (setlocale(LC_ALL, names[k]) != NULL) {
            printf("with locale %s, separator '%s'\n", names[k], localeconv()->decimal_point);
            everything();
        }
    }
    setlocale(LC_ALL, "C");
}

int main(void) {
    const char *const separators[] = {".", ",", "\xd9\xab", "::"}; /* the third: Arabic decimal separator, two bytes */
    for (size_t k = 0; k < sizeof separators / sizeof *separators; k++) {
        locale_separator = separators[k];
        everything();
    }
    locale_separator = ".";
    installed_locales();
    return CHECK_RESULT;
}

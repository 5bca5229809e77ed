/* The info table made from variables.def, and the hash that is the first half of the GUID. */
#include <stdint.h>

#include "toy.h"

/* What the hash is made of, written out by hand: name|KIND|causality|variability|start|unit|min|max. */
static const char *const rows[] = {
    "u|REAL|input|continuous|0|m/s|NO_MIN|NO_MAX\n",
    "w|REAL|input|continuous|0|1|-10|10\n",
    "i|INTEGER|input|discrete|0||-3|3\n",
    "b|BOOLEAN|input|discrete|0||NO_MIN|NO_MAX\n",
    "x|REAL|output|continuous|0|m|NO_MIN|NO_MAX\n",
    "y|REAL|output|continuous|0|m|NO_MIN|NO_MAX\n",
    "late|REAL|output|discrete|0|m|NO_MIN|NO_MAX\n",
    "steps|INTEGER|output|discrete|0||NO_MIN|NO_MAX\n",
    "positive|BOOLEAN|output|discrete|0||NO_MIN|NO_MAX\n",
    "twice|REAL|local|continuous|0|m|NO_MIN|NO_MAX\n",
    "derivations|INTEGER|local|discrete|0||NO_MIN|NO_MAX\n",
    "feed|REAL|parameter|fixed|0.5|s|0|1\n",
    "gain|REAL|parameter|tunable|2|1|-1e300|NO_MAX\n",
    "offset|REAL|parameter|fixed|0|m/s|NO_MIN|5\n",
    "limit.u|REAL|parameter|fixed|1000|m/s|1e-3|NO_MAX\n",
    "cells|INTEGER|parameter|fixed|3||1|8\n",
    "inverted|BOOLEAN|parameter|fixed|0||NO_MIN|NO_MAX\n",
    "label|STRING|parameter|fixed|toy||NO_MIN|NO_MAX\n",
    "F|REAL|input|continuous|0|N|NO_MIN|NO_MAX\n",
    "s|REAL|output|continuous|0|N|NO_MIN|NO_MAX\n",
    "load|REAL|parameter|tunable|0.25|N|-1|1\n",
};
enum { ROWS = sizeof rows / sizeof *rows };

static void the_hash_is_that_of_the_rows(void) {
    uint64_t hash = 14695981039346656037u; /* FNV-1a, 64 bit: offset basis and prime in decimal */
    for (int k = 0; k < ROWS; k++) {
        for (const char *c = rows[k]; *c; c++) {
            hash = (hash ^ (unsigned char)*c) * 1099511628211u;
        }
    }
    char expected[32], text[HASH_TEXT_SIZE];
    snprintf(expected, sizeof expected, "%08lx%08lx", (unsigned long)(hash >> 32), (unsigned long)(hash & 0xffffffff));
    CHECK_TEXT(table_hash(text), expected);
}

static void published_hashes(void) {
    /* Test values of the authors of FNV. */
    const char *const texts[][2] = {
        {"", "cbf29ce484222325"}, {"a", "af63dc4c8601ec8c"}, {"foobar", "85944171f73967e8"}};
    for (int k = 0; k < 3; k++) {
        char text[HASH_TEXT_SIZE];
        CHECK_TEXT(hash_text(text, hash_bytes(HASH_OF_NOTHING, texts[k][0], strlen(texts[k][0]))), texts[k][1]);
    }
    char text[HASH_TEXT_SIZE];
    CHECK_TEXT(hash_text(text, 0), "0000000000000000");
}

static void rows_say_what_was_declared(void) {
    CHECK(SCALAR_ROWS + AXIS_ROWS == ROWS);
    for (int k = 0; k < ROWS; k++) {
        const VariableInfo *info = k < SCALAR_ROWS ? &table_scalars[k] : &table_axis[k - SCALAR_ROWS];
        CHECK(strncmp(info->name, rows[k], strlen(info->name)) == 0);
    }
    CHECK(table_scalars[VR_u].offset == offsetof(Scalars, u));
    CHECK(table_scalars[VR_limit_u].offset == offsetof(Scalars, limit_u));
    CHECK_EQUAL(table_scalars[VR_limit_u].min, 1e-3);
    CHECK_EQUAL(table_scalars[VR_gain].min, -1e300);
    CHECK(isinf(table_scalars[VR_gain].max) && table_scalars[VR_gain].max > 0);
    CHECK(isinf(table_scalars[VR_u].min) && table_scalars[VR_u].min < 0);
    CHECK_EQUAL(table_scalars[VR_feed].start, 0.5);
    CHECK_TEXT(table_scalars[VR_label].start_text, "toy");
    CHECK(table_axis[AXIS_VR_load].offset == offsetof(AxisBlock, load));
    CHECK(table_axis[AXIS_VR_load].variability == VARIABILITY_tunable);
}

int main(void) {
    the_hash_is_that_of_the_rows();
    published_hashes();
    rows_say_what_was_declared();
    return CHECK_RESULT;
}

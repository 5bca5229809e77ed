/* Text of messages (src/fmi2/text.c): cut between characters, sound UTF-8 whatever was put in. */
#include "text.h"

#include "check.h"

static void cut(const char *text, size_t length, size_t expected) {
    CHECK(text_whole(text, strlen(text), length) == expected);
}

static void cuts_lie_between_characters(void) {
    cut("abc", 2, 2);
    cut("abc", 3, 3);
    cut("abc", 40, 3);
    cut("", 0, 0);
    cut("a\xC3\xA4z", 2, 1); /* a umlaut */
    cut("a\xC3\xA4z", 3, 3);
    cut("a\xE2\x82\xACz", 3, 1); /* Euro sign */
    cut("a\xF0\x9F\x98\x80z", 4, 1);
    cut("a\xF0\x9F\x98\x80z", 5, 5);
    cut("\x80\x80\x80\x80\x80\x80\x80\x80", 6, 6); /* no UTF-8: no better place */
}

static void mended(const char *text, const char *expected) {
    char copy[64];
    snprintf(copy, sizeof copy, "%s", text);
    text_mend(copy);
    CHECK_TEXT(copy, expected);
}

static void texts_are_mended(void) {
    mended("", "");
    mended("plain", "plain");
    mended("\xC3\xA4 \xE2\x82\xAC \xF0\x9F\x98\x80 \xED\x9F\xBF \xF4\x8F\xBF\xBF",
           "\xC3\xA4 \xE2\x82\xAC \xF0\x9F\x98\x80 \xED\x9F\xBF \xF4\x8F\xBF\xBF");
    mended("cut \xC3", "cut ");
    mended("cut \xE2\x82", "cut ");
    mended("cut \xF0\x9F\x98", "cut ");
    mended("M\xE4rz", "M?rz"); /* Latin-1 */
    mended("Gr\xFC\xDF"
           "e",
           "Gr??e");
    mended("\x80\xBF", "??");
    mended("\xC0\xAF", "??");        /* overlong */
    mended("\xE0\x80\x80.", "???."); /* overlong */
    mended("\xED\xA0\x80.", "???."); /* a surrogate */
    mended("\xF4\x90\x80\x80.", "????.");
    mended("\xF8\x88\x80\x80\x80.", "?????.");
    mended("\xE2\x82.", "??.");
    mended("\xE2\xC3\xA4", "?\xC3\xA4");
}

/* A cell of a file may hold what a terminal obeys. */
static void control_characters_are_masked(void) {
    mended("a\x1B[2Jb", "a?[2Jb");
    mended("a\r\n\tb\x07\x7F", "a???b??");
    mended("\xC2\x9B"
           "2J\xC2\xA0\xC2\xB5",
           "??2J\xC2\xA0\xC2\xB5");
    mended("\xC2", "");
}

int main(void) {
    cuts_lie_between_characters();
    texts_are_mended();
    control_characters_are_masked();
    return CHECK_RESULT;
}

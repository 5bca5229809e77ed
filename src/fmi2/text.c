#include "text.h"

#include <stdbool.h>

static bool follows(char c) {
    return ((unsigned char)c & 0xC0) == 0x80;
}

size_t text_whole(const char *text, size_t size, size_t length) {
    if (length >= size) {
        return size;
    }
    size_t whole = length;
    while (whole > 0 && length - whole < 4 && follows(text[whole])) {
        whole--;
    }
    return follows(text[whole]) ? length : whole; /* no beginning within reach: these are no characters at all */
}

/* Bytes of the character that begins with `lead`; 0 where none does. */
static int bytes_of(char lead) {
    const unsigned char c = (unsigned char)lead;
    return c < 0x80 ? 1 : c >= 0xC2 && c < 0xE0 ? 2 : c >= 0xE0 && c < 0xF0 ? 3 : c >= 0xF0 && c < 0xF5 ? 4 : 0;
}

/* The second byte of some leads excludes overlong forms, surrogates and what lies beyond Unicode. */
static bool may_follow(char lead, char second) {
    const unsigned char a = (unsigned char)lead, b = (unsigned char)second;
    return !(a == 0xE0 && b < 0xA0) && !(a == 0xED && b > 0x9F) && !(a == 0xF0 && b < 0x90) && !(a == 0xF4 && b > 0x8F);
}

/* ASCII's, and those of two bytes, U+0080 to U+009F. */
static bool controls(const char *text) {
    const unsigned char c = (unsigned char)text[0];
    return c < 0x20 || c == 0x7F || (c == 0xC2 && (unsigned char)text[1] < 0xA0 && follows(text[1]));
}

void text_mend(char *text) {
    while (*text != '\0') {
        const int bytes = bytes_of(*text);
        int length = bytes > 0 && !controls(text);
        while (length > 0 && length < bytes && follows(text[length]) && (length > 1 || may_follow(text[0], text[1]))) {
            length++;
        }
        if (length == bytes && bytes > 0) {
            text += bytes;
        } else if (length > 0 && text[length] == '\0') {
            *text = '\0';
        } else {
            *text++ = '?';
        }
    }
}

#include "location.h"

#include <stddef.h>
#include <string.h>

static bool letter(char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z');
}

/* Length of the URI scheme ahead of the colon; 0 where there is none. A single letter is a drive. */
static size_t scheme_length(const char *location) {
    size_t length = 0;
    while (letter(location[length]) ||
           (length > 0 && strchr("0123456789+-.", location[length]) != NULL && location[length])) {
        length++;
    }
    return location[length] == ':' && length > 1 ? length : 0;
}

/* Do the first `length` characters of `text` spell `word` (lower case), whatever their case? */
static bool spells(const char *text, size_t length, const char *word) {
    if (length != strlen(word)) {
        return false;
    }
    for (size_t i = 0; i < length; i++) {
        if ((text[i] | 0x20) != word[i]) {
            return false;
        }
    }
    return true;
}

static int hexadecimal(char c) {
    const char *digits = "0123456789abcdef0123456789ABCDEF", *digit = c ? strchr(digits, c) : NULL;
    return digit != NULL ? (int)((digit - digits) % 16) : -1;
}

/* A percent sign that is no valid sequence (or would cut the path short with a zero) stands for itself. */
static void decode(const char *text, char *path) {
    while (*text) {
        int high = text[0] == '%' ? hexadecimal(text[1]) : -1, low = high >= 0 ? hexadecimal(text[2]) : -1;
        if (low >= 0 && high + low > 0) {
            *path++ = (char)(unsigned char)(high * 16 + low);
            text += 3;
        } else {
            *path++ = *text++;
        }
    }
    *path = '\0';
}

static bool drive(const char *text) {
    return letter(text[0]) && text[1] == ':';
}

static void drop_closing_separators(char *path, bool drive_letters) {
    size_t length = strlen(path), keep = drive_letters && drive(path) ? 3 : 1;
    while (length > keep && (path[length - 1] == '/' || (drive_letters && path[length - 1] == '\\'))) {
        path[--length] = '\0';
    }
}

bool location_path(const char *location, bool drive_letters, char *path) {
    size_t scheme = scheme_length(location);
    if (scheme == 0) {
        strcpy(path, location);
    } else if (!spells(location, scheme, "file")) {
        return false;
    } else {
        const char *rest = location + scheme + 1;
        if (rest[0] == '/' && rest[1] == '/') {
            /* file://host/path: no host and localhost are this machine, any other is a network share //host/path */
            const char *host = rest + 2, *behind = strchr(host, '/');
            size_t length = behind != NULL ? (size_t)(behind - host) : strlen(host);
            if (length == 0 || spells(host, length, "localhost")) {
                rest = host + length;
            } else if (drive_letters && drive(host)) { /* file://C:/path, one slash short */
                rest = host;
            }
        }
        if (drive_letters && rest[0] == '/' && drive(rest + 1)) {
            rest++;
        }
        decode(rest, path);
    }
    drop_closing_separators(path, drive_letters);
    return path[0] != '\0';
}

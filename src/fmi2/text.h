/* Text in UTF-8 that messages are made of: names, paths and pieces of files, in buffers that end somewhere. */
#ifndef FEEDSIM_TEXT_H
#define FEEDSIM_TEXT_H

#include <stddef.h>

#include "prefix.h"

/* The largest length <= `length` at which text[length] can be cut without dividing a character. text[] has `size` bytes
 * and need not be closed by a zero byte. */
size_t text_whole(const char *text, size_t size, size_t length);

/* Make a text sound UTF-8 of characters that can be shown, in place: a character that the end cuts off is dropped,
 * other bytes that belong to no character (files in other encodings have them) and control characters become question
 * marks. Importers may refuse to print the former, terminals obey the latter. */
void text_mend(char *text);

#endif

/* FNV-1a, 64 bit: the hash the GUID is made of. It finds accidental differences; it is no protection against intent. */
#ifndef FEEDSIM_HASH_H
#define FEEDSIM_HASH_H

#include <stddef.h>
#include <stdint.h>

#include "prefix.h"

#define HASH_OF_NOTHING UINT64_C(0xcbf29ce484222325)
#define HASH_TEXT_SIZE 17 /* 16 hexadecimal digits and the closing zero */

/* `hash` continued over `size` more bytes. */
uint64_t hash_bytes(uint64_t hash, const void *bytes, size_t size);
/* The hash as 16 lower-case hexadecimal digits, written to text[HASH_TEXT_SIZE]; returns text. */
char *hash_text(char *text, uint64_t hash);

#endif

#include "hash.h"

uint64_t hash_bytes(uint64_t hash, const void *bytes, size_t size) {
    const unsigned char *byte = bytes;
    for (size_t i = 0; i < size; i++) {
        hash = (hash ^ byte[i]) * UINT64_C(0x100000001b3);
    }
    return hash;
}

char *hash_text(char *text, uint64_t hash) {
    for (int i = HASH_TEXT_SIZE - 2; i >= 0; i--, hash >>= 4) {
        text[i] = "0123456789abcdef"[hash & 15];
    }
    text[HASH_TEXT_SIZE - 1] = '\0';
    return text;
}

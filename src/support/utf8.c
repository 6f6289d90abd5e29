#include "support/utf8.h"

#include <stddef.h>

int fv_utf8_decode(const char *text, uint32_t *code)
{
    static const uint32_t smallest[5] = {0, 1, 0x80, 0x800, 0x10000};
    unsigned char first = (unsigned char)text[0];
    int bytes = first == 0     ? 0
                : first < 0x80 ? 1
                : first < 0xc0 ? 0
                : first < 0xe0 ? 2
                : first < 0xf0 ? 3
                : first < 0xf8 ? 4
                               : 0;
    uint32_t value = bytes <= 1 ? first : first & (0x7fU >> bytes);
    for (int i = 1; i < bytes; i++) {
        if (((unsigned char)text[i] & 0xc0) != 0x80) return 0;
        value = value << 6 | ((unsigned char)text[i] & 0x3f);
    }
    if (bytes == 0 || value < smallest[bytes] || value > 0x10ffff ||
        (value >= 0xd800 && value <= 0xdfff))
        return 0;
    *code = value;
    return bytes;
}

/* Bytes at the front that are well-formed. */
static size_t well_formed(const char *text)
{
    uint32_t code;
    size_t at = 0;
    for (int bytes = 1; bytes > 0; at += (size_t)bytes)
        bytes = fv_utf8_decode(text + at, &code);
    return at;
}

bool fv_utf8_check(const char *text)
{
    return text[well_formed(text)] == '\0';
}

void fv_utf8_cut(char *text)
{
    text[well_formed(text)] = '\0';
}

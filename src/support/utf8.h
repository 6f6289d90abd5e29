/* UTF-8, as RFC 3629 has it. Init-only. */
#ifndef FOVEA_SUPPORT_UTF8_H
#define FOVEA_SUPPORT_UTF8_H

#include <stdbool.h>
#include <stdint.h>

/* Bytes of the code point that `text` starts with, which goes to `*code`; 0 for malformed, overlong
 * or surrogate sequences and at the end of the text. */
int fv_utf8_decode(const char *text, uint32_t *code);

/* Whether the whole text is well-formed. */
bool fv_utf8_check(const char *text);

/* Cut the text, which was cut within a letter or is no UTF-8, where it ceases to be well-formed. */
void fv_utf8_cut(char *text);

#endif

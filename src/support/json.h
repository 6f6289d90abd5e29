/* Texts in JSON. Off the loop thread. */
#ifndef FOVEA_SUPPORT_JSON_H
#define FOVEA_SUPPORT_JSON_H

#include <stdio.h>

/* Write a text in quotes, as JSON that is well-formed whatever the text holds: bytes that are no
 * UTF-8, as names of files may have, become U+FFFD. */
void fv_json_text(FILE *file, const char *text);

#endif

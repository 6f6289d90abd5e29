/* Every key of the configuration for the page: name, section, kind, words, range, default, help,
 * and whether a run changes it while it runs. */
#ifndef FOVEA_WEB_KEYS_H
#define FOVEA_WEB_KEYS_H

#include <stddef.h>
#include <stdint.h>

/* A JSON array in memory of malloc; NULL: no memory. */
uint8_t *fv_web_keys_json(size_t *bytes);
/* The same, compressed (RFC 1952). */
uint8_t *fv_web_keys_gzip(size_t *bytes);

#endif

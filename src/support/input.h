/* Opening a file that is read: configuration, calibration, map, network, mask, pictures, lists of a
 * data set, logs. Every reader of a file opens it here, so that opening never waits and what is
 * read has a bound: a pipe, a socket, a device or a directory is refused, and so is a file that is
 * larger than its kind may be, before a byte of it is read. Init-only, and for readers' threads. */
#ifndef FOVEA_SUPPORT_INPUT_H
#define FOVEA_SUPPORT_INPUT_H

#include <stddef.h>
#include <stdint.h>

#include "fovea/status.h"

#ifdef __cplusplus
extern "C" {
#endif

/* The largest file of each kind, in bytes; docs/security.md has the same table. */
#define FV_INPUT_YAML_BYTES_MAX ((int64_t)1 << 20)    /* configuration, calibration */
#define FV_INPUT_PICTURE_BYTES_MAX ((int64_t)1 << 26) /* picture, mask */
#define FV_INPUT_MODEL_BYTES_MAX ((int64_t)1 << 28)
#define FV_INPUT_MAP_BYTES_MAX ((int64_t)1 << 28)
#define FV_INPUT_LIST_BYTES_MAX ((int64_t)1 << 28) /* frames and poses of a data set */
#define FV_INPUT_ANY_BYTES INT64_MAX               /* logs and videos, read a piece at a time */

/* Open a regular file of at most `bytes_max` bytes for reading. Returns its descriptor, closed on
 * exec, and its size in `*bytes` (may be NULL); or -1 and why in `reason` (may be NULL), without
 * the file's name: FOVEA_GONE there is none, else FOVEA_ERROR_INPUT. */
int fv_input_open(const char *path, int64_t bytes_max, int64_t *bytes, struct fovea_error *reason);

/* The same without opening it, for libraries that open files themselves. */
enum fovea_status fv_input_check(const char *path, int64_t bytes_max, struct fovea_error *reason);

#ifdef __cplusplus
}
#endif
#endif

/* The recordings in one folder of this host (record_folder of a run), for pages to list and to
 * download. Names are those of files in it that end in ".lcm", of letters, digits and "._-": no
 * path comes from outside. */
#ifndef FOVEA_WEB_RECORDINGS_H
#define FOVEA_WEB_RECORDINGS_H

#include <stddef.h>
#include <stdint.h>

enum { FV_WEB_RECORDINGS_MAX = 256, FV_WEB_RECORDING_NAME_BYTES = 128 };

/* The newest of them as JSON, newest first: [{"name":"...","bytes":1,"utime":1}], in memory of
 * malloc. NULL: no memory. A folder that is not there has none; NULL: null. */
char *fv_web_recordings_json(const char *folder);

/* A descriptor to read it from, and its length now. -1: there is no such recording. */
int fv_web_recording_open(const char *folder, const char *name, uint64_t *bytes);

#endif

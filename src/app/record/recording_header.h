/* The first message of a recording: configuration, rig, masks, loaded map and models as bytes
 * with their hashes, so that a replay needs no other file. */
#ifndef FOVEA_APP_RECORD_RECORDING_HEADER_H
#define FOVEA_APP_RECORD_RECORDING_HEADER_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "app/config/settings.h"
#include "app/network/identity.h"
#include "fovea/source.h"
#include "fovea/status.h"

/* A run as it was before the first iteration of a recording that began in its middle. */
struct fv_recording_middle {
    const uint8_t *state; /* of fovea_state_save */
    size_t state_bytes;
    const struct fovea_config *in_force; /* its live parameters */
};

/* The version that recordings name: that of the interface, with a hash of the sources behind a `+`,
 * since results differ from commit to commit. */
const char *fv_recording_version(void);

/* Encode the header of a run whose settings are complete (rig fitted, masks loaded), as at its
 * start. `identity` may be NULL; `middle` NULL: the recording began with the run. `*data` is the
 * caller's to free. Not for the loop. */
enum fovea_status fv_recording_header_encode(const struct fv_settings *settings,
                                             const struct fv_identity *identity,
                                             const char *kernel_set, bool real_time,
                                             const struct fv_recording_middle *middle,
                                             uint8_t **data, uint32_t *bytes,
                                             struct fovea_error *error);

/* What a header held. */
struct fv_recording_header {
    struct fv_settings settings;
    uint8_t *masks[FOVEA_CAMERAS_MAX]; /* the caller's to free; those of settings.runtime.rig */
    uint8_t *map;                      /* the caller's to free; settings.runtime.map points to it */
    /* the caller's to free, too; settings.runtime.detect.model and .detect2.model point to them */
    void *model, *model2;
    /* Of a recording that began in the middle of its run: its state, the caller's to free, which
     * nothing here checks, and the settings in force, equal to `settings` but for live parameters.
     * NULL: it began with the run. */
    uint8_t *state;
    size_t state_bytes;
    struct fv_settings *in_force; /* the caller's to free */
    bool real_time;
    char version[32], machine[96], kernel_set[32];
    struct fv_identity identity; /* run_id 0: the recording has none */
};

/* Read a header back into complete settings. `name` and `offset` (the message's first byte in the
 * file) are for errors, which name a part whose hash does not fit its bytes, too. Init-only. */
enum fovea_status fv_recording_header_decode(const char *name, int64_t offset, const uint8_t *data,
                                             size_t bytes, struct fv_recording_header *header,
                                             struct fovea_error *error);

#endif

/* A job switched on or off by the configuration key that its row names. */
#ifndef FOVEA_TESTS_COMMON_JOB_SWITCH_H
#define FOVEA_TESTS_COMMON_JOB_SWITCH_H

#include <string.h>

#include "common/detector.h"
#include "runtime/config.h"

static inline bool job_switch_member(enum fv_config_kind kind, void *member, uint32_t value)
{
    if (kind == FV_CONFIG_BOOL) *(bool *)member = value != 0;
    if (kind == FV_CONFIG_U32) *(uint32_t *)member = value;
    return kind == FV_CONFIG_BOOL || kind == FV_CONFIG_U32;
}

/* `value`: 0 is off; where the key is a number, the number, as of frames from one to the next.
 * False where the key is none of the library, or of a kind that is neither a switch nor a number.
 * The program's key detect.model stands for the tests' detector. */
static inline bool job_switch(struct fovea_config *config, enum fovea_job job, uint32_t value)
{
    const char *key = fovea_job_key(job);
    if (strcmp(key, "detect.model") == 0) {
        config->detect.model = value != 0 ? detector_model(&config->detect.model_bytes) : NULL;
        return value == 0 || config->detect.model != NULL;
    }
#define FV_KEY(name, kind, member, min, max, initial, unit, words, cost, help)                     \
    if (strcmp(key, name) == 0) return job_switch_member(FV_CONFIG_##kind, &config->member, value);
#include "runtime/config.def"
    return false;
}

/* All of them on. */
static inline bool job_switch_all(struct fovea_config *config, uint32_t value)
{
    bool good = true;
    for (int job = 0; job < FOVEA_JOB_COUNT; job++)
        good = job_switch(config, (enum fovea_job)job, value) && good;
    return good;
}

#endif

/* Checks of struct fovea_config, from the table of keys in config.def; fovea_config_default in
 * fovea/fovea.h takes its values from there too. */
#ifndef FOVEA_RUNTIME_CONFIG_H
#define FOVEA_RUNTIME_CONFIG_H

#include <stdint.h>

#include "fovea/fovea.h"

/* Kinds of keys, as config.def explains them. */
enum fv_config_kind {
    FV_CONFIG_U32,
    FV_CONFIG_U64,
    FV_CONFIG_I32,
    FV_CONFIG_REAL,
    FV_CONFIG_BOOL,
    FV_CONFIG_TEXT,
    FV_CONFIG_CHOICE,
    FV_CONFIG_FLAGS,
    FV_CONFIG_TRANSFORM,
    FV_CONFIG_LIST
};

/* Give a member its default, and refuse to compile where the member's type is not that of its row.
 */
#define FV_CONFIG_SET_AS(type, at, value)                                                          \
    do {                                                                                           \
        _Static_assert(_Generic((at), type : 1, default : 0), #at " is no " #type);                \
        (at) = (value);                                                                            \
    } while (0)
#define FV_CONFIG_SET_U32(at, max, value) FV_CONFIG_SET_AS(uint32_t, at, value)
#define FV_CONFIG_SET_U64(at, max, value) FV_CONFIG_SET_AS(uint64_t, at, value)
#define FV_CONFIG_SET_I32(at, max, value) FV_CONFIG_SET_AS(int32_t, at, value)
#define FV_CONFIG_SET_REAL(at, max, value) FV_CONFIG_SET_AS(double, at, value)
#define FV_CONFIG_SET_BOOL(at, max, value) FV_CONFIG_SET_AS(bool, at, value)
#define FV_CONFIG_SET_FLAGS(at, max, value) FV_CONFIG_SET_AS(uint32_t, at, value)
#define FV_CONFIG_SET_CHOICE(at, max, value)                                                       \
    do {                                                                                           \
        _Static_assert(sizeof(at) == sizeof(int), #at " is no enum");                              \
        (at) = (value);                                                                            \
    } while (0)
#define FV_CONFIG_SET_TEXT(at, max, value)                                                         \
    do {                                                                                           \
        _Static_assert(sizeof(at) == (max) + 1, #at " does not hold max bytes and a zero");        \
        memcpy(at, value, sizeof(value));                                                          \
    } while (0)
/* A list is a struct of a count and `max` enums, which are of the size of an unsigned int: read as
 * an array of 1 + max of these. It is empty by default. */
#define FV_CONFIG_SET_LIST(at, max, value)                                                         \
    do {                                                                                           \
        _Static_assert(sizeof(at) == ((max) + 1) * sizeof(uint32_t), #at " is no list of max");    \
        (at).count = (value);                                                                      \
    } while (0)
#define FV_CONFIG_SET_TRANSFORM(at, max, value)                                                    \
    do {                                                                                           \
        _Static_assert(sizeof(at) == 12 * sizeof(double), #at " is no transform");                 \
        memcpy(at, value, sizeof(at));                                                             \
    } while (0)

/* Every member against its documented range; `error` names the member, what was found and what was
 * expected. The camera must have been prepared. Init-only. FOVEA_OK or FOVEA_ERROR_ARGUMENT. */
enum fovea_status fv_config_check(const struct fovea_config *config, struct fovea_error *error);

/* The same of the live keys alone (FV_LIVE_KEY): ranges, and limits between them and others.
 * Real-time safe where `error` is NULL. */
enum fovea_status fv_config_check_live(const struct fovea_config *config,
                                       struct fovea_error *error);

/* Copy the values of the live keys. Real-time safe. */
void fv_config_take_live(struct fovea_config *config, const struct fovea_config *from);

/* What keeps the second camera out of odometry, as words after "found"; NULL: nothing, there are
 * two that serve. */
const char *fv_config_stereo_lacks(const struct fovea_rig *rig);
/* Whether odometry uses the inertial sensor. */
bool fv_config_inertial(const struct fovea_config *config);
/* Whether odometry uses two cameras. */
bool fv_config_stereo(const struct fovea_config *config);

/* Whether any class is configured as moving on its own. */
bool fv_config_movable(const struct fovea_config *config);

#endif

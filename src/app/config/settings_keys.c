/* Every key of the configuration: the rows of runtime/config.def with what the program needs of
 * them. */
#include "app/config/settings.h"

#include <string.h>

#include "app/config/map_file.h"
#include "app/network/command_gate.h"
#include "runtime/config.h"

#define WORDS(...) ((const char *const[]){__VA_ARGS__, NULL})
#define NONE NULL
#define ROW(name, kind, member, min, max, unit, words, cost, help, live, host)                     \
    {name,                                                                                         \
     FV_CONFIG_##kind,                                                                             \
     offsetof(struct fv_settings, member),                                                         \
     (int64_t)(min),                                                                               \
     (int64_t)(max),                                                                               \
     (double)(min),                                                                                \
     (double)(max),                                                                                \
     unit,                                                                                         \
     words,                                                                                        \
     help,                                                                                         \
     cost,                                                                                         \
     live,                                                                                         \
     host},
#define FV_APP_KEY(name, kind, member, min, max, value, unit, words, cost, help)                   \
    ROW(name, kind, member, min, max, unit, words, cost, help, false, false)
#define FV_HOST_KEY(name, kind, member, min, max, value, unit, words, cost, help)                  \
    ROW(name, kind, member, min, max, unit, words, cost, help, false, true)
#define FV_KEY(name, kind, member, min, max, value, unit, words, cost, help)                       \
    ROW(name, kind, runtime.member, min, max, unit, words, cost, help, false, false)
#define FV_NAME_KEY(name, kind, member, min, max, value, unit, words, cost, help)                  \
    ROW(name, kind, runtime.member, min, max, unit, words, cost, help, false, true)
#define FV_LIVE_KEY(name, kind, member, min, max, value, unit, words, cost, help)                  \
    ROW(name, kind, runtime.member, min, max, unit, words, cost, help, true, false)

const struct fv_settings_key fv_settings_keys[] = {
#include "runtime/config.def"
};

const size_t fv_settings_key_count = sizeof fv_settings_keys / sizeof fv_settings_keys[0];

_Static_assert(sizeof fv_settings_keys / sizeof fv_settings_keys[0] <= FV_SETTINGS_KEYS_MAX,
               "raise FV_SETTINGS_KEYS_MAX");

const struct fv_settings_key *fv_settings_key_find(const char *name)
{
    for (size_t i = 0; i < fv_settings_key_count; i++)
        if (strcmp(fv_settings_keys[i].name, name) == 0) return &fv_settings_keys[i];
    return NULL;
}

size_t fv_settings_key_bytes(const struct fv_settings_key *key)
{
    switch (key->kind) {
    case FV_CONFIG_U32:
    case FV_CONFIG_I32:
    case FV_CONFIG_CHOICE:
    case FV_CONFIG_FLAGS:
        return sizeof(uint32_t);
    case FV_CONFIG_U64:
        return sizeof(uint64_t);
    case FV_CONFIG_REAL:
        return sizeof(double);
    case FV_CONFIG_BOOL:
        return sizeof(bool);
    case FV_CONFIG_TEXT:
        return (size_t)key->max + 1;
    case FV_CONFIG_LIST:
        return ((size_t)key->max + 1) * sizeof(uint32_t);
    case FV_CONFIG_TRANSFORM:
        return 12 * sizeof(double);
    }
    return 0;
}

void fv_settings_key_copy(const struct fv_settings_key *key, struct fv_settings *settings,
                          const struct fv_settings *from)
{
    memcpy((char *)settings + key->offset, (const char *)from + key->offset,
           fv_settings_key_bytes(key));
}

bool fv_settings_key_differs(const struct fv_settings_key *key, const struct fv_settings *a,
                             const struct fv_settings *b)
{
    return memcmp((const char *)a + key->offset, (const char *)b + key->offset,
                  fv_settings_key_bytes(key)) != 0;
}

void fv_settings_default(struct fv_settings *settings)
{
    memset(settings, 0, sizeof *settings);
    fovea_config_default(&settings->runtime);
#define FV_APP_KEY(name, kind, member, min, max, value, unit, words, cost, help)                   \
    FV_CONFIG_SET_##kind(settings->member, max, value);
#include "runtime/config.def"
}

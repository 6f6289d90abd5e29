/* Configuration: one YAML file, one table of keys (runtime/config.def), one struct.
 *
 * A key is a row of the table: name, type, range, default, unit, what it does and what raising it
 * costs. The library checks its own keys from the same rows, so that it and the program cannot
 * disagree. Values are taken in this order: defaults, the file, `--set`. All of it
 * is init-only. */
#ifndef FOVEA_APP_CONFIG_SETTINGS_H
#define FOVEA_APP_CONFIG_SETTINGS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

#include "fovea/fovea.h"
#include "runtime/config.h"

#ifdef __cplusplus
extern "C" {
#endif

enum fv_rate {
    FV_RATE_AUTO = 0, /* `real` for live sources, `max` for others */
    FV_RATE_MAX = 1,  /* every frame is processed, grants follow the fixed schedule */
    FV_RATE_REAL =
        2 /* frames come by the clock, late ones are dropped, grants come from the governor */
};

/* Where boxes around movable things come from. */
enum fv_movable_boxes { FV_MOVABLE_NONE = 0, FV_MOVABLE_TRUTH = 1 };

enum { FV_SETTINGS_PATH_BYTES = 1024, FV_SETTINGS_KEYS_MAX = 192 };

struct fv_settings {
    struct fovea_config runtime; /* its rig is filled in when the source is open */

    char source[FV_SETTINGS_PATH_BYTES]; /* URI */
    char camera[FV_SETTINGS_PATH_BYTES]; /* calibration file; "": the source's own */
    bool camera_scale;                   /* fit a calibration of another size by scaling it */
    char masks[FOVEA_CAMERAS_MAX][FV_SETTINGS_PATH_BYTES]; /* picture for each camera; "": none */
    char imu[128];                         /* lcm:CHANNEL or iio:NAME; "": none beside the source */
    char imu_file[FV_SETTINGS_PATH_BYTES]; /* of that sensor */
    char map_load[FV_SETTINGS_PATH_BYTES], map_save[FV_SETTINGS_PATH_BYTES],
        map_folder[FV_SETTINGS_PATH_BYTES]; /* "": none */
    uint32_t map_keep;                      /* saved maps */
    bool map_overwrite;                     /* also by one with under half of the landmarks */
    int rate;                               /* enum fv_rate */
    char lcm_url[256];                      /* "": nothing is sent */
    uint32_t lcm_ttl;
    uint32_t pose_fast_rate;                      /* Hz; 0: none */
    char listen[16];                              /* who is heard: network/receiver.h */
    uint32_t commands;                            /* struct fv_command_rules: from_network */
    char command_key[FV_SETTINGS_PATH_BYTES];     /* file; "": none */
    char parameters_file[FV_SETTINGS_PATH_BYTES]; /* "": none */
    char web_socket[96];                          /* path; "": none */
    uint32_t web_picture_rate;                    /* Hz */
    char web_origins[256];                        /* spaces between; "": none */
    /* LCM channel of bot_core.pose_t, for scale.source: wheel_odometry; "": none */
    char wheel_odometry_channel[64];
    /* faster samples are left out; 0: no limit */
    double wheel_odometry_max_m_s, wheel_odometry_max_rad_s;
    int movable_boxes;                              /* enum fv_movable_boxes */
    char record[FV_SETTINGS_PATH_BYTES];            /* "": none */
    char record_folder[FV_SETTINGS_PATH_BYTES];     /* "": none */
    uint32_t record_keep;                           /* of numbered recordings; 0: all */
    uint32_t health_silence_ms;                     /* without a frame: the source has failed */
    char health_state_file[FV_SETTINGS_PATH_BYTES]; /* "": none; "auto": app/run/history.h */
    double health_heat_limit_c;                     /* 0: as the machine states it */
    uint32_t record_buffer;          /* frames that may wait for the disk in real time */
    char movable[256], heights[512]; /* lists of classes (app/classes.h) */
    char grid_floor[512], grid_movable[512], grid_beyond[512], grid_ignored[512]; /* likewise */
    /* "": no detection; the runtime gets its bytes when the source is open */
    char model[FV_SETTINGS_PATH_BYTES], model2[FV_SETTINGS_PATH_BYTES];
    uint32_t priority; /* SCHED_FIFO; 0: ordinary scheduling */
    int32_t cpu;       /* -1: any */
    bool lock_memory;

    /* Where each key was set, by index in the table: 0 default, FV_SETTINGS_SET given by --set,
     * FV_SETTINGS_KEPT in parameters_file, else line of `file`. */
    uint32_t line[FV_SETTINGS_KEYS_MAX];
    char file[FV_SETTINGS_PATH_BYTES];
};

#define FV_SETTINGS_SET UINT32_MAX
#define FV_SETTINGS_KEPT (UINT32_MAX - 1)

void fv_settings_default(struct fv_settings *settings);

/* Read a file, or `bytes` of text that errors call `name`, over what `settings` holds.
 * FOVEA_ERROR_INPUT: `error` names file, line, key, what was found, what was expected and, for an
 * unknown key, the nearest known one; `settings` is then partly changed. */
enum fovea_status fv_settings_read(struct fv_settings *settings, const char *path,
                                   struct fovea_error *error);
enum fovea_status fv_settings_parse(struct fv_settings *settings, const char *name,
                                    const char *text, size_t bytes, struct fovea_error *error);

/* Take one "key=value". */
enum fovea_status fv_settings_set(struct fv_settings *settings, const char *assignment,
                                  struct fovea_error *error);

/* Check what concerns several keys at once, by the runtime's own checks. The camera may still be
 * missing. */
enum fovea_status fv_settings_check(const struct fv_settings *settings, struct fovea_error *error);

/* When an error line starts with a key's name, put before it where that key was set
 * ("robot.yaml:12: "). */
void fv_settings_locate(const struct fv_settings *settings, struct fovea_error *error);

/* The value of `key` led to `error`: when it stands in the file, put file, line and key before the
 * line. */
void fv_settings_blame(const struct fv_settings *settings, const char *key,
                       struct fovea_error *error);

/* Write as YAML that reads back to the same values; with every key's help as comments when
 * `commented`. */
void fv_settings_print(FILE *file, const struct fv_settings *settings, bool commented);

/* Write the reference of all keys as Markdown, with the values of `settings` as the defaults. */
void fv_settings_markdown(FILE *file, const struct fv_settings *settings);
/* The same as the section KEYS of a manual page, on stdout. */
void fv_settings_man(const struct fv_settings *settings);

/* ---- the table, of the rows of runtime/config.def -------------------------------------------- */

struct fv_settings_key {
    const char *name; /* "key" or "section.key"; keys of a section stand together */
    enum fv_config_kind kind;
    size_t offset;    /* in struct fv_settings */
    int64_t min, max; /* of numbers; texts: bytes */
    double real_min, real_max;
    const char *unit;           /* "" where it has none */
    const char *const *choices; /* ended by NULL; CHOICE, FLAGS and LIST only */
    const char *help;           /* what it does */
    const char *cost;           /* of raising it; NULL where there is none */
    bool live;                  /* a step may change it: a live parameter */
    bool host; /* of the host: never taken from a file that is restored (FV_HOST_KEY) */
};

enum { FV_SETTINGS_RANGE_BYTES = 128 };

/* Whether flags may be `auto`: their highest value is then above those of the words. */
bool fv_settings_has_auto(const struct fv_settings_key *key);

/* The key of this name; NULL: there is none. */
const struct fv_settings_key *fv_settings_key_find(const char *name);

/* Bytes of its member. */
size_t fv_settings_key_bytes(const struct fv_settings_key *key);

/* Copy its value. */
void fv_settings_key_copy(const struct fv_settings_key *key, struct fv_settings *settings,
                          const struct fv_settings *from);

/* Whether its values are not the same bytes. */
bool fv_settings_key_differs(const struct fv_settings_key *key, const struct fv_settings *a,
                             const struct fv_settings *b);

/* What the key accepts, in words: "1 to 8 levels", "auto | max | real". */
void fv_settings_range_print(const struct fv_settings_key *key, char *range, size_t bytes);

/* Its value, as YAML. */
void fv_settings_value_print(FILE *file, const struct fv_settings *settings,
                             const struct fv_settings_key *key);
/* The same as text that the caller frees. NULL: no memory. */
char *fv_settings_value_text(const struct fv_settings *settings, const struct fv_settings_key *key);

extern const struct fv_settings_key fv_settings_keys[];
extern const size_t fv_settings_key_count;

#ifdef __cplusplus
}
#endif
#endif

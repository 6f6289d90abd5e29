/* From settings to something that runs: the source opened, the rig with its masks found and
 * fitted. What `fovea run` and `fovea check` share. Init-only. */
#ifndef FOVEA_APP_CONFIG_SETUP_H
#define FOVEA_APP_CONFIG_SETUP_H

#include "support/say.h"
#include "app/config/imu.h"
#include "app/config/model_file.h"
#include "app/config/options.h"
#include "app/config/settings.h"
#include "fovea/source.h"

/* Options that every command with a configuration has. */
struct fv_setup_options {
    const char *config, *source, *camera, *fov, *rate, *record, *model, *map, *save_map;
    struct fv_option_list sets;
};

/* Help of the option --source, and the list of sources that follows a command's help
 * or manual page. */
#define FV_SETUP_SOURCE_HELP "where frames come from (default sim:), one of the sources below"
void fv_setup_sources_print(void);

/* Defaults, then the file, then --set, then the options of their own; all checked. */
enum fovea_status fv_setup_settings(const struct fv_setup_options *options,
                                    struct fv_settings *settings, struct fovea_error *error);

struct fv_setup {
    const struct fovea_source_ops *ops;
    struct fovea_source *source;        /* open, not started */
    uint8_t *masks[FOVEA_CAMERAS_MAX];  /* by camera; NULL: none */
    uint8_t *map;                       /* NULL: none */
    struct fv_model_file model, model2; /* data NULL: none */
    struct fv_iio *iio;                 /* of imu: iio:NAME, open, not started; NULL: none */
};

/* Open settings->source, and fill in settings->runtime: .rig, .map, .detect.model and
 * .detect2.model. FOVEA_ERROR_SYSTEM: the machine's fault; other errors are wrong input. On an
 * error with `ops` but no `source`, it is the source that does not open. What else is there is for
 * fv_setup_close in any case. */
enum fovea_status fv_setup_open(struct fv_settings *settings,
                                const struct fovea_source_selection *selection,
                                struct fv_setup *setup, struct fovea_error *error);
/* Whether this is what fv_setup_open failed for: the source is open but nothing gives its first
 * camera a calibration, which the settings ask for; and the same setup with a rough calibration in
 * its place, by which memory and times can be stated. */
bool fv_setup_lacks_calibration(const struct fv_settings *settings, const struct fv_setup *setup);
enum fovea_status fv_setup_open_rough(struct fv_settings *settings, struct fv_setup *setup,
                                      struct fovea_error *error);
/* The part of it that comes after the source: masks, for the sizes that the cameras of the rig
 * have, and map. */
enum fovea_status fv_setup_read(struct fv_settings *settings, struct fv_setup *setup,
                                struct fovea_error *error);
/* Open and read all files that the settings name, and close them again: calibration, network,
 * mask, map, and the source where it is no camera. */
enum fovea_status fv_setup_check_files(struct fv_settings *settings, struct fovea_error *error);
/* What a start with `next` would find, with the source that is open now, of which `info` tells, and
 * inertial sensors as they are: calibration, network, masks and map are read, and the size of the
 * block is asked for. `kept`: the calibration that will be kept in place of the file that `camera`
 * names; NULL: none. Keys with a line are those of parameters.file. Not on a thread that may not
 * wait for the disk. */
enum fovea_status fv_setup_check_next(const struct fv_settings *next,
                                      const struct fovea_source_info *info,
                                      const struct fovea_camera *kept, struct fovea_error *error);
/* The source alone, with its memory; the rest stays. */
void fv_setup_close_source(struct fv_setup *setup);
void fv_setup_close(struct fv_setup *setup);

/* Whether there is a network that takes colour. Recordings that have colours then give them. */
bool fv_setup_wants_colour(const struct fv_setup *setup);
/* Whether white balance would change what a network sees of the source that `info` describes, named
 * `source`. FOVEA_ERROR_ARGUMENT: nothing, and why. */
enum fovea_status fv_setup_check_balance(const struct fv_setup *setup,
                                         const struct fovea_source_info *info, const char *source,
                                         struct fovea_error *error);

/* Whether frames come by the clock, and the bytes of one, its rows as wide as the source states
 * (fovea_source_camera). */
bool fv_setup_real_time(const struct fv_settings *settings, const struct fv_setup *setup);
size_t fv_setup_frame_bytes(const struct fv_setup *setup);

/* The exit status that goes with an error: FV_EXIT_FAILED for FOVEA_ERROR_SYSTEM and
 * FOVEA_ERROR_MEMORY, else FV_EXIT_WRONG. */
enum fv_exit fv_setup_exit(enum fovea_status status);

#endif

/* Files of a run: that nothing which is read is written over, and that all can be written. */
#include "app/run/run.h"

#include <stdio.h>
#include <string.h>

#include "app/config/map_file.h"
#include "app/network/transport_url.h"
#include "app/record/recording_file.h"
#include "app/run/grid_file.h"
#include "support/files.h"
#include "support/picture.h"
#include "support/say.h"

enum {
    MAPS_MAX = 2 * FV_MAP_FILE_KEEP_MAX,
    WRITTEN_MAX = 13,
    WRITTEN_RECORD = 0,
    MAP_NAME_BYTES = FV_SETTINGS_PATH_BYTES + 16
};

/* What a run writes: files named by options, then the map with its older ones. */
struct written {
    struct fv_file files[WRITTEN_MAX + MAPS_MAX + 1];
    char log[FV_TRANSPORT_URL_BYTES];
    char heights[FV_GRID_FILE_PATH_BYTES];
    char maps[MAPS_MAX][MAP_NAME_BYTES];
};

_Static_assert(WRITTEN_MAX + MAPS_MAX <= FV_FILES_WATCHED_MAX, "raise FV_FILES_WATCHED_MAX");

static int list_written(const struct fv_run *run, struct written *written)
{
    const char *kept = run->settings.parameters_file, *history = run->settings.health_state_file;
    const bool drawn = run->picture_path != NULL && strcmp(run->picture_path, "none") != 0;
    const struct fv_file files[] = {
        {"--record", run->settings.record},
        {"--stats", run->stats_path},
        {"--trajectory", run->trajectory_path},
        {"--trajectory-final", run->final_path},
        {"--truth", run->truth_path},
        {"--picture", drawn ? run->picture_path : NULL},
        {"--detections", run->detections_path},
        {"--objects", run->objects_path},
        {"--grid", run->grid_path},
        {"parameters.file", kept[0] != '\0' ? kept : NULL},
        {"health.state_file", history[0] != '\0' && strcmp(history, "auto") != 0 ? history : NULL},
    };
    int count = sizeof files / sizeof files[0];
    memset(written->files, 0, sizeof written->files);
    memcpy(written->files, files, sizeof files);
    if (run->grid_path != NULL && run->settings.runtime.grid_job.grid.heights &&
        fv_grid_file_heights(run->grid_path, written->heights))
        written->files[count++] = (struct fv_file){"--grid", written->heights};
    if (fv_transport_file(run->settings.lcm_url, written->log))
        written->files[count++] = (struct fv_file){"lcm_url", written->log};
    return count;
}

/* MAP, MAP.1 ..., MAP.small, MAP.small.1 ...: behind the `count` rows that are there. */
static void list_maps(const struct fv_run *run, struct written *written, int count)
{
    const char *const ends[] = {"", FV_MAP_FILE_SMALL};
    if (run->settings.map_save[0] == '\0') return;
    for (uint32_t i = 0, n = 0; i < 2; i++)
        for (uint32_t older = 0; older < run->settings.map_keep && n < MAPS_MAX; older++, n++) {
            char *name = written->maps[n];
            int length = snprintf(name, MAP_NAME_BYTES, "%s%s", run->settings.map_save, ends[i]);
            if (older > 0)
                snprintf(name + length, MAP_NAME_BYTES - (size_t)length, ".%u", (unsigned)older);
            written->files[count++] = (struct fv_file){"--save-map", name};
        }
}

/* Each name of the maps apart from `others`, not from the other maps: after a death in a save two
 * of them may be one file. */
static enum fovea_status maps_apart(const struct fv_file *maps, const struct fv_file *others,
                                    struct fovea_error *error)
{
    enum fovea_status status = FOVEA_OK;
    for (; maps->option != NULL && status == FOVEA_OK; maps++)
        status = fv_files_apart((const struct fv_file[]){*maps, {0}}, others, error);
    return status;
}

/* A map may be saved again where it was loaded from: the next save keeps it as an older one. One
 * loaded from another of the names would be renamed away from there, or lost. */
static enum fovea_status loaded_apart(const struct fv_run *run, const struct fv_file *outputs,
                                      const struct fv_file *maps, struct fovea_error *error)
{
    const struct fv_file loaded[] = {{"--map", run->settings.map_load}, {0}};
    const enum fovea_status status = fv_files_apart(outputs, loaded, error);
    if (status != FOVEA_OK || fv_files_same(run->settings.map_load, run->settings.map_save, true))
        return status;
    return maps_apart(maps, loaded, error);
}

/* The picture that nobody asked for is left out where it would be in the way. */
static void leave_picture_out(struct fv_run *run, const struct fovea_error *reason)
{
    fv_say("fovea run: no picture is drawn: %s", reason->text);
    run->picture_path = "none";
}

static const struct fv_file unasked_picture[] = {{"the picture", FV_RUN_PICTURE_FILE}, {0}};

static bool picture_is_unasked(const struct fv_run *run)
{
    return run->picture_path == NULL && fv_run_draws(run);
}

static void picture_apart(struct fv_run *run, const struct fv_file *const others[], int lists)
{
    struct fovea_error error;
    for (int i = 0; i < lists && picture_is_unasked(run); i++)
        if (fv_files_apart(unasked_picture, others[i], &error) != FOVEA_OK)
            leave_picture_out(run, &error);
}

enum fovea_status fv_run_files_apart(struct fv_run *run, struct fovea_error *error)
{
    struct written written, saved = {0};
    const char *address = strchr(run->settings.source, ':');
    list_written(run, &written);
    const struct fv_file read[] = {
        {"--source", address != NULL ? address + 1 : NULL},
        {"--config", run->options.config},
        {"--camera", run->settings.camera},
        {"imu_file", run->settings.imu_file},
        {"mask", run->settings.masks[0]},
        {"mask2", run->settings.masks[1]},
        {"mask3", run->settings.masks[2]},
        {"mask4", run->settings.masks[3]},
        {"--model", run->settings.model},
        {"detect2.model", run->settings.model2},
        {"command_key", run->settings.command_key},
        {0},
    };
    list_maps(run, &saved, 0);
    enum fovea_status status = fv_files_apart(written.files, read, error);
    if (status == FOVEA_OK) status = fv_files_apart(written.files, saved.files, error);
    if (status == FOVEA_OK) status = maps_apart(saved.files, read, error);
    if (status == FOVEA_OK) status = loaded_apart(run, written.files, saved.files, error);
    if (status == FOVEA_OK) {
        const struct fv_file loaded[] = {{"--map", run->settings.map_load}, {0}};
        const struct fv_file *const others[] = {written.files, saved.files, read, loaded};
        picture_apart(run, others, sizeof others / sizeof others[0]);
    }
    if (status != FOVEA_OK || run->settings.map_save[0] == '\0') return status;
    status = fv_map_file_probe(run->settings.map_save, error);
    if (status != FOVEA_OK) fv_settings_blame(&run->settings, "map.save", error);
    return status;
}

static void picture_apart_from_source(struct fv_run *run)
{
    struct fovea_error error;
    struct fv_files_watch watch;
    if (!picture_is_unasked(run)) return;
    fv_files_watch(&watch, unasked_picture, "--source", &error);
    run->setup.ops->reads(run->setup.source, fv_files_visit, &watch);
    if (watch.status != FOVEA_OK) leave_picture_out(run, &error);
}

static enum fovea_status pictures_named(const struct written *written, struct fovea_error *error)
{
    enum fovea_status status = FOVEA_OK;
    for (const struct fv_file *file = written->files;
         status == FOVEA_OK && file - written->files < WRITTEN_MAX; file++)
        if (file->option != NULL &&
            (strcmp(file->option, "--picture") == 0 || strcmp(file->option, "--grid") == 0))
            status = fv_picture_check_name(file->option, file->path, error);
    return status;
}

enum fovea_status fv_run_files_source(struct fv_run *run, struct fovea_error *error)
{
    struct written written;
    struct fv_files_watch watch;
    char added[FV_SETTINGS_PATH_BYTES + 2];
    if (run->setup.ops->reads != NULL) picture_apart_from_source(run);
    const int count = list_written(run, &written);
    if (run->setup.ops->reads == NULL) return pictures_named(&written, error);
    list_maps(run, &written, count);
    /* A numbered recording replaces none: only the removal of old ones can meet a file of the
     * source. Without it one file is added to the folder, which the source may not take whole. */
    if (fv_recording_file_numbered(run->settings.record) && run->settings.record_keep == 0) {
        snprintf(added, sizeof added, "%s.", run->settings.record);
        written.files[WRITTEN_RECORD].path = added;
    }
    fv_files_watch(&watch, written.files, "--source", error);
    run->setup.ops->reads(run->setup.source, fv_files_visit, &watch);
    return watch.status == FOVEA_OK ? pictures_named(&written, error) : watch.status;
}

/* Better said now than after an hour, and before any result of an earlier run is cut. */
enum fv_exit fv_run_files_check(const struct fv_run *run)
{
    struct fovea_error error;
    struct written written;
    const char *blame;
    if (run->detections_path != NULL && run->settings.model[0] == '\0')
        return fv_say_wrong("fovea run: --detections: found no network, expected --model FILE");
    if (run->objects_path != NULL && run->settings.model[0] == '\0')
        return fv_say_wrong("fovea run: --objects: found no network, expected --model FILE");
    if (run->grid_path != NULL && !run->settings.runtime.grid_job.enabled)
        return fv_say_wrong("fovea run: --grid: found no grid, expected grid.enabled true");
    if (!run->settings.runtime.odometry.enabled &&
        (run->trajectory_path != NULL || run->final_path != NULL))
        return fv_say_wrong(
            "fovea run: --trajectory%s: found no odometry, expected odometry.enabled true",
            run->trajectory_path != NULL ? "" : "-final");
    list_written(run, &written);
    for (const struct fv_file *file = written.files + 1; file->option != NULL; file++)
        if (file->path != NULL && file->path[0] == '\0')
            return fv_say_wrong("fovea run: %s: found '', expected a file", file->option);
    for (const struct fv_file *file = written.files + 1; file->option != NULL; file++)
        if (file->path != NULL && file->path[strlen(file->path) - 1] == '/' &&
            strncmp(file->option, "--trajectory", 12) != 0)
            return fv_say_wrong("fovea run: %s: found the folder '%s', expected a file",
                                file->option, file->path);
    if (fv_files_writable(written.files, &blame, &error) == FOVEA_OK) return FV_EXIT_OK;
    if (run->options.record == NULL && strcmp(blame, "--record") == 0) {
        fv_settings_blame(&run->settings, "record", &error);
        return fv_say_wrong("%s", error.text);
    }
    return fv_say_wrong("fovea run: %s: %s", blame, error.text);
}

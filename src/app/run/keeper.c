#include "app/run/keeper.h"

#include <stdlib.h>

#include "app/config/map_file.h"
#include "support/aligned.h"
#include "support/say.h"

static bool keeps(const struct fv_keeper *keeper)
{
    return keeper->settings->map_save[0] != '\0' && keeper->settings->runtime.odometry.enabled;
}

enum fovea_status fv_keeper_open(struct fv_keeper *keeper, struct fovea *rt,
                                 const struct fv_settings *settings, struct fovea_error *error)
{
    keeper->rt = rt;
    keeper->settings = settings;
    if (!keeps(keeper)) return FOVEA_OK;
    keeper->capacity = fovea_map_bytes_max(&settings->runtime);
    keeper->buffer = fv_aligned_zeroed(keeper->capacity);
    if (keeper->buffer != NULL) return FOVEA_OK;
    return fovea_error_set(error, FOVEA_ERROR_MEMORY,
                           "%.200s: no memory to save the map (%zu bytes)", settings->map_save,
                           keeper->capacity);
}

void fv_keeper_close(struct fv_keeper *keeper)
{
    free(keeper->buffer);
    keeper->buffer = NULL;
}

/* ---- loop thread ----------------------------------------------------------------------------- */

uint32_t fv_keeper_commands(struct fv_keeper *keeper, uint32_t commands)
{
    const uint32_t ours = FOVEA_COMMAND_SAVE | FOVEA_COMMAND_OVERWRITE;
    if (commands & FOVEA_COMMAND_SAVE) {
        keeper->asked = true;
        keeper->overwrite = (commands & FOVEA_COMMAND_OVERWRITE) != 0;
    }
    commands &= ~ours;
    if (!keeper->asked || atomic_load(&keeper->stage) != FV_KEEPER_IDLE) return commands;
    keeper->asked = false;
    if (keeper->buffer == NULL) {
        atomic_store(&keeper->unnamed, true);
        return commands;
    }
    keeper->overwrites = keeper->overwrite;
    keeper->begun++;
    fovea_map_save_to(keeper->rt, keeper->buffer, keeper->capacity);
    atomic_store(&keeper->stage, FV_KEEPER_FILLING);
    return commands | FOVEA_COMMAND_SAVE;
}

uint32_t fv_keeper_next(const struct fv_keeper *keeper)
{
    return keeper->buffer != NULL ? keeper->begun + 1 : 0;
}

uint32_t fv_keeper_ended(const struct fv_keeper *keeper, const char **failure)
{
    const bool idle = atomic_load(&keeper->stage) == FV_KEEPER_IDLE;
    if (failure != NULL) *failure = idle ? keeper->failure.text : "";
    return idle ? keeper->begun : keeper->begun - 1;
}

void fv_keeper_work(struct fv_keeper *keeper, const struct fovea_outputs *outputs)
{
    if (outputs->map_bytes == 0 || atomic_load(&keeper->stage) != FV_KEEPER_FILLING) return;
    fovea_map_save_to(keeper->rt, NULL, 0);
    keeper->bytes = outputs->map_bytes;
    atomic_store(&keeper->stage, FV_KEEPER_FULL);
}

/* ---- watching thread ------------------------------------------------------------------------- */

static void say_beside(const char *path, const struct fv_map_file_saved *saved)
{
    if (saved->there.has_grid && !saved->map.has_grid)
        fv_say(
            "%s: found a grid of free space in this map and none in the new one: the new one is saved as %s" FV_MAP_FILE_SMALL
            "; grid.enabled: true takes the grid up, map.overwrite: true replaces the other",
            path, path);
    else
        fv_say(
            "%s: found %u landmarks in this map and %u in the new one, less than half: the new one is saved as %s" FV_MAP_FILE_SMALL
            "; map.overwrite: true replaces the other",
            path, (unsigned)saved->there.landmarks, (unsigned)saved->map.landmarks, path);
}

static enum fovea_status save(const struct fv_keeper *keeper, bool overwrite, size_t bytes,
                              struct fovea_error *error)
{
    const struct fv_settings *settings = keeper->settings;
    const struct fv_map_file_rules rules = {settings->map_keep,
                                            overwrite || settings->map_overwrite};
    struct fv_map_file_saved saved;
    const enum fovea_status status =
        fv_map_file_save(settings->map_save, &rules, keeper->buffer, bytes, &saved, error);
    if (status == FOVEA_OK && saved.beside) say_beside(settings->map_save, &saved);
    return status;
}

static void write_full(struct fv_keeper *keeper)
{
    struct fovea_error error;
    fovea_map_seal(keeper->buffer, keeper->bytes);
    keeper->failure.text[0] = '\0';
    if (save(keeper, keeper->overwrites, keeper->bytes, &error) != FOVEA_OK) {
        keeper->failure = error;
        fv_say("%s", error.text);
    }
    atomic_store(&keeper->stage, FV_KEEPER_IDLE);
}

void fv_keeper_tend(struct fv_keeper *keeper)
{
    if (atomic_load(&keeper->stage) == FV_KEEPER_FULL) write_full(keeper);
    if (atomic_exchange(&keeper->unnamed, false))
        fv_say("fovea run: asked to save the map, but map.save names no file");
}

enum fovea_status fv_keeper_end(struct fv_keeper *keeper, struct fovea_error *error)
{
    if (!keeps(keeper)) return FOVEA_OK;
    if (keeper->stage == FV_KEEPER_FULL) write_full(keeper);
    /* A save that is asked for and has not ended is this one. */
    const bool overwrite = (keeper->asked && keeper->overwrite) ||
                           (keeper->stage == FV_KEEPER_FILLING && keeper->overwrites);
    const size_t bytes = fovea_map_save(keeper->rt, keeper->buffer, keeper->capacity);
    if (bytes == 0)
        return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "%.200s: found no map to save",
                               keeper->settings->map_save);
    return save(keeper, overwrite, bytes, error);
}

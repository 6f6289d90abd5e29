#include "app/keeper.h"

#include <stdlib.h>

#include "app/map_file.h"
#include "app/say.h"

static bool keeps(const struct fv_keeper *keeper)
{
    return keeper->path != NULL && keeper->path[0] != '\0' && keeper->config->odometry.enabled;
}

uint32_t fv_keeper_commands(struct fv_keeper *keeper, uint32_t commands)
{
    if (commands & FOVEA_COMMAND_SAVE) atomic_store(&keeper->asked, true);
    commands &= ~(uint32_t)FOVEA_COMMAND_SAVE;
    if (atomic_load(&keeper->stage) != FV_KEEPER_READY) return commands;
    fovea_map_save_to(keeper->rt, keeper->buffer, keeper->capacity);
    atomic_store(&keeper->stage, FV_KEEPER_FILLING);
    return commands | FOVEA_COMMAND_SAVE;
}

void fv_keeper_work(struct fv_keeper *keeper, const struct fovea_outputs *outputs)
{
    if (outputs->map_bytes == 0 || atomic_load(&keeper->stage) != FV_KEEPER_FILLING) return;
    fovea_map_save_to(keeper->rt, NULL, 0);
    keeper->bytes = outputs->map_bytes;
    atomic_store(&keeper->stage, FV_KEEPER_FULL);
}

static void give_back(struct fv_keeper *keeper)
{
    free(keeper->buffer);
    keeper->buffer = NULL;
    atomic_store(&keeper->stage, FV_KEEPER_IDLE);
}

static void write_full(struct fv_keeper *keeper)
{
    struct fovea_error error;
    fovea_map_seal(keeper->buffer, keeper->bytes);
    if (fv_map_file_write(keeper->path, keeper->buffer, keeper->bytes, &error) != FOVEA_OK)
        fv_say("%s", error.text);
    give_back(keeper);
}

void fv_keeper_tend(struct fv_keeper *keeper)
{
    if (atomic_load(&keeper->stage) == FV_KEEPER_FULL) write_full(keeper);
    if (atomic_load(&keeper->stage) != FV_KEEPER_IDLE || !atomic_exchange(&keeper->asked, false))
        return;
    if (!keeps(keeper)) {
        fv_say("fovea run: asked to save the map, but map.save names no file");
        return;
    }
    keeper->capacity = fovea_map_bytes_max(keeper->config);
    keeper->buffer = malloc(keeper->capacity);
    if (keeper->buffer == NULL)
        fv_say("%s: no memory to save the map (%zu bytes)", keeper->path, keeper->capacity);
    else
        atomic_store(&keeper->stage, FV_KEEPER_READY);
}

enum fovea_status fv_keeper_end(struct fv_keeper *keeper, struct fovea_error *error)
{
    if (keeper->stage == FV_KEEPER_FULL) write_full(keeper);
    give_back(keeper);
    if (!keeps(keeper)) return FOVEA_OK;
    const size_t capacity = fovea_map_bytes_max(keeper->config);
    uint8_t *buffer = malloc(capacity);
    const size_t bytes = buffer == NULL ? 0 : fovea_map_save(keeper->rt, buffer, capacity);
    enum fovea_status status = FOVEA_OK;
    if (bytes == 0)
        status = fovea_error_set(error, FOVEA_ERROR_SYSTEM,
                                 "%.200s: no memory to save the map (%zu bytes)", keeper->path,
                                 capacity);
    else
        status = fv_map_file_write(keeper->path, buffer, bytes, error);
    free(buffer);
    return status;
}

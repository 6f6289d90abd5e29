#include "base/arena.h"

#include <string.h>

void fv_arena_count(struct fv_arena *arena)
{
    *arena = (struct fv_arena){.base = NULL, .capacity = SIZE_MAX};
}

void fv_arena_init(struct fv_arena *arena, void *base, size_t capacity)
{
    *arena = (struct fv_arena){.base = base, .capacity = capacity};
}

enum fovea_status fv_arena_check_block(const void *memory, size_t bytes, size_t needed,
                                       struct fovea_error *error)
{
    if (memory == NULL || (uintptr_t)memory % FV_CACHE_LINE_BYTES != 0)
        return fovea_error_set(error, FOVEA_ERROR_MEMORY,
                               "memory: found address %p, expected a multiple of %d", memory,
                               FV_CACHE_LINE_BYTES);
    if (bytes < needed)
        return fovea_error_set(error, FOVEA_ERROR_MEMORY,
                               "memory: found %zu bytes, expected at least %zu", bytes, needed);
    return FOVEA_OK;
}

void *fv_arena_take_raw(struct fv_arena *arena, size_t count, size_t size)
{
    const size_t line = FV_CACHE_LINE_BYTES;
    if (size != 0 && count > (SIZE_MAX / 2 - line) / size) {
        arena->exhausted = true;
        return NULL;
    }
    const size_t bytes = (count * size + line - 1) / line * line;
    if (bytes > arena->capacity - arena->used) {
        arena->exhausted = true;
        return NULL;
    }
    const size_t offset = arena->used;
    arena->used += bytes;
    return arena->base == NULL ? NULL : arena->base + offset;
}

void *fv_arena_take(struct fv_arena *arena, size_t count, size_t size)
{
    void *piece = fv_arena_take_raw(arena, count, size);
    if (piece != NULL && !arena->keep) memset(piece, 0, count * size);
    return piece;
}

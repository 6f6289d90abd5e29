/* Arena: hands out pieces of one block that the caller owns, front to back; nothing is given back.
 *
 * The same carving code runs in three modes, so that they cannot disagree: counting (base NULL),
 * which yields the size; building, on memory to be zeroed; and rebasing, on a block that was copied
 * from elsewhere and whose contents stay, where carving only finds the addresses again. So carving
 * code assigns addresses and nothing else: a piece is NULL when counting, and keeps its old
 * contents when rebasing. Pieces are cache-line aligned and stay where they are for the arena's
 * life. Cost: constant, except for the zeroing. */
#ifndef FOVEA_BASE_ARENA_H
#define FOVEA_BASE_ARENA_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "fovea/status.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { FV_CACHE_LINE_BYTES = 64 };

struct fv_arena {
    uint8_t *base;   /* NULL: counting */
    size_t capacity; /* bytes at base; SIZE_MAX when counting */
    size_t used;     /* bytes handed out, padding included */
    bool exhausted;  /* a piece did not fit; stays so */
    bool keep;       /* rebasing: pieces are not zeroed */
};

void fv_arena_count(struct fv_arena *arena);
void fv_arena_init(struct fv_arena *arena, void *base, size_t capacity);

/* Whether a block that a caller hands over can hold `needed` bytes, and begins at a cache line.
 * FOVEA_ERROR_MEMORY: `error` (NULL: none) says what was found and what was expected. */
enum fovea_status fv_arena_check_block(const void *memory, size_t bytes, size_t needed,
                                       struct fovea_error *error);

/* `count` elements of `size` bytes, zeroed unless rebasing. NULL when counting, or when it does not
 * fit (then arena->exhausted is set). Real-time safe. */
void *fv_arena_take(struct fv_arena *arena, size_t count, size_t size);

/* The same without zeroing, for large scratch that is written before it is read. */
void *fv_arena_take_raw(struct fv_arena *arena, size_t count, size_t size);

#ifdef __cplusplus
}
#endif
#endif

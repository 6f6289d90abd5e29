#include "features/strongest.h"

void fv_strongest_carve(struct fv_strongest *strongest, uint32_t room, struct fv_arena *arena)
{
    strongest->room = room;
    strongest->keys = fv_arena_take(arena, room, sizeof *strongest->keys);
}

void fv_strongest_begin(struct fv_strongest *strongest)
{
    strongest->count = 0;
}

/* Let the element at `at` sink in a heap whose first element is the smallest. */
static void sink(uint64_t *heap, uint32_t count, uint32_t at)
{
    const uint64_t moved = heap[at];
    for (uint32_t child; (child = 2 * at + 1) < count; at = child) {
        if (child + 1 < count && heap[child + 1] < heap[child]) child++;
        if (moved <= heap[child]) break;
        heap[at] = heap[child];
    }
    heap[at] = moved;
}

void fv_strongest_offer(struct fv_strongest *strongest, uint32_t response, int32_t x, int32_t y)
{
    /* One number orders corners. */
    const uint64_t key = (uint64_t)response << 32 | (uint32_t) ~((uint32_t)y << 16 | (uint32_t)x);
    uint64_t *heap = strongest->keys;
    if (strongest->count == strongest->room) {
        if (key <= heap[0]) return;
        heap[0] = key;
        sink(heap, strongest->room, 0);
        return;
    }
    uint32_t at = strongest->count++;
    for (; at > 0 && heap[(at - 1) / 2] > key; at = (at - 1) / 2)
        heap[at] = heap[(at - 1) / 2];
    heap[at] = key;
}

void fv_strongest_sort(struct fv_strongest *strongest)
{
    uint64_t *heap = strongest->keys;
    for (uint32_t left = strongest->count; left > 1; left--) {
        const uint64_t last = heap[0];
        heap[0] = heap[left - 1];
        heap[left - 1] = last;
        sink(heap, left - 1, 0);
    }
}

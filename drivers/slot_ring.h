/* Slot numbers between two threads: one pushes, the other pops; never more than FV_SLOT_RING_SLOTS
 * inside. */
#ifndef FOVEA_DRIVERS_SLOT_RING_H
#define FOVEA_DRIVERS_SLOT_RING_H

#include <stdatomic.h>
#include <stdbool.h>
#include <stdint.h>

enum { FV_SLOT_RING_SLOTS = 8 };

struct fv_slot_ring { /* NOLINT(clang-analyzer-optin.performance.Padding): a cache line for each
                         writer */
    _Atomic uint32_t head;
    uint8_t slots[FV_SLOT_RING_SLOTS];
    _Alignas(64) _Atomic uint32_t tail;
};

static inline void fv_slot_ring_push(struct fv_slot_ring *ring, uint8_t slot)
{
    const uint32_t head = atomic_load_explicit(&ring->head, memory_order_relaxed);
    ring->slots[head % FV_SLOT_RING_SLOTS] = slot;
    atomic_store_explicit(&ring->head, head + 1, memory_order_release);
}

static inline bool fv_slot_ring_pop(struct fv_slot_ring *ring, uint8_t *slot)
{
    const uint32_t tail = atomic_load_explicit(&ring->tail, memory_order_relaxed);
    if (tail == atomic_load_explicit(&ring->head, memory_order_acquire)) return false;
    *slot = ring->slots[tail % FV_SLOT_RING_SLOTS];
    atomic_store_explicit(&ring->tail, tail + 1, memory_order_release);
    return true;
}

#endif

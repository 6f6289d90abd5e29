#include "base/ring.h"

void fv_ring_init(struct fv_ring *ring, void *memory, size_t capacity)
{
    ring->memory = memory;
    ring->capacity = capacity;
    ring->reserved_at = 0;
    atomic_init(&ring->head, 0);
    atomic_init(&ring->end, capacity);
    atomic_init(&ring->tail, 0);
}

/* Room after head in one piece, and at the start of the memory. head == tail means empty, so a byte
 * stays free. */
static void room(struct fv_ring *ring, size_t *after, size_t *front)
{
    size_t head = atomic_load_explicit(&ring->head, memory_order_relaxed);
    size_t tail = atomic_load_explicit(&ring->tail, memory_order_acquire);
    if (head >= tail) {
        *after = ring->capacity - head - (tail == 0 ? 1 : 0);
        *front = tail > 0 ? tail - 1 : 0;
    } else {
        *after = tail - head - 1;
        *front = 0;
    }
}

uint8_t *fv_ring_reserve(struct fv_ring *ring, size_t bytes)
{
    size_t after, front;
    room(ring, &after, &front);
    if (bytes <= after)
        ring->reserved_at = atomic_load_explicit(&ring->head, memory_order_relaxed);
    else if (bytes <= front)
        ring->reserved_at = 0;
    else
        return NULL;
    return ring->memory + ring->reserved_at;
}

void fv_ring_commit(struct fv_ring *ring, size_t bytes)
{
    size_t head = atomic_load_explicit(&ring->head, memory_order_relaxed);
    if (bytes == 0) return;
    if (ring->reserved_at != head)
        atomic_store_explicit(&ring->end, head, memory_order_relaxed); /* seen with the new head */
    atomic_store_explicit(&ring->head, ring->reserved_at + bytes, memory_order_release);
}

const uint8_t *fv_ring_peek(struct fv_ring *ring, size_t *bytes)
{
    size_t head = atomic_load_explicit(&ring->head, memory_order_acquire);
    size_t tail = atomic_load_explicit(&ring->tail, memory_order_relaxed);
    if (tail > head) { /* the producer has wrapped: first what lies before the wrap */
        size_t end = atomic_load_explicit(&ring->end, memory_order_relaxed);
        if (tail < end) {
            *bytes = end - tail;
            return ring->memory + tail;
        }
        tail = 0;
        atomic_store_explicit(&ring->tail, 0, memory_order_release);
    }
    if (tail == head) return NULL;
    *bytes = head - tail;
    return ring->memory + tail;
}

void fv_ring_release(struct fv_ring *ring, size_t bytes)
{
    size_t tail = atomic_load_explicit(&ring->tail, memory_order_relaxed);
    atomic_store_explicit(&ring->tail, tail + bytes, memory_order_release);
}

size_t fv_ring_room(struct fv_ring *ring)
{
    size_t after, front;
    room(ring, &after, &front);
    return after > front ? after : front;
}

bool fv_ring_empty(const struct fv_ring *ring)
{
    return atomic_load_explicit(&ring->tail, memory_order_acquire) ==
           atomic_load_explicit(&ring->head, memory_order_relaxed);
}

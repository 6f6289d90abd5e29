/* Byte ring between one producer thread and one consumer thread, wait-free on both sides.
 *
 * Records are contiguous: the producer reserves room, writes, commits; the consumer sees whole
 * commits only, in order. Where a record does not fit before the end of the memory, the rest there
 * is left unused until the consumer has passed it (a bip buffer, after S. Cooke, 2003). A
 * reservation may fail although as many bytes are free in two pieces; one of at most half the
 * capacity always fits into an empty ring.
 *
 * Memory is the caller's. Real-time safe; each side from one thread at a time. */
#ifndef FOVEA_BASE_RING_H
#define FOVEA_BASE_RING_H

#ifdef __cplusplus
#error "the ring uses C11 atomics: C only"
#endif

#include <stdatomic.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

struct fv_ring {
    uint8_t *memory;
    size_t capacity;

    /* Offsets into memory. `head` is written by the producer, `tail` by the consumer; equal: empty.
     * `end` is where data stops before the wrap; it is written by the producer before head wraps.
     */
    _Alignas(64) atomic_size_t head;
    atomic_size_t end;
    size_t reserved_at; /* the producer's own */
    _Alignas(64) atomic_size_t tail;
};

void fv_ring_init(struct fv_ring *ring, void *memory, size_t capacity);

/* Producer: room for `bytes` in one piece, or NULL. Nothing is taken until the commit; a new
 * reservation replaces an old one. */
uint8_t *fv_ring_reserve(struct fv_ring *ring, size_t bytes);
/* Producer: hand over the first `bytes` of what was reserved. */
void fv_ring_commit(struct fv_ring *ring, size_t bytes);

/* Consumer: the oldest bytes that are in one piece, `*bytes` of them (whole commits), or NULL when
 * empty. */
const uint8_t *fv_ring_peek(struct fv_ring *ring, size_t *bytes);
/* Consumer: give back the first `bytes` of what was peeked. */
void fv_ring_release(struct fv_ring *ring, size_t bytes);

/* Largest reservation that would succeed now. Either side; from the consumer's side it is a lower
 * bound only when the producer is idle. */
size_t fv_ring_room(struct fv_ring *ring);
/* Producer: whether all that was committed has been given back. */
bool fv_ring_empty(const struct fv_ring *ring);

#endif

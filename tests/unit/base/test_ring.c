/* The byte ring: order and content survive wraps; one thread against another; a full ring refuses.
 */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>
#include <pthread.h>
#include <sched.h>

#include <cmocka.h>

#include "base/ring.h"

static void test_fill_and_drain(void **state)
{
    (void)state;
    static uint8_t memory[100];
    struct fv_ring ring;
    size_t bytes;
    fv_ring_init(&ring, memory, sizeof memory);
    assert_null(fv_ring_peek(&ring, &bytes));
    assert_null(fv_ring_reserve(&ring, 100)); /* one byte tells full from empty */
    for (int i = 0; i < 3; i++) {
        uint8_t *room = fv_ring_reserve(&ring, 33);
        assert_non_null(room);
        memset(room, i, 33);
        fv_ring_commit(&ring, 33);
    }
    assert_null(fv_ring_reserve(&ring, 1));
    assert_int_equal(fv_ring_room(&ring), 0);
    assert_false(fv_ring_empty(&ring));
    const uint8_t *data = fv_ring_peek(&ring, &bytes);
    assert_int_equal(bytes, 99);
    assert_int_equal(data[98], 2);
    fv_ring_release(&ring, 33);
    assert_int_equal(fv_ring_room(&ring), 32);
    assert_null(fv_ring_reserve(&ring, 33));
    uint8_t *room = fv_ring_reserve(&ring, 32); /* before the tail */
    assert_ptr_equal(room, memory);
    memset(room, 7, 32);
    fv_ring_commit(&ring, 32);
    assert_null(fv_ring_reserve(&ring, 1));
    data = fv_ring_peek(&ring, &bytes);
    assert_int_equal(bytes, 66);
    fv_ring_release(&ring, bytes);
    data = fv_ring_peek(&ring, &bytes);
    assert_ptr_equal(data, memory);
    assert_int_equal(bytes, 32);
    fv_ring_release(&ring, bytes);
    assert_null(fv_ring_peek(&ring, &bytes));
    assert_true(fv_ring_empty(&ring));
    assert_non_null(fv_ring_reserve(&ring, 50)); /* half the capacity into an empty ring */
}

#ifdef FOVEA_SANITIZED
enum { RECORDS = 10000 };
#else
enum { RECORDS = 200000 };
#endif

/* Record n: its length (2 bytes) and that many bytes of a pattern that depends on n. */
static uint32_t length_of(uint32_t n)
{
    return 1 + (n * 2654435761u >> 24);
}

static void *produce(void *context)
{
    struct fv_ring *ring = context;
    for (uint32_t n = 0; n < RECORDS; n++) {
        uint32_t length = length_of(n);
        uint8_t *room;
        while ((room = fv_ring_reserve(ring, length + 2)) == NULL)
            sched_yield();
        room[0] = (uint8_t)length;
        room[1] = (uint8_t)(length >> 8);
        for (uint32_t i = 0; i < length; i++)
            room[2 + i] = (uint8_t)(n + i);
        fv_ring_commit(ring, length + 2);
    }
    return NULL;
}

static void test_two_threads(void **state)
{
    (void)state;
    static uint8_t memory[1021];
    struct fv_ring ring;
    pthread_t thread;
    fv_ring_init(&ring, memory, sizeof memory);
    assert_int_equal(pthread_create(&thread, NULL, produce, &ring), 0);
    uint32_t wrong = 0;
    for (uint32_t n = 0; n < RECORDS;) {
        size_t bytes;
        const uint8_t *data = fv_ring_peek(&ring, &bytes);
        if (data == NULL) {
            sched_yield();
            continue;
        }
        size_t at = 0;
        while (at < bytes) {
            uint32_t length = data[at] | (uint32_t)data[at + 1] << 8;
            wrong += length != length_of(n);
            for (uint32_t i = 0; i < length; i++)
                wrong += data[at + 2 + i] != (uint8_t)(n + i);
            at += length + 2;
            n++;
        }
        wrong += at != bytes;
        fv_ring_release(&ring, at);
    }
    pthread_join(thread, NULL);
    assert_int_equal(wrong, 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_fill_and_drain),
                                       cmocka_unit_test(test_two_threads)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}

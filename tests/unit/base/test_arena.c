/* The arena: counting, building and rebasing agree; nothing is handed out twice or past the end. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <string.h>

#include "base/arena.h"

static uint8_t block[4096] __attribute__((aligned(64)));

struct pieces {
    uint8_t *a;
    uint32_t *b;
    double *c;
};

static void carve(struct fv_arena *arena, struct pieces *pieces)
{
    pieces->a = fv_arena_take(arena, 3, 1);
    pieces->b = fv_arena_take(arena, 100, sizeof(uint32_t));
    pieces->c = fv_arena_take(arena, 1, sizeof(double));
}

static void counting_and_building_agree(void **state)
{
    (void)state;
    struct fv_arena count, build;
    struct pieces none, pieces;
    fv_arena_count(&count);
    carve(&count, &none);
    assert_null(none.a);
    assert_null(none.c);
    memset(block, 0xa5, sizeof block);
    fv_arena_init(&build, block, count.used);
    carve(&build, &pieces);
    assert_false(build.exhausted);
    assert_int_equal(build.used, count.used);
    assert_int_equal((uintptr_t)pieces.b % FV_CACHE_LINE_BYTES, 0);
    assert_true((uint8_t *)pieces.b >= pieces.a + 3);
    assert_true((uint8_t *)pieces.c >= (uint8_t *)(pieces.b + 100));
    assert_true((uint8_t *)(pieces.c + 1) <= block + count.used);
    assert_int_equal(pieces.b[99], 0);
}

static void rebasing_keeps_contents(void **state)
{
    (void)state;
    struct fv_arena arena;
    struct pieces first, second;
    fv_arena_init(&arena, block, sizeof block);
    carve(&arena, &first);
    first.b[7] = 42;
    fv_arena_init(&arena, block, sizeof block);
    arena.keep = true;
    carve(&arena, &second);
    assert_ptr_equal(first.b, second.b);
    assert_int_equal(second.b[7], 42);
}

static void refuses_what_does_not_fit(void **state)
{
    (void)state;
    struct fv_arena arena;
    fv_arena_init(&arena, block, 128);
    assert_non_null(fv_arena_take(&arena, 64, 1));
    assert_null(fv_arena_take(&arena, 65, 1));
    assert_true(arena.exhausted);
    assert_int_equal(arena.used, 64);
    assert_null(fv_arena_take(&arena, SIZE_MAX / 8, 16)); /* the product overflows */
    fv_arena_count(&arena);
    fv_arena_take(&arena, SIZE_MAX / 8, 16);
    assert_true(arena.exhausted);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(counting_and_building_agree),
        cmocka_unit_test(rebasing_keeps_contents),
        cmocka_unit_test(refuses_what_does_not_fit),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

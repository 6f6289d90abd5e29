/* The writer of Protocol Buffers against the examples of its specification
 * (protobuf.dev/programming-guides/encoding), and at every length that does not suffice. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "web/foxglove_schemas.h"
#include "web/protobuf.h"

static uint8_t data[1000];
static struct fv_protobuf to;

static int begin(void **state)
{
    (void)state;
    to = (struct fv_protobuf){.data = data, .capacity = sizeof data};
    return 0;
}

static void is(const char *bytes, size_t count)
{
    assert_false(to.full);
    assert_int_equal(to.bytes, count);
    assert_memory_equal(data, bytes, count);
    to.bytes = 0;
}

static void fields_are_written_as_specified(void **state)
{
    (void)state;
    fv_protobuf_number(&to, 1, 150);
    is("\x08\x96\x01", 3);
    fv_protobuf_number(&to, 1, (uint64_t)-2);
    is("\x08\xfe\xff\xff\xff\xff\xff\xff\xff\xff\x01", 11);
    fv_protobuf_text(&to, 2, "testing");
    is("\x12\x07testing", 9);
    fv_protobuf_fixed32(&to, 17, 0x01020304);
    is("\x8d\x01\x04\x03\x02\x01", 6);
    fv_protobuf_double(&to, 1, 25.4);
    is("\x09\x66\x66\x66\x66\x66\x66\x39\x40", 9);
    fv_protobuf_double(&to, 1, -0.0); /* is not 0 */
    is("\x09\0\0\0\0\0\0\0\x80", 9);
    fv_protobuf_head(&to, 6, 8);
    fv_protobuf_more_float(&to, 1.5F);
    fv_protobuf_more_float(&to, 0);
    is("\x32\x08\0\0\xc0\x3f\0\0\0\0", 10);
    fv_protobuf_number(&to, 1, 0);
    fv_protobuf_fixed32(&to, 1, 0);
    fv_protobuf_double(&to, 1, 0.0);
    fv_protobuf_text(&to, 1, "");
    is("", 0);
}

static void messages_are_inside_others(void **state)
{
    char text[301];
    (void)state;
    const size_t outer = fv_protobuf_begin(&to, 3);
    fv_protobuf_number(&to, 1, 150);
    fv_protobuf_end(&to, outer);
    is("\x1a\x03\x08\x96\x01", 5);
    memset(text, 'x', 300);
    text[300] = '\0';
    const size_t one = fv_protobuf_begin(&to, 1), two = fv_protobuf_begin(&to, 2);
    fv_protobuf_text(&to, 4, text); /* its length takes two bytes, and so do those around it */
    fv_protobuf_end(&to, two);
    fv_protobuf_number(&to, 3, 1);
    fv_protobuf_end(&to, one);
    assert_memory_equal(data, "\x0a\xb4\x02\x12\xaf\x02\x22\xac\x02xxx", 12);
    assert_memory_equal(data + 9 + 300, "\x18\x01", 2);
    assert_int_equal(to.bytes, 3 + 3 + 3 + 300 + 2);
    to.bytes = 0;
    fv_protobuf_end(&to, fv_protobuf_begin(&to, 1));
    is("\x0a\0", 2);
}

static void what_does_not_fit_is_not_written(void **state)
{
    uint8_t whole[8192];
    (void)state;
    for (int schema = 0; schema < FV_FOXGLOVE_SCHEMAS; schema++) {
        const size_t bytes = fv_foxglove_schema_describe(schema, whole, sizeof whole);
        assert_true(bytes > 200);
        for (size_t capacity = 0; capacity < bytes; capacity++) {
            uint8_t *short_one = malloc(capacity + 1); /* asan sees what is written beyond */
            assert_non_null(short_one);
            short_one[capacity] = 0x5a;
            assert_int_equal(fv_foxglove_schema_describe(schema, short_one, capacity), 0);
            assert_int_equal(short_one[capacity], 0x5a);
            free(short_one);
        }
        assert_int_equal(fv_foxglove_schema_describe(schema, whole, bytes), bytes);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(fields_are_written_as_specified, begin),
        cmocka_unit_test_setup(messages_are_inside_others, begin),
        cmocka_unit_test_setup(what_does_not_fit_is_not_written, begin),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

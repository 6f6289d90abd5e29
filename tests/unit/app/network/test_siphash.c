/* SipHash-2-4 gives the codes that its authors published (key 00 to 0f, text 00 01 02 ...). */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "app/network/siphash.h"

static void test_published_codes(void **state)
{
    static const struct {
        size_t bytes;
        uint8_t code[8];
    } known[] = {
        {0, {0x31, 0x0e, 0x0e, 0xdd, 0x47, 0xdb, 0x6f, 0x72}},
        {1, {0xfd, 0x67, 0xdc, 0x93, 0xc5, 0x39, 0xf8, 0x74}},
        {2, {0x5a, 0x4f, 0xa9, 0xd9, 0x09, 0x80, 0x6c, 0x0d}},
        {7, {0x37, 0xd1, 0x01, 0x8b, 0xf5, 0x00, 0x02, 0xab}},
        {8, {0x62, 0x24, 0x93, 0x9a, 0x79, 0xf5, 0xf5, 0x93}},
        {15, {0xe5, 0x45, 0xbe, 0x49, 0x61, 0xca, 0x29, 0xa1}},
        {63, {0x72, 0x45, 0x06, 0xeb, 0x4c, 0x32, 0x8a, 0x95}},
    };
    uint8_t key[FV_SIPHASH_KEY_BYTES], text[64];
    (void)state;
    for (uint8_t i = 0; i < sizeof text; i++)
        text[i] = i;
    for (uint8_t i = 0; i < sizeof key; i++)
        key[i] = i;
    for (size_t i = 0; i < sizeof known / sizeof known[0]; i++) {
        uint64_t code = 0;
        for (int k = 0; k < 8; k++)
            code |= (uint64_t)known[i].code[k] << (8 * k);
        assert_true(fv_siphash(key, text, known[i].bytes, 0) == code);
    }
}

/* Zeros that are not there count like those that are, at every length. */
static void zeros_need_not_be_there(void **state)
{
    uint8_t key[FV_SIPHASH_KEY_BYTES] = {7, 1}, text[64] = {0};
    (void)state;
    for (size_t bytes = 0; bytes <= 40; bytes++) {
        for (size_t i = 0; i < bytes; i++)
            text[i] = (uint8_t)(3 * i + 1);
        for (size_t zeros = 0; zeros <= 17; zeros++)
            assert_true(fv_siphash(key, text, bytes, zeros) ==
                        fv_siphash(key, text, bytes + zeros, 0));
        assert_true(fv_siphash(key, text, bytes, 8) != fv_siphash(key, text, bytes, 7));
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_published_codes),
                                       cmocka_unit_test(zeros_need_not_be_there)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}

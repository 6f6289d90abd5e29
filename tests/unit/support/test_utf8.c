/* Text is well-formed up to where RFC 3629 says, and is cut there. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

#include "support/utf8.h"

/* Text, and how many of its bytes are well-formed. */
static const struct {
    const char *text;
    size_t whole;
} cases[] = {
    {"", 0},
    {"plain", 5},
    {"\xc3\xa9t\xc3\xa9", 5},  /* two bytes each */
    {"a\xe2\x82\xac", 4},      /* three */
    {"a\xf0\x9f\x98\x80z", 6}, /* four */
    {"ab\xc3", 2},             /* cut within a letter */
    {"ab\xe2\x82", 2},         /* likewise */
    {"ab\xf0\x9f\x98", 2},     /* likewise */
    {"ab\x80z", 2},            /* continues nothing */
    {"ab\xc0\xaf", 2},         /* overlong */
    {"ab\xed\xa0\x80", 2},     /* a surrogate */
    {"ab\xf4\x90\x80\x80", 2}, /* above the last code point */
    {"\xff", 0},
};

static void text_is_cut_where_it_ceases_to_be_well_formed(void **state)
{
    (void)state;
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        char text[16];
        assert_int_equal(fv_utf8_check(cases[i].text), cases[i].whole == strlen(cases[i].text));
        snprintf(text, sizeof text, "%s", cases[i].text);
        fv_utf8_cut(text);
        assert_int_equal(strlen(text), cases[i].whole);
        assert_memory_equal(text, cases[i].text, cases[i].whole);
        assert_true(fv_utf8_check(text));
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(text_is_cut_where_it_ceases_to_be_well_formed),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

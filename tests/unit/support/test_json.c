/* Texts in JSON: whatever is in them, what is written can be read. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <stdlib.h>

#include "support/json.h"

static void test_texts(void **state)
{
    (void)state;
    static const char *const rows[][2] = {
        {"", "\"\""},
        {"sim:orbit?seed=7&width=64", "\"sim:orbit?seed=7&width=64\""},
        {"a\"b\\c", "\"a\\\"b\\\\c\""},
        {"a\nb\x01\x7f", "\"a\\u000ab\\u0001\x7f\""},
        {"K\xc3\xa4se \xf0\x9f\xa7\x80", "\"K\xc3\xa4se \xf0\x9f\xa7\x80\""},
        {"\xff"
         "a\xc3",
         "\"\\ufffda\\ufffd\""},
    };
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        char *text = NULL;
        size_t bytes = 0;
        FILE *file = open_memstream(&text, &bytes);
        fv_json_text(file, rows[i][0]);
        assert_int_equal(fclose(file), 0);
        assert_string_equal(text, rows[i][1]);
        free(text);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_texts)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}

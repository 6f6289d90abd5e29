/* YAML trees and text tools: values with their lines, and one clear line for whatever is wrong. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "support/yaml_tree.h"

static struct fv_yaml_tree *parse(const char *text)
{
    struct fv_yaml_tree *tree = NULL;
    struct fovea_error error = {0};
    if (fv_yaml_parse("f.yaml", text, strlen(text), &tree, &error) != FOVEA_OK)
        fail_msg("%s", error.text);
    return tree;
}

static void refused(const char *text, size_t bytes, const char *line)
{
    struct fv_yaml_tree *tree = NULL;
    struct fovea_error error = {0};
    assert_int_equal(fv_yaml_parse("f.yaml", text, bytes, &tree, &error), FOVEA_ERROR_INPUT);
    assert_null(tree);
    assert_string_equal(error.text, line);
}

static void test_structure(void **state)
{
    (void)state;
    struct fv_yaml_tree *tree =
        parse("# comment\na: 1\nb:\n  - x\n  - {c: 2.5, d: [3, 4]}\ne: 'q'\n");
    assert_int_equal(tree->root->kind, FV_YAML_MAPPING);
    assert_int_equal(tree->root->count, 3);
    const struct fv_yaml_node *b = fv_yaml_child(tree->root, "b");
    assert_non_null(b);
    assert_int_equal(b->line, 3);
    assert_int_equal(b->kind, FV_YAML_SEQUENCE);
    assert_int_equal(b->count, 2);
    const struct fv_yaml_node *d = fv_yaml_child(b->first->next, "d");
    assert_non_null(d);
    assert_int_equal(d->line, 5);
    char path[FV_YAML_PATH_BYTES];
    assert_string_equal(fv_yaml_path(d->first->next, path), "b[1].d[1]");
    assert_string_equal(fv_yaml_path(tree->root, path), "the file");
    assert_true(fv_yaml_child(tree->root, "e")->quoted);
    assert_null(fv_yaml_child(tree->root, "z"));
    fv_yaml_free(tree);
}

/* As editors of other systems write it. Bytes are counted from the start of the file. */
static void test_byte_order_mark(void **state)
{
    (void)state;
    struct fv_yaml_tree *tree = parse("\xef\xbb\xbf"
                                      "a: 1\r\nb: 2\r\n");
    assert_int_equal(tree->root->count, 2);
    assert_int_equal(fv_yaml_child(tree->root, "b")->line, 2);
    fv_yaml_free(tree);
    tree = parse("\xef\xbb\xbf%YAML:1.0\n---\nrows: 3\n");
    assert_int_equal(fv_yaml_child(tree->root, "rows")->line, 3);
    fv_yaml_free(tree);
    refused("\xef\xbb\xbf"
            "a: \xff\n",
            8, "f.yaml: byte 6: not YAML: invalid leading UTF-8 octet");
    refused("%YAML:1.0\na: \xff\n", 15, "f.yaml: byte 13: not YAML: invalid leading UTF-8 octet");
}

static void test_empty_and_opencv_head(void **state)
{
    (void)state;
    struct fv_yaml_tree *tree = parse("");
    assert_int_equal(tree->root->kind, FV_YAML_MAPPING);
    assert_int_equal(tree->root->count, 0);
    fv_yaml_free(tree);
    tree = parse("%YAML:1.0\n---\nK: !!opencv-matrix\n   rows: 3\n");
    assert_int_equal(fv_yaml_child(tree->root, "K")->line, 3);
    fv_yaml_free(tree);
    refused("%YAML 3.0\n---\na: 1\n", 19,
            "f.yaml:1: column 1: not YAML: found incompatible YAML document");
}

static void test_refused(void **state)
{
    (void)state;
    refused("a: &x 1\n", 8, "f.yaml:1: found an anchor or alias, expected every value written out");
    refused("a: 1\nb: 2\na: 3\n", 15,
            "f.yaml:3: found the key 'a' again (first on line 1), expected each key once");
    refused("a: 1\n---\n---\n", 13, "f.yaml:3: found a third document, expected one per file");
    refused("a: 1\n---\n[]\n", 12, "f.yaml:2: found a second document, expected one per file");
    refused("a: 1\n---\nb: 1\n", 14, "f.yaml:2: found a second document, expected one per file");
    refused("[a, b]: 1\n", 10, "f.yaml:1: found a collection as a key, expected a plain key");
    refused("a: \"x\\0y\"\n", 10, "f.yaml:1: found a zero byte in a value, expected text");
    refused("a: [1, 2\nb: 3\n", 14,
            "f.yaml:2: column 2: not YAML: did not find expected ',' or ']'");
    refused("a: \xff\n", 5, "f.yaml: byte 3: not YAML: invalid leading UTF-8 octet");
    char deep[200];
    memset(deep, '[', 100);
    refused(deep, 100, "f.yaml:1: found collections nested too deeply, expected at most 32 levels");
}

static void test_limits(void **state)
{
    (void)state;
    const size_t bytes = FV_YAML_BYTES_MAX + 1;
    char *text = malloc(bytes);
    assert_non_null(text);
    memset(text, ' ', bytes);
    refused(text, bytes, "f.yaml: found 1048577 bytes, expected at most 1048576");
    size_t used = 0;
    text[used++] = '[';
    while (used < bytes - 4) {
        text[used++] = '1';
        text[used++] = ',';
    }
    text[used++] = ']';
    refused(text, used, "f.yaml:1: found more values than a file may have, expected at most 65536");
    used = 0;
    for (int i = 0; i < 2000; i++)
        used += (size_t)sprintf(text + used, "k%d: 1\n", i);
    refused(text, used,
            "f.yaml:1025: found more keys than one mapping may have, expected at most 1024");
    free(text);
}

static void test_values(void **state)
{
    (void)state;
    struct fv_yaml_tree *tree =
        parse("n: 2.5\ni: -3\nb: Yes\ns: hello\nc: mid\nm: [[1, 2], [3, 4e-1]]\nq: '7'\n"
              "nan: .nan\ninf: 1e999\nhex: 0x10\n~: null\n");
    const struct fv_yaml_node *root = tree->root;
    struct fovea_error error;
    double number = 0;
    int64_t integer = 0;
    bool truth = false;
    const char *text = NULL;
    size_t choice = 0, count = 0;
    assert_int_equal(fv_yaml_number(tree, fv_yaml_child(root, "n"), 0, 3, &number, &error),
                     FOVEA_OK);
    assert_true(number == 2.5);
    assert_int_equal(fv_yaml_number(tree, fv_yaml_child(root, "n"), 0, 2, &number, &error),
                     FOVEA_ERROR_INPUT);
    assert_string_equal(error.text, "f.yaml:1: n: found '2.5', expected a number in [0, 2]");
    const char *const no_numbers[] = {"q", "nan", "inf", "hex", "m", "s"};
    for (size_t i = 0; i < 6; i++) {
        const struct fv_yaml_node *node = fv_yaml_child(root, no_numbers[i]);
        assert_int_equal(fv_yaml_number(tree, node, -1e300, 1e300, &number, &error),
                         FOVEA_ERROR_INPUT);
    }
    assert_true(number == 2.5);
    assert_int_equal(fv_yaml_integer(tree, fv_yaml_child(root, "i"), -3, 3, &integer, &error),
                     FOVEA_OK);
    assert_int_equal(integer, -3);
    assert_int_equal(fv_yaml_integer(tree, fv_yaml_child(root, "n"), -3, 3, &integer, &error),
                     FOVEA_ERROR_INPUT);
    assert_string_equal(error.text, "f.yaml:1: n: found '2.5', expected a whole number in [-3, 3]");
    assert_int_equal(fv_yaml_bool(tree, fv_yaml_child(root, "b"), &truth, &error), FOVEA_OK);
    assert_true(truth);
    assert_int_equal(fv_yaml_bool(tree, fv_yaml_child(root, "i"), &truth, &error),
                     FOVEA_ERROR_INPUT);
    assert_int_equal(fv_yaml_string(tree, fv_yaml_child(root, "s"), 5, &text, &error), FOVEA_OK);
    assert_string_equal(text, "hello");
    assert_int_equal(fv_yaml_string(tree, fv_yaml_child(root, "s"), 4, &text, &error),
                     FOVEA_ERROR_INPUT);
    const char *const choices[] = {"low", "mid"};
    assert_int_equal(fv_yaml_choice(tree, fv_yaml_child(root, "c"), choices, 2, &choice, &error),
                     FOVEA_OK);
    assert_int_equal(choice, 1);
    assert_int_equal(fv_yaml_choice(tree, fv_yaml_child(root, "s"), choices, 2, &choice, &error),
                     FOVEA_ERROR_INPUT);
    assert_string_equal(error.text, "f.yaml:4: s: found 'hello', expected one of low, mid");
    double m[4] = {0};
    assert_int_equal(fv_yaml_numbers(tree, fv_yaml_child(root, "m"), 1, 4, m, &count, &error),
                     FOVEA_OK);
    assert_int_equal(count, 4);
    assert_true(m[0] == 1 && m[3] == 0.4);
    assert_int_equal(fv_yaml_numbers(tree, fv_yaml_child(root, "m"), 3, 3, m, &count, &error),
                     FOVEA_ERROR_INPUT);
    assert_string_equal(error.text, "f.yaml:6: m: found a list of 2, expected a list of 3 numbers");
    fv_yaml_free(tree);
}

static void test_require_names_the_nearest(void **state)
{
    (void)state;
    struct fv_yaml_tree *tree = parse("x: 1\ncamera_matirx: 2\n");
    const struct fv_yaml_node *child = NULL;
    struct fovea_error error;
    assert_int_equal(fv_yaml_require(tree, tree->root, "camera_matrix", &child, &error),
                     FOVEA_ERROR_INPUT);
    assert_string_equal(
        error.text, "f.yaml:2: the file: found the key 'camera_matirx', expected 'camera_matrix'");
    assert_int_equal(fv_yaml_require(tree, tree->root, "image_width", &child, &error),
                     FOVEA_ERROR_INPUT);
    assert_string_equal(error.text, "f.yaml:1: the file: found no key 'image_width', expected it");
    fv_yaml_free(tree);
}

static void test_files(void **state)
{
    (void)state;
    struct fv_yaml_tree *tree = NULL;
    struct fovea_error error;
    assert_int_equal(fv_yaml_read("/nonexistent.yaml", &tree, &error), FOVEA_ERROR_INPUT);
    assert_string_equal(error.text,
                        "/nonexistent.yaml: cannot be opened: No such file or directory");
    assert_int_equal(fv_yaml_read("/", &tree, &error), FOVEA_ERROR_INPUT);
    assert_string_equal(error.text, "/: found a directory, expected a file");
    assert_int_equal(fv_yaml_read("/dev/zero", &tree, &error), FOVEA_ERROR_INPUT);
    assert_string_equal(error.text, "/dev/zero: found a device, expected a file");
}

static void test_text(void **state)
{
    (void)state;
    double number = 7;
    int64_t integer = 7;
    const char *const bad[] = {"",   " 1", "1 ", "nan",   "inf", "0x1", "1e",
                               "e5", ".",  "-",  "1e400", "1,5", "--1"};
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++) {
        assert_false(fv_text_number(bad[i], &number));
        assert_false(fv_text_integer(bad[i], &integer));
    }
    assert_true(number == 7 && integer == 7);
    assert_true(fv_text_number("-.5e-3", &number) && number == -0.0005);
    assert_true(fv_text_integer("-9223372036854775808", &integer) && integer == INT64_MIN);
    assert_false(fv_text_integer("9223372036854775808", &integer));
    char quoted[FV_TEXT_QUOTED_BYTES];
    assert_string_equal(fv_text_quote("a\nb\xff", quoted, sizeof quoted), "'a\\x0Ab\\xFF'");
    /* UTF-8 as it was typed, but nothing that steers a terminal or turns the text about. */
    assert_string_equal(fv_text_quote("R\xc3\xb6hre \xe8\xb7\xaf", quoted, sizeof quoted),
                        "'R\xc3\xb6hre \xe8\xb7\xaf'");
    assert_string_equal(fv_text_quote("\xc2\x9b"
                                      "a\xe2\x80\xae",
                                      quoted, sizeof quoted),
                        "'\\xC2\\x9Ba\\xE2\\x80\\xAE'");
    char count[FV_TEXT_COUNT_BYTES];
    assert_string_equal(fv_text_count(1, "loop", count), "1 loop");
    assert_string_equal(fv_text_count(2, "loop", count), "2 loops");
    char same[100];
    memset(same, 'z', 99);
    same[99] = '\0';
    assert_int_equal(strlen(fv_text_quote(same, quoted, sizeof quoted)), 48 + 5);
    memset(same, '\n', 99);
    assert_int_equal(strlen(fv_text_quote(same, quoted, sizeof quoted)), 4 * 48 + 5);
    assert_string_equal(fv_text_quote(same, quoted, 16), "'\\x0A\\x0A...'");
    const char *const names[] = {"euroc", "tum", "kitti", "images"};
    assert_string_equal(fv_text_nearest("Eruoc", names, 4), "euroc");
    assert_string_equal(fv_text_nearest("kiti", names, 4), "kitti");
    assert_null(fv_text_nearest("webcam", names, 4));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_structure),
        cmocka_unit_test(test_byte_order_mark),
        cmocka_unit_test(test_empty_and_opencv_head),
        cmocka_unit_test(test_refused),
        cmocka_unit_test(test_limits),
        cmocka_unit_test(test_values),
        cmocka_unit_test(test_require_names_the_nearest),
        cmocka_unit_test(test_files),
        cmocka_unit_test(test_text),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

/* NumPy's files: what is written is read again; what does not fit is refused in a line; and
 * fovea model run writes them. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#include "app/lab/commands.h"
#include "app/lab/npy.h"

enum { BYTES_MAX = 4096 };

/* A file of format `version` with this description before `count` bytes of elements. */
static size_t file_of(uint8_t data[BYTES_MAX], int version, const char *description, size_t count)
{
    const size_t begin = version == 1 ? 10 : 12, length = strlen(description);
    memset(data, 7, BYTES_MAX);
    memcpy(data, "\x93NUMPY", 6);
    data[6] = (uint8_t)version;
    data[7] = 0;
    data[8] = (uint8_t)length;
    data[9] = (uint8_t)(length >> 8);
    if (version > 1) data[10] = data[11] = 0;
    memcpy(data + begin, description, length);
    return begin + length + count;
}

static void descriptions_are_read(void **state)
{
    (void)state;
    static uint8_t data[BYTES_MAX];
    struct fv_npy array;
    struct fovea_error error;
    static const struct {
        const char *text;
        int version;
        enum fovea_tensor_type type;
        int32_t axes, last;
        size_t bytes;
    } cases[] = {
        {"{'descr': '|i1', 'fortran_order': False, 'shape': (1, 2, 3), }  \n", 1, FOVEA_TENSOR_INT8,
         3, 3, 6},
        {"{'shape': (4,), 'descr': '<f4', 'fortran_order': False}", 2, FOVEA_TENSOR_FLOAT32, 1, 4,
         16},
        {"{'descr': '<i8', 'fortran_order': False, 'shape': (), }", 3, FOVEA_TENSOR_INT64, 0, 0, 8},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        const size_t bytes = file_of(data, cases[i].version, cases[i].text, cases[i].bytes);
        if (fv_npy_parse("a.npy", data, bytes, &array, &error) != FOVEA_OK)
            fail_msg("%s", error.text);
        assert_int_equal(array.type, cases[i].type);
        assert_int_equal(array.axis_count, cases[i].axes);
        if (cases[i].axes > 0) assert_int_equal(array.shape[array.axis_count - 1], cases[i].last);
        assert_int_equal(array.bytes, cases[i].bytes);
        assert_ptr_equal(array.data, data + bytes - cases[i].bytes);
    }
}

static void what_does_not_fit_is_refused(void **state)
{
    (void)state;
    static uint8_t data[BYTES_MAX];
    struct fv_npy array;
    struct fovea_error error;
    static const char *const wrong[][2] = {
        {"{'descr': '<f8', 'fortran_order': False, 'shape': (6,), }", "descr"},
        {"{'descr': '>i4', 'fortran_order': False, 'shape': (6,), }", "descr"},
        {"{'fortran_order': False, 'shape': (6,), }", "descr"},
        {"{'descr': '|u1', 'fortran_order': True, 'shape': (6,), }", "fortran_order"},
        {"{'descr': '|u1', 'fortran_order': False, 'shape': (6, 0), }", "shape"},
        {"{'descr': '|u1', 'fortran_order': False, 'shape': (6", "shape"},
        {"{'descr': '|u1', 'fortran_order': False, 'shape': (65536, 65536), }", "shape"},
        {"{'descr': '|u1', 'fortran_order': False, 'shape': (1,1,1,1,1,1,1,1,6), }", "shape"},
        {"{'descr': '|u1', 'fortran_order': False, 'shape': (7,), }", "bytes of elements"},
    };
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
        const size_t bytes = file_of(data, 1, wrong[i][0], 6);
        assert_int_equal(fv_npy_parse("a.npy", data, bytes, &array, &error), FOVEA_ERROR_INPUT);
        if (strstr(error.text, wrong[i][1]) == NULL || strncmp(error.text, "a.npy: ", 7) != 0)
            fail_msg("%s: %s", wrong[i][0], error.text);
    }
    const size_t bytes = file_of(data, 1, "{}", 0);
    for (size_t some = 0; some <= bytes; some++)
        assert_int_equal(fv_npy_parse("a.npy", data, some, &array, &error), FOVEA_ERROR_INPUT);
    data[9] = 0x20; /* a description longer than the file */
    assert_int_equal(fv_npy_parse("a.npy", data, bytes, &array, &error), FOVEA_ERROR_INPUT);
}

static uint32_t word(const uint8_t *at)
{
    return (uint32_t)at[0] | (uint32_t)at[1] << 8 | (uint32_t)at[2] << 16 | (uint32_t)at[3] << 24;
}

/* The entries are found by the directory at the archive's end, as every reader does. */
static void an_archive_holds_what_was_added(void **state)
{
    (void)state;
    static uint8_t data[BYTES_MAX];
    static const int32_t numbers[4] = {1, -2, 3, 1 << 30};
    const struct fv_npy arrays[2] = {{.type = FOVEA_TENSOR_INT32,
                                      .axis_count = 2,
                                      .shape = {2, 2},
                                      .data = numbers,
                                      .bytes = sizeof numbers},
                                     {.type = FOVEA_TENSOR_UINT8, .data = "x", .bytes = 1}};
    static const char *const names[2] = {"some", "other"};
    struct fv_npz npz;
    struct fv_npy array;
    struct fovea_error error;
    FILE *stream = tmpfile();
    assert_non_null(stream);
    fv_npz_begin(&npz, stream);
    for (int i = 0; i < 2; i++)
        assert_true(fv_npz_add(&npz, names[i], &arrays[i]));
    assert_true(fv_npz_end(&npz));
    rewind(stream);
    const size_t bytes = fread(data, 1, sizeof data, stream);
    fclose(stream);
    assert_int_equal(bytes, npz.at);
    const uint8_t *end = data + bytes - 22;
    assert_memory_equal(end, "PK\5\6", 4);
    assert_int_equal(end[10], 2);
    assert_int_equal(word(end + 16) + word(end + 12), bytes - 22);
    const uint8_t *central = data + word(end + 16);
    for (int i = 0; i < 2; i++, central += 46 + central[28]) {
        assert_memory_equal(central, "PK\1\2", 4);
        assert_memory_equal(central + 46, names[i], strlen(names[i]));
        const uint8_t *local = data + word(central + 42);
        assert_memory_equal(local, "PK\3\4", 4);
        assert_memory_equal(local + 4, central + 6, 26);
        const uint8_t *entry = local + 30 + local[26];
        if (fv_npy_parse(names[i], entry, word(local + 22), &array, &error) != FOVEA_OK)
            fail_msg("%s", error.text);
        assert_int_equal(array.type, arrays[i].type);
        assert_int_equal(array.axis_count, arrays[i].axis_count);
        assert_int_equal(array.bytes, arrays[i].bytes);
        assert_memory_equal(array.data, arrays[i].data, array.bytes);
        assert_int_equal(((uintptr_t)array.data - (uintptr_t)entry) % 64, 0);
    }
}

static int model(const char *const arguments[])
{
    char copies[8][128], *argv[9];
    int argc = 0;
    for (; arguments[argc] != NULL; argc++) {
        snprintf(copies[argc], sizeof copies[argc], "%s", arguments[argc]);
        argv[argc] = copies[argc];
    }
    argv[argc] = NULL;
    return fv_command_model(argc, argv);
}
#define MODEL(...) model((const char *const[]){"model", __VA_ARGS__, NULL})

static void a_model_runs_on_arrays_and_refuses_others(void **state)
{
    (void)state;
    static uint8_t data[BYTES_MAX * 4];
    char folder[] = "/tmp/fovea-npy-XXXXXX", in[64], out[64];
    assert_non_null(mkdtemp(folder));
    snprintf(in, sizeof in, "%s/in.npy", folder);
    snprintf(out, sizeof out, "%s/out.npz", folder);
    static const char *const shapes[2] = {"(1, 48, 64, 3)", "(1, 64, 48, 3)"};
    for (int i = 0; i < 2; i++) {
        char description[128];
        snprintf(description, sizeof description,
                 "{'descr': '|i1', 'fortran_order': False, 'shape': %s, }", shapes[i]);
        const size_t begin = file_of(data, 1, description, 0);
        FILE *file = fopen(in, "wb");
        assert_non_null(file);
        fwrite(data, 1, begin + 48 * 64 * 3, file);
        fclose(file);
        assert_int_equal(MODEL("run", "tests/golden/detector.fvm", in, in, "--out", out),
                         i == 0 ? FV_EXIT_OK : FV_EXIT_WRONG);
    }
    FILE *file = fopen(out, "rb"); /* that of the first, which the second left as it was */
    assert_non_null(file);
    assert_int_equal(fread(data, 1, 4, file), 4);
    fclose(file);
    assert_memory_equal(data, "PK\3\4", 4);
    assert_int_equal(MODEL("run", "tests/golden/detector.fvm", in), FV_EXIT_WRONG);
    assert_int_equal(MODEL("run", "tests/golden/detector.fvm", "--out", out), FV_EXIT_WRONG);
    assert_int_equal(MODEL("run", "tests/golden/detector.fvm", in, "--out", in), FV_EXIT_WRONG);
    assert_int_equal(MODEL("walk", "tests/golden/detector.fvm"), FV_EXIT_WRONG);
    unlink(in);
    unlink(out);
    rmdir(folder);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(descriptions_are_read),
                                       cmocka_unit_test(what_does_not_fit_is_refused),
                                       cmocka_unit_test(an_archive_holds_what_was_added),
                                       cmocka_unit_test(a_model_runs_on_arrays_and_refuses_others)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}

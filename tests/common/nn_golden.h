/* The small models of tests/golden/nn_operators.bin (tests/import/make_golden.py describes the
 * format). */
#ifndef FOVEA_TESTS_NN_GOLDEN_H
#define FOVEA_TESTS_NN_GOLDEN_H

#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "support/text.h"

enum { NN_GOLDEN_MAX = 128 };

struct nn_golden_model {
    const char *name;
    const uint8_t *model, *inputs, *outputs;
    uint32_t model_bytes, input_bytes, output_bytes;
};

struct nn_golden {
    uint8_t *data; /* 64-byte aligned, to be freed */
    int count;
    struct nn_golden_model models[NN_GOLDEN_MAX];
};

static inline size_t nn_golden_padded(size_t bytes)
{
    return (bytes + 63) / 64 * 64;
}

static struct nn_golden golden; /* of a test program */

/* From the project's top, where tests run. */
static inline int nn_golden_set_up(void **state)
{
    struct fovea_error error = {.text = "not whole"};
    char *file;
    size_t bytes;
    (void)state;
    if (fv_text_read("tests/golden/nn_operators.bin", 1 << 28, &file, &bytes, &error) != FOVEA_OK ||
        bytes == 0 || bytes % 64 != 0) {
        fprintf(stderr, "tests/golden/nn_operators.bin: %s\n", error.text);
        return -1;
    }
    golden.data = aligned_alloc(64, bytes);
    if (golden.data == NULL) return -1;
    memcpy(golden.data, file, bytes);
    free(file);
    for (const uint8_t *at = golden.data; at < golden.data + bytes && golden.count < NN_GOLDEN_MAX;
         ++golden.count) {
        struct nn_golden_model *m = &golden.models[golden.count];
        m->name = (const char *)at;
        memcpy(&m->model_bytes, at + 40, 4);
        memcpy(&m->input_bytes, at + 44, 4);
        memcpy(&m->output_bytes, at + 48, 4);
        m->model = at + 64;
        m->inputs = m->model + nn_golden_padded(m->model_bytes);
        m->outputs = m->inputs + nn_golden_padded(m->input_bytes);
        at = m->outputs + nn_golden_padded(m->output_bytes);
    }
    return golden.count < 40 ? -1 : 0;
}

static inline int nn_golden_tear_down(void **state)
{
    (void)state;
    free(golden.data);
    return 0;
}

#endif

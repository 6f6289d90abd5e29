/* The small models of tests/golden/nn_operators.bin (tests/import/make_golden.py describes the format). */
#ifndef FOVEA_TESTS_NN_GOLDEN_H
#define FOVEA_TESTS_NN_GOLDEN_H

#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

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

/* Aborts when the file is not there or broken: tests run from the project's top. */
static inline struct nn_golden nn_golden_read(void)
{
    struct nn_golden g = {.count = 0};
    FILE *file = fopen("tests/golden/nn_operators.bin", "rb");
    if (file == NULL) abort();
    fseek(file, 0, SEEK_END);
    const long size = ftell(file);
    rewind(file);
    if (size <= 0 || size % 64 != 0) abort();
    g.data = aligned_alloc(64, (size_t)size);
    if (g.data == NULL || fread(g.data, 1, (size_t)size, file) != (size_t)size) abort();
    fclose(file);
    for (const uint8_t *at = g.data; at < g.data + size && g.count < NN_GOLDEN_MAX; ++g.count) {
        struct nn_golden_model *m = &g.models[g.count];
        m->name = (const char *)at;
        memcpy(&m->model_bytes, at + 40, 4);
        memcpy(&m->input_bytes, at + 44, 4);
        memcpy(&m->output_bytes, at + 48, 4);
        m->model = at + 64;
        m->inputs = m->model + nn_golden_padded(m->model_bytes);
        m->outputs = m->inputs + nn_golden_padded(m->input_bytes);
        at = m->outputs + nn_golden_padded(m->output_bytes);
    }
    return g;
}

#endif

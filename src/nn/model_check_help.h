/* What the checks of operator records share; part of model_check.c. */
#ifndef FOVEA_NN_MODEL_CHECK_HELP_H
#define FOVEA_NN_MODEL_CHECK_HELP_H

#include <stddef.h>

#include "nn/model.h"

/* One operator under inspection; `word` is the record word looked at, for the error text. */
struct fv_check {
    const struct fv_model *m;
    const struct fv_model_op *op;
    int32_t *word;
};

#define FV_CHECK_WORD(member) ((int32_t)(offsetof(struct fv_model_op, u.member) / 4))
#define FV_CHECK_REQUIRE(member, condition, text)                                                  \
    do {                                                                                           \
        *c->word = FV_CHECK_WORD(member);                                                          \
        if (!(condition)) return text;                                                             \
    } while (0)

static inline int fv_check_between(int64_t value, int64_t low, int64_t high)
{
    return value >= low && value <= high;
}

static inline const struct fv_model_tensor *fv_check_input(const struct fv_check *c, int32_t i)
{
    return &c->m->tensors[c->op->inputs[i]];
}

static inline const struct fv_model_tensor *fv_check_output(const struct fv_check *c, int32_t i)
{
    return &c->m->tensors[c->op->outputs[i]];
}

static inline int64_t fv_check_scratch_bytes(const struct fv_check *c)
{
    return c->op->scratch < 0 || c->m->tensors[c->op->scratch].offset % 64 != 0
               ? 0
               : c->m->tensors[c->op->scratch].bytes;
}

/* Constant data of `bytes` bytes at a multiple of `alignment`, with the slack that kernels may read
 * behind it. */
static inline int fv_check_constant(const struct fv_check *c, int32_t offset, int64_t bytes,
                                    int32_t alignment)
{
    return offset >= FV_MODEL_HEADER_BYTES && offset % alignment == 0 &&
           offset + bytes + FV_MODEL_SLACK_BYTES <= (int64_t)c->m->header->file_bytes;
}

static inline int fv_check_table_fits(const struct fv_check *c, int32_t offset)
{
    return offset == 0 || fv_check_constant(c, offset, 256, 1);
}

static inline const int32_t *fv_check_words_at(const struct fv_check *c, int32_t offset)
{
    return (const int32_t *)(const void *)(c->m->base + offset);
}

static inline int fv_check_activation_fits(int32_t zero_in, int32_t zero_out, int32_t low,
                                           int32_t high)
{
    return fv_check_between(zero_in, 0, 255) && fv_check_between(zero_out, 0, 255) && low >= 0 &&
           low <= high && high <= 255;
}

/* Of `whole` slices, each in `parts`, which files before their version leave at 0. */
static inline int fv_check_parts_fit(const struct fv_check *c, int32_t parts, int64_t most)
{
    return parts == 0 ||
           (c->m->header->version >= FV_MODEL_VERSION && fv_check_between(parts, 1, most));
}

static inline int fv_check_rows_are(const struct fv_check *c, int64_t whole, int32_t parts)
{
    return c->op->rows == whole * (parts > 1 ? parts : 1);
}

static inline const char *fv_check_operands(const struct fv_check *c, int32_t inputs,
                                            int32_t outputs)
{
    *c->word = 3;
    return c->op->input_count == inputs && c->op->output_count == outputs
               ? NULL
               : "wrong number of operands";
}

/* Operators on images (model_check_image.c); each returns NULL, or what is wrong as a phrase. */
const char *fv_check_conv(const struct fv_check *c);
const char *fv_check_depthwise(const struct fv_check *c);
const char *fv_check_pool(const struct fv_check *c);
const char *fv_check_resize(const struct fv_check *c);

#endif

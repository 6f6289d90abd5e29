/* One output tensor of a network, read element by element as real numbers. Real-time safe. */
#ifndef FOVEA_DETECT_OUTPUT_H
#define FOVEA_DETECT_OUTPUT_H

#include <stdint.h>

#include "base/elementary.h"
#include "nn/model.h"

struct fv_head_output {
    const struct fv_model_tensor *t;
    const uint8_t *data; /* packed: tools/import makes outputs so */
};

static inline int64_t fv_head_count(const struct fv_head_output *o)
{
    int64_t count = 1;
    for (int32_t i = 0; i < o->t->rank; i++)
        count *= o->t->dims[i];
    return count;
}

static inline int32_t fv_head_last_dim(const struct fv_head_output *o)
{
    return o->t->rank > 0 ? o->t->dims[o->t->rank - 1] : 0;
}

static inline float fv_head_value(const struct fv_head_output *o, int64_t i)
{
    if (o->t->type == FV_TYPE_F32) return ((const float *)(const void *)o->data)[i];
    if (o->t->type == FV_TYPE_U8) return o->t->scale * (float)(o->data[i] - o->t->zero);
    if (o->t->type == FV_TYPE_I32) return (float)((const int32_t *)(const void *)o->data)[i];
    return (float)((const int64_t *)(const void *)o->data)[i];
}

/* In [0, high]; 0 for what is no number. */
static inline float fv_head_clamp(float value, float high)
{
    return value > 0.0f ? (value < high ? value : high) : 0.0f;
}

static inline float fv_head_sigmoid(float x)
{
    return (float)(1.0 / (1.0 + fv_exp(-(double)x)));
}

#endif

/* Edges as LCM bytes. */
#include <assert.h>
#include <string.h>

#include "message/message.h"
#include "message/wire.h"

#include "fovea_edges_t.h"

static_assert((int)FV_MESSAGE_EDGE_BYTES_MAX == FOVEA_EDGES_T_BYTES_MAX, "the limit of edges_t");
static_assert((int)FV_MESSAGE_EDGE_SEGMENTS_MAX == FOVEA_EDGES_T_SEGMENTS_MAX,
              "the limit of edges_t");

enum { METHOD_BYTES_MAX = 16 };

size_t fv_message_edges_size_max(void)
{
    fovea_edges_t empty;
    memset(&empty, 0, sizeof empty);
    empty.method = (char *)"";
    return (size_t)fovea_edges_t_encoded_size(&empty) + METHOD_BYTES_MAX +
           FV_MESSAGE_EDGE_BYTES_MAX + FV_MESSAGE_EDGE_SEGMENTS_MAX * 4 * sizeof(float);
}

uint32_t fv_message_edges_encode(const struct fv_message_edges *in, uint8_t *buffer,
                                 size_t capacity)
{
    /* lcm-gen wants an address for each row of an array of two dimensions, and knows no const. */
    float *rows[FV_MESSAGE_EDGE_SEGMENTS_MAX];
    for (uint32_t i = 0; i < in->segment_count; i++)
        rows[i] = (float *)in->segments[i];
    const fovea_edges_t message = {
        .stamp = in->stamp,
        .method = (char *)fovea_edge_method_name(in->config->method),
        .low = (float)in->config->low,
        .high = (float)in->config->high,
        .width = in->width,
        .height = in->height,
        .first_row = in->first_row,
        .row_count = in->row_count,
        .size_bytes = in->row_count * ((in->width + 7) / 8),
        .bits = (uint8_t *)in->bits,
        .segment_count = (int32_t)in->segment_count,
        .segment_px = rows,
    };
    return fv_wire_encoded(fovea_edges_t_encode(buffer, 0, fv_wire_capacity(capacity), &message));
}

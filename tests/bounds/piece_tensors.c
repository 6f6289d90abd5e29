/* Of the outputs of a network whose decoder is not known, sent as they are. */
#include <stdlib.h>
#include <string.h>

#include "bounds/counter.h"
#include "bounds/pieces.h"
#include "message/message.h"
#include "nn/model.h"
#include "runtime/tensors.h"

enum { OUTPUTS = FV_MODEL_IO_MAX };

struct sending {
    struct fv_model_header header;
    struct fv_model_tensor tensors[OUTPUTS];
    struct fv_model model;
    fovea_stamp_t stamp;
    uint8_t *arena, *scratch, *buffer;
    uint32_t sent, bytes;
};

static void send(void *context)
{
    struct sending *w = context;
    w->sent = 0;
    w->bytes = fv_tensors_encode(&w->model, w->arena, &w->stamp, &w->sent, w->scratch, w->buffer,
                                 FV_MESSAGE_PACKET_BYTES);
}

/* One output that fills a message, or as many small ones as a network has. */
void pieces_of_tensors(void)
{
    static struct sending w;
    static int32_t outputs[OUTPUTS];
    static const int32_t types[] = {FV_TYPE_U8, FV_TYPE_I32, FV_TYPE_I64, FV_TYPE_F32};
    const size_t room = 2 * FV_MESSAGE_TENSOR_BYTES_MAX + 64;
    w.arena = calloc(1, 8 * room);
    w.scratch = calloc(1, FV_MESSAGE_TENSOR_BYTES_MAX);
    w.buffer = calloc(1, FV_MESSAGE_PACKET_BYTES);
    MUST(w.arena != NULL && w.scratch != NULL && w.buffer != NULL);
    w.model = (struct fv_model){.header = &w.header, .tensors = w.tensors, .outputs = outputs};
    for (size_t i = 0; i < 2 * sizeof types / sizeof *types; i++) {
        const int32_t count = i % 2 == 0 ? 1 : OUTPUTS,
                      elements = 2 * FV_MESSAGE_TENSOR_BYTES_MAX / count;
        w.header.output_count = (uint32_t)count;
        for (int32_t k = 0; k < count; k++) {
            outputs[k] = k;
            w.tensors[k] = (struct fv_model_tensor){.type = types[i / 2],
                                                    .rank = 4,
                                                    .dims = {1, 1, 1, elements},
                                                    .scale = 0.1f,
                                                    .zero = 3};
        }
        NOTE(tensors_sent, send, &w, 1);
        MUST(w.bytes > 0 && w.sent > 0);
    }
    free(w.arena);
    free(w.scratch);
    free(w.buffer);
}

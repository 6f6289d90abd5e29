/* Of networks that label pixels: the outputs of the shipped one, and masks of any size. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "bounds/counter.h"
#include "bounds/pieces.h"
#include "detect/decode.h"
#include "message/message.h"
#include "nn/run.h"

enum { WIDTH = 640, HEIGHT = 480, SIDE = 1024, FILE_MAX = 1 << 20 };

struct masking {
    struct fv_model model;
    struct fv_nn_input_fit fit;
    struct fv_detect_scratch *scratch;
    struct fv_detect_mask mask;
    struct fv_detect_room room;
    uint8_t *arena;
    enum fovea_status status;
    /* sending */
    struct fv_message_segmentation message;
    struct fovea_segmentation seen;
    int32_t row;
    void *runs;
    uint8_t *buffer;
    size_t capacity;
};

static void *take(size_t bytes)
{
    void *memory = calloc(1, bytes);
    MUST(memory != NULL);
    return memory;
}

/* ---- decoding -------------------------------------------------------------------------------- */

static void open_model(struct masking *m)
{
    static _Alignas(64) uint8_t file[FILE_MAX];
    const struct fovea_image image = {.data = file,
                                      .width = WIDTH,
                                      .height = HEIGHT,
                                      .stride_bytes = WIDTH,
                                      .format = FOVEA_PIXEL_GREY8};
    struct fovea_error error;
    FILE *in = fopen("src/detect/segmenter.fvm", "rb");
    MUST(in != NULL);
    const size_t bytes = fread(file, 1, sizeof file, in);
    fclose(in);
    MUST(fv_model_open(file, bytes, "segmenter", &m->model, &error) == FOVEA_OK);
    MUST(fv_nn_input_fit_of(&m->model, &image, &m->fit) == FOVEA_OK);
    MUST(fv_detect_gives(&m->model) == FV_DETECT_MASK);
}

static void decode(void *context)
{
    static const struct fv_detect_limits limits = {.score = 0};
    struct masking *m = context;
    m->status = fv_detect_decode_unit(&m->model, m->arena, &m->fit, &limits, m->scratch, &m->room);
}

/* Scores of a pixel: all alike, or each higher than those before it, or by chance. */
static uint8_t score(int how, size_t at)
{
    return how == 0 ? 127 : (uint8_t)(how == 1 ? at % 5 * 20 + 100 : at * 2654435761u >> 20);
}

static void of_decoding(struct masking *m)
{
    enum { WAYS = 3 };
    const int32_t output = m->model.outputs[0];
    int32_t width, height;
    fv_detect_mask_size(&m->model, &width, &height);
    MUST(width > 0 && fv_detect_mask_confident(&m->model));
    m->arena = take((size_t)m->model.header->arena_bytes);
    m->scratch = take(sizeof *m->scratch);
    m->room.mask = &m->mask;
    m->room.pixels = take((size_t)width * (size_t)height);
    m->room.confidence = take((size_t)width * (size_t)height);
    uint8_t *scores = fv_nn_tensor(&m->model, m->arena, output);
    for (int how = 0; how < WAYS; how++) {
        for (size_t i = 0; i < (size_t)m->model.tensors[output].bytes; i++)
            scores[i] = score(how, i);
        fv_detect_decode_start(m->scratch);
        do
            NOTE(mask_decoded, decode, m, 1);
        while (m->status == FOVEA_AGAIN);
        MUST(m->status == FOVEA_OK && m->mask.count > 0);
    }
}

/* ---- sending --------------------------------------------------------------------------------- */

static void encode(void *context)
{
    struct masking *m = context;
    MUST(fv_message_segmentation_encode(&m->message, &m->row, m->runs, m->buffer, m->capacity) > 0);
}

/* Runs of one pixel, and of as many as there are; as wide as masks are, as long as messages. */
static void of_sending(struct masking *m)
{
    static const int32_t lengths[] = {1, 2, 7, 8, 9, 64, SIDE * SIDE};
    uint8_t *pixels = take((size_t)SIDE * SIDE), *confidence = take((size_t)SIDE * SIDE),
            index[256];
    struct fovea_segmentation_class list[FOVEA_SEGMENTATION_CLASSES_MAX];
    memset(list, 0, sizeof list);
    for (int i = 0; i < 256; i++)
        index[i] = (uint8_t)i;
    for (uint32_t i = 0; i < FOVEA_SEGMENTATION_CLASSES_MAX; i++) /* the first are listed */
        list[i].pixels = SIDE * SIDE / (i + 2);
    for (size_t i = 0; i < (size_t)SIDE * SIDE; i++)
        confidence[i] = (uint8_t)(i * 2654435761u >> 20);
    m->runs = take(fv_message_segmentation_scratch_bytes());
    m->capacity = fv_message_segmentation_size_max();
    m->buffer = take(m->capacity);
    m->seen = (struct fovea_segmentation){.width = SIDE,
                                          .height = SIDE,
                                          .image_width = SIDE,
                                          .image_height = SIDE,
                                          .part = {0, 0, SIDE, SIDE},
                                          .raw_scale = {1, 1},
                                          .count = FOVEA_SEGMENTATION_CLASSES_MAX,
                                          .list = list,
                                          .pixels = pixels,
                                          .index = index,
                                          .confidence = confidence};
    m->message.model = "a name of a model";
    m->message.seen = &m->seen;
    for (int i = 0; i < FOVEA_SEGMENTATION_CLASSES_MAX; i++)
        m->message.names[i] = "a label as long as messages hold, and longer";
    for (size_t way = 0; way < sizeof lengths / sizeof lengths[0]; way++) {
        for (int32_t i = 0; i < SIDE * SIDE; i++)
            pixels[i] = (uint8_t)(i / lengths[way] % FV_MESSAGE_SEGMENTS_MAX);
        m->row = 0;
        NOTE(mask_sent, encode, m, 1);
        MUST(m->row > 0 && m->row < SIDE);
    }
    free(pixels);
    free(confidence);
}

void pieces_of_masks(void)
{
    static struct masking m;
    open_model(&m);
    of_decoding(&m);
    of_sending(&m);
    free(m.arena);
    free(m.scratch);
    free(m.room.pixels);
    free(m.room.confidence);
    free(m.runs);
    free(m.buffer);
}

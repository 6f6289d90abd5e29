/* Masks as LCM bytes. */
#include <assert.h>
#include <string.h>

#include "message/message.h"
#include "message/wire.h"

#include "fovea_segmentation_t.h"

enum {
    PIXELS_MAX = 1 << 17, /* of one message: what is read in some 0.15 ms */
    RUN_MAX = INT16_MAX,
    RUNS_MAX = FOVEA_SEGMENTATION_T_RUNS_MAX,
    COLOUR_BITS = 8
};

static_assert((int)FV_MESSAGE_SEGMENTS_MAX == FOVEA_SEGMENTATION_T_CLASSES_MAX,
              "the limit of segmentation_t");

/* The runs of one message. */
struct runs {
    int32_t count;
    int16_t length[RUNS_MAX];
    uint8_t segment[RUNS_MAX];
};

size_t fv_message_segmentation_scratch_bytes(void)
{
    return sizeof(struct runs);
}

size_t fv_message_segmentation_size_max(void)
{
    fovea_segmentation_t empty;
    fovea_segment_class_t one;
    memset(&empty, 0, sizeof empty);
    memset(&one, 0, sizeof one);
    empty.model = one.class_name = (char *)"";
    return (size_t)fovea_segmentation_t_encoded_size(&empty) + FV_MESSAGE_LABEL_BYTES_MAX - 1 +
           FV_MESSAGE_SEGMENTS_MAX * ((size_t)__fovea_segment_class_t_encoded_array_size(&one, 1) +
                                      FV_MESSAGE_LABEL_BYTES_MAX - 1) +
           RUNS_MAX * (sizeof(int16_t) + 1);
}

/* As the colours of the PASCAL VOC classes: bit 0, 3, 6... of the number to red, from its highest
 * bit down; 1, 4, 7... to green; 2, 5, 8... to blue. */
static void colour(uint32_t number, uint8_t rgb[3])
{
    memset(rgb, 0, 3);
    for (int bit = 0; bit < COLOUR_BITS; bit++, number >>= 3)
        for (int k = 0; k < 3; k++)
            rgb[k] |= (uint8_t)((number >> k & 1) << (COLOUR_BITS - 1 - bit));
}

/* Add a row, which goes on with the last run; false: there is no room for it. */
static bool add_row(struct runs *runs, const uint8_t *row, int32_t width, const uint8_t *index)
{
    const struct {
        int32_t count;
        int16_t length;
    } before = {runs->count, runs->count > 0 ? runs->length[runs->count - 1] : (int16_t)0};
    for (int32_t x = 0; x < width; x++) {
        const uint8_t segment = index[row[x]];
        const int32_t last = runs->count - 1;
        if (last >= 0 && runs->segment[last] == segment && runs->length[last] < RUN_MAX) {
            runs->length[last]++;
        } else if (runs->count < RUNS_MAX) {
            runs->segment[runs->count] = segment;
            runs->length[runs->count++] = 1;
        } else {
            runs->count = before.count;
            if (before.count > 0) runs->length[before.count - 1] = before.length;
            return false;
        }
    }
    return true;
}

uint32_t fv_message_segmentation_encode(const struct fv_message_segmentation *in, int32_t *row,
                                        void *scratch, uint8_t *buffer, size_t capacity)
{
    struct runs *runs = scratch;
    fovea_segment_class_t list[FV_MESSAGE_SEGMENTS_MAX];
    char names[FV_MESSAGE_SEGMENTS_MAX][FV_MESSAGE_LABEL_BYTES_MAX],
        model[FV_MESSAGE_LABEL_BYTES_MAX];
    const int32_t first = *row;
    fv_message_label(in->model, model);
    for (uint32_t i = 0; i < in->count; i++) {
        const struct fv_message_segment *s = &in->segments[i];
        uint8_t rgb[3];
        colour((uint32_t)(s->object < 0 ? s->class_id : s->object + 1), rgb);
        fv_message_label(s->name, names[i]);
        list[i] = (fovea_segment_class_t){.class_id = s->class_id,
                                          .class_name = names[i],
                                          .object = s->object,
                                          .score = s->score,
                                          .red = rgb[0],
                                          .green = rgb[1],
                                          .blue = rgb[2],
                                          .fraction = s->fraction};
    }
    runs->count = 0;
    for (int32_t pixels = 0; *row < in->height && (*row == first || pixels < PIXELS_MAX);
         ++*row, pixels += in->width)
        if (!add_row(runs, in->pixels + (size_t)*row * (size_t)in->width, in->width, in->index))
            break;
    const fovea_segmentation_t message = {.stamp = in->stamp,
                                          .model = model,
                                          .width = in->width,
                                          .height = in->height,
                                          .raw_scale_x = in->raw_scale[0],
                                          .raw_scale_y = in->raw_scale[1],
                                          .raw_offset_x = in->raw_offset[0],
                                          .raw_offset_y = in->raw_offset[1],
                                          .class_count = (int32_t)in->count,
                                          .classes = list,
                                          .first_row = first,
                                          .row_count = *row - first,
                                          .run_count = runs->count,
                                          .run_class = runs->segment,
                                          .run_length = runs->length};
    return fv_wire_encoded(
        fovea_segmentation_t_encode(buffer, 0, fv_wire_capacity(capacity), &message));
}

/* Masks as LCM bytes. */
#include <assert.h>
#include <string.h>

#include "message/message.h"
#include "message/wire.h"

#include "fovea_segmentation_t.h"

enum {
    PIXELS_MAX = 1 << 17, /* of one message: what is read in some 0.15 ms */
    RUN_MAX = INT16_MAX,
    RUNS_MAX = FOVEA_SEGMENTATION_T_RUNS_MAX
};

static_assert((int)FV_MESSAGE_SEGMENTS_MAX == FOVEA_SEGMENTATION_T_CLASSES_MAX,
              "the limit of segmentation_t");

/* The runs of one message. */
struct runs {
    int32_t count;
    uint32_t confidence[RUNS_MAX]; /* sums over the run, where the network gives it */
    int16_t length[RUNS_MAX];
    uint8_t segment[RUNS_MAX], mean[RUNS_MAX];
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
           RUNS_MAX * (sizeof(int16_t) + 2);
}

/* Which classes of a mask a message lists, by their number in the mask's list. */
struct listed {
    uint32_t count;
    uint8_t from[FV_MESSAGE_SEGMENTS_MAX]; /* place in the mask's list */
    uint8_t index[256];                    /* of a pixel, place in the message's */
};

/* The most pixels that as many classes as a message lists reach, of a list that has more. */
static uint32_t least_pixels(const struct fovea_segmentation *s)
{
    uint32_t reached = 0, beyond = (uint32_t)(s->width * s->height) + 1;
    while (beyond - reached > 1) {
        const uint32_t middle = reached + (beyond - reached) / 2;
        uint32_t count = 0;
        for (uint32_t i = 0; i < s->count; i++)
            count += s->list[i].pixels >= middle;
        if (count >= FV_MESSAGE_SEGMENTS_MAX)
            reached = middle;
        else
            beyond = middle;
    }
    return reached;
}

static void list_classes(const struct fovea_segmentation *s, struct listed *listed)
{
    uint8_t place[256];
    const bool all = s->count <= FV_MESSAGE_SEGMENTS_MAX;
    const uint32_t least = all ? 0 : least_pixels(s);
    uint32_t equal = FV_MESSAGE_SEGMENTS_MAX; /* so many of those that just reach it */
    for (uint32_t i = 0; i < s->count; i++)
        equal -= !all && s->list[i].pixels > least;
    memset(place, FOVEA_SEGMENTATION_NONE, sizeof place);
    listed->count = 0;
    for (uint32_t i = 0; i < s->count; i++) {
        const uint32_t pixels = s->list[i].pixels;
        if (!all && (pixels < least || (pixels == least && equal == 0))) continue;
        equal -= !all && pixels == least;
        place[i] = (uint8_t)listed->count;
        listed->from[listed->count++] = (uint8_t)i;
    }
    for (int i = 0; i < 256; i++)
        listed->index[i] = place[s->index[i]];
}

/* A row of the mask; `confidence`: NULL, or as long. */
struct row {
    const uint8_t *pixels, *index, *confidence;
    int32_t width;
};

/* The end of the equal bytes that begin at `x`. */
static int32_t equal_end(const uint8_t *pixels, int32_t x, int32_t width)
{
    const uint64_t all = pixels[x] * UINT64_C(0x0101010101010101);
    int32_t end = x + 1;
    for (uint64_t eight; end + 8 <= width; end += 8) {
        memcpy(&eight, pixels + end, sizeof eight);
        if (eight != all) break;
    }
    while (end < width && pixels[end] == pixels[x])
        end++;
    return end;
}

/* Add pixels [x, end) of a segment, which go on with the last run; false: there is no room. */
static bool add_pixels(struct runs *runs, uint8_t segment, const struct row *row, int32_t x,
                       int32_t end)
{
    while (x < end) {
        int32_t last = runs->count - 1;
        if (last < 0 || runs->segment[last] != segment || runs->length[last] == RUN_MAX) {
            if (runs->count == RUNS_MAX) return false;
            last = runs->count++;
            runs->segment[last] = segment;
            runs->length[last] = 0;
            runs->confidence[last] = 0;
        }
        const int32_t room = RUN_MAX - runs->length[last], part = end - x < room ? end - x : room;
        runs->length[last] = (int16_t)(runs->length[last] + part);
        if (row->confidence != NULL)
            for (int32_t i = x; i < x + part; i++)
                runs->confidence[last] += row->confidence[i];
        x += part;
    }
    return true;
}

/* Add a row; false: there is no room for it, and nothing was added. */
static bool add_row(struct runs *runs, const struct row *row)
{
    const int32_t before = runs->count, open = before > 0 ? before - 1 : 0;
    const struct {
        int16_t length;
        uint32_t confidence;
    } last_before = {runs->length[open], runs->confidence[open]};
    for (int32_t x = 0, end; x < row->width; x = end) {
        end = equal_end(row->pixels, x, row->width);
        if (add_pixels(runs, row->index[row->pixels[x]], row, x, end)) continue;
        runs->count = before;
        runs->length[open] = last_before.length;
        runs->confidence[open] = last_before.confidence;
        return false;
    }
    return true;
}

/* As many rows from `first` on as one message holds; returns the row after them. */
static int32_t take_rows(struct runs *runs, const struct fovea_segmentation *s,
                         const uint8_t index[256], int32_t first)
{
    int32_t y = first;
    runs->count = 0;
    for (int32_t pixels = 0; y < s->height && (y == first || pixels < PIXELS_MAX);
         y++, pixels += s->width) {
        const size_t at = (size_t)y * (size_t)s->width;
        const struct row row = {.pixels = s->pixels + at,
                                .index = index,
                                .confidence = s->confidence == NULL ? NULL : s->confidence + at,
                                .width = s->width};
        if (!add_row(runs, &row)) break;
    }
    for (int32_t i = 0; i < runs->count; i++) {
        const uint32_t length = (uint32_t)runs->length[i];
        runs->mean[i] = (uint8_t)((runs->confidence[i] + length / 2) / length);
    }
    return y;
}

uint32_t fv_message_segmentation_encode(const struct fv_message_segmentation *in, int32_t *row,
                                        void *scratch, uint8_t *buffer, size_t capacity)
{
    struct runs *runs = scratch;
    const struct fovea_segmentation *s = in->seen;
    fovea_segment_class_t list[FV_MESSAGE_SEGMENTS_MAX];
    char names[FV_MESSAGE_SEGMENTS_MAX][FV_MESSAGE_LABEL_BYTES_MAX],
        model[FV_MESSAGE_LABEL_BYTES_MAX];
    const int32_t first = *row;
    const float area = (float)(s->part.width * s->part.height);
    struct listed listed;
    list_classes(s, &listed);
    fv_message_label(in->model, model);
    for (uint32_t i = 0; i < listed.count; i++) {
        const struct fovea_segmentation_class *c = &s->list[listed.from[i]];
        fv_message_label(in->names[listed.from[i]], names[i]);
        list[i] = (fovea_segment_class_t){.class_id = c->class_id,
                                          .class_name = names[i],
                                          .object = c->object,
                                          .score = c->score,
                                          .red = c->red,
                                          .green = c->green,
                                          .blue = c->blue,
                                          .fraction = (float)c->pixels / area};
    }
    *row = take_rows(runs, s, listed.index, first);
    const fovea_segmentation_t message = {.stamp = in->stamp,
                                          .model = model,
                                          .width = s->width,
                                          .height = s->height,
                                          .raw_scale_x = s->raw_scale[0],
                                          .raw_scale_y = s->raw_scale[1],
                                          .raw_offset_x = s->raw_offset[0],
                                          .raw_offset_y = s->raw_offset[1],
                                          .class_count = (int32_t)listed.count,
                                          .classes = list,
                                          .first_row = first,
                                          .row_count = *row - first,
                                          .run_count = runs->count,
                                          .run_class = runs->segment,
                                          .run_length = runs->length,
                                          .confidence_count =
                                              s->confidence != NULL ? runs->count : 0,
                                          .run_confidence = runs->mean};
    return fv_wire_encoded(
        fovea_segmentation_t_encode(buffer, 0, fv_wire_capacity(capacity), &message));
}

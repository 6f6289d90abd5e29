/* Messages about masks: each pixel comes back once, of more classes than a message lists the
 * largest, and the largest message fits one packet. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "message/fields.h"
#include "message/message.h"

#include "fovea_segmentation_t.h"

/* As long as a packet allows, and well-formed. */
static void assert_fits_packet(const char *type, const uint8_t *data, size_t bytes)
{
    const char *why = NULL;
    size_t at = 0;
    assert_in_range(bytes, 1, FV_MESSAGE_PACKET_BYTES - 8 - FV_MESSAGE_CHANNEL_BYTES);
    if (!fv_message_check(type, data, bytes, &why, &at))
        fail_msg("%s: byte %zu: %s", type, at, why);
}

/* A mask of noise, which takes more runs than a message holds, and one of a single segment: the
 * messages together have each pixel once. */
static void masks_of_any_size_come_back(void **state)
{
    (void)state;
    enum { W = 400, H = 401 };
    static uint8_t pixels[W * H], back[W * H], sure[W * H], index[256];
    static struct fovea_segmentation_class list[FV_MESSAGE_SEGMENTS_MAX];
    static struct fovea_segmentation seen = {.width = W,
                                             .height = H,
                                             .part = {0, 3, W, H - 7},
                                             .raw_scale = {2, 3},
                                             .list = list,
                                             .pixels = pixels,
                                             .index = index};
    static struct fv_message_segmentation in = {
        .stamp = {.sequence = 5}, .model = "m", .seen = &seen};
    static uint8_t data[FV_MESSAGE_PACKET_BYTES];
    char label[200];
    memset(label, 'x', sizeof label);
    label[199] = '\0';
    seen.count = FV_MESSAGE_SEGMENTS_MAX;
    memset(index, 255, sizeof index);
    for (int i = 0; i < FV_MESSAGE_SEGMENTS_MAX; i++) {
        list[i] = (struct fovea_segmentation_class){.class_id = i,
                                                    .object = -1,
                                                    .score = NAN,
                                                    .pixels = W * (H - 7) / 2,
                                                    .red = (uint8_t)i,
                                                    .green = 77,
                                                    .blue = 88};
        in.names[i] = label;
        index[i + 100] = (uint8_t)i;
    }
    void *scratch = malloc(fv_message_segmentation_scratch_bytes());
    for (int variant = 0; variant < 4; variant++) {
        const int noisy = variant % 2;
        int messages = 0, whole = 0;
        seen.confidence = variant < 2 ? NULL : sure;
        for (int i = 0; i < W * H; i++)
            sure[i] = (uint8_t)(i / 7 + i);
        for (int i = 0; i < W * H; i++)
            pixels[i] = (uint8_t)(noisy ? 90 + (i * 2654435761U >> 24) % 80 : 101);
        for (int32_t row = 0; row < H; messages++) {
            const int32_t first = row;
            const uint32_t bytes =
                fv_message_segmentation_encode(&in, &row, scratch, data, sizeof data);
            fovea_segmentation_t out;
            assert_true(row > first);
            assert_fits_packet("fovea.segmentation_t", data, bytes);
            assert_in_range(bytes, 1, fv_message_segmentation_size_max());
            assert_int_equal(fovea_segmentation_t_decode(data, 0, (int)bytes, &out), bytes);
            assert_true(out.first_row == first && out.row_count == row - first && out.width == W &&
                        out.height == H && out.raw_scale_y == 3 &&
                        out.class_count == FV_MESSAGE_SEGMENTS_MAX);
            assert_true(out.classes[9].red == 9 && out.classes[2].green == 77 &&
                        out.classes[7].blue == 88 && out.classes[3].fraction == 0.5F);
            assert_int_equal(out.confidence_count, variant < 2 ? 0 : out.run_count);
            for (int i = 0; i < out.run_count; i++) {
                int sum = 0;
                for (int k = 0; k < out.run_length[i]; k++) {
                    sum += sure[whole];
                    back[whole++] = out.run_class[i];
                }
                if (variant >= 2)
                    assert_int_equal(out.run_confidence[i],
                                     (int)lround((double)sum / out.run_length[i]));
            }
            assert_int_equal(whole, row * W);
            fovea_segmentation_t_decode_cleanup(&out);
        }
        assert_int_equal(whole, W * H);
        for (int i = 0; i < W * H; i++)
            assert_int_equal(back[i], index[pixels[i]]);
        assert_true(noisy ? messages > 10 : messages == 2);
    }
    free(scratch);
}

/* Of more classes than a message lists, those with most pixels, the first of equal ones, by their
 * number; the pixels of the others have none. */
static void the_largest_classes_of_a_mask_are_sent(void **state)
{
    (void)state;
    enum { MOST = FOVEA_SEGMENTATION_CLASSES_MAX, SENT = FV_MESSAGE_SEGMENTS_MAX, FIRST = 40 };
    static uint8_t pixels[MOST], index[256];
    static struct fovea_segmentation_class list[MOST];
    static struct fovea_segmentation seen = {.width = MOST,
                                             .height = 1,
                                             .image_width = MOST,
                                             .image_height = 1,
                                             .part = {0, 0, MOST, 1},
                                             .count = MOST,
                                             .list = list,
                                             .pixels = pixels,
                                             .index = index};
    static struct fv_message_segmentation in = {.model = "m", .seen = &seen};
    static uint8_t data[FV_MESSAGE_PACKET_BYTES];
    static char names[MOST][8];
    int32_t row = 0;
    index[255] = FOVEA_SEGMENTATION_NONE;
    for (int i = 0; i < MOST; i++) { /* every third from FIRST on, then the first others */
        snprintf(names[i], sizeof names[i], "c%d", i);
        in.names[i] = names[i];
        pixels[i] = index[i] = (uint8_t)i;
        list[i] = (struct fovea_segmentation_class){
            .class_id = i, .object = -1, .pixels = i >= FIRST && i % 3 == 0 ? 9 : 5};
    }
    bool sent[MOST] = {false};
    int left = SENT;
    for (int i = FIRST; i < MOST; i++)
        if (i % 3 == 0 && left-- > 0) sent[i] = true;
    for (int i = 0; i < MOST && left > 0; i++)
        if (!sent[i] && left-- > 0) sent[i] = true;
    void *scratch = malloc(fv_message_segmentation_scratch_bytes());
    const uint32_t bytes = fv_message_segmentation_encode(&in, &row, scratch, data, sizeof data);
    fovea_segmentation_t out;
    free(scratch);
    assert_fits_packet("fovea.segmentation_t", data, bytes);
    assert_int_equal(fovea_segmentation_t_decode(data, 0, (int)bytes, &out), bytes);
    assert_true(row == 1 && out.class_count == SENT);
    for (int i = 0, place = 0, x = 0, run = 0; i < MOST; i++) {
        assert_int_equal(out.run_class[run], sent[i] ? place : FOVEA_SEGMENTATION_NONE);
        if (sent[i]) {
            assert_int_equal(out.classes[place].class_id, i);
            assert_string_equal(out.classes[place++].class_name, names[i]);
        }
        if (++x == out.run_length[run]) x = 0, run++;
    }
    fovea_segmentation_t_decode_cleanup(&out);
}

int main(void)
{
    fv_message_prepare();
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(masks_of_any_size_come_back),
        cmocka_unit_test(the_largest_classes_of_a_mask_are_sent),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

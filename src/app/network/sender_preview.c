#include "app/network/sender_preview.h"

#include <setjmp.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <jpeglib.h>

#include "message/fields.h"

#include "fovea_preview_t.h"

/* From the best on. Where a picture is scaled, more quality is worth more than more pixels. */
static const struct step {
    int quality, divisor;
} steps[] = {{55, 1}, {40, 1}, {28, 1}, {18, 1}, {45, 2}, {28, 2},
             {18, 2}, {40, 4}, {20, 4}, {40, 8}, {15, 8}};
enum { STEPS = sizeof steps / sizeof steps[0], PIXELS_MAX = 1 << 26 };

struct shrinking {
    struct jpeg_error_mgr errors;
    jmp_buf escape;
    struct jpeg_decompress_struct from;
    struct jpeg_compress_struct to;
    bool decoding, encoding;
    int divisor; /* of `pixels`; 0: none are decoded */
    int width, height;
    uint8_t *pixels;
    uint8_t *jpeg; /* of libjpeg */
    unsigned long jpeg_bytes;
};

static void on_error(j_common_ptr jpeg)
{
    longjmp(((struct shrinking *)jpeg->client_data)->escape, 1);
}

static void on_message(j_common_ptr jpeg, int level)
{
    (void)jpeg;
    (void)level;
}

static void release(struct shrinking *work)
{
    if (work->decoding) jpeg_destroy_decompress(&work->from);
    if (work->encoding) jpeg_destroy_compress(&work->to);
    free(work->pixels);
    free(work->jpeg);
}

static void decode(struct shrinking *work, const fovea_preview_t *preview, int divisor)
{
    struct jpeg_decompress_struct *from = &work->from;
    jpeg_create_decompress(from);
    work->decoding = true;
    jpeg_mem_src(from, preview->jpeg, (unsigned long)preview->size_bytes);
    jpeg_read_header(from, TRUE);
    from->out_color_space = JCS_GRAYSCALE;
    from->scale_num = 1;
    from->scale_denom = (unsigned)divisor;
    jpeg_start_decompress(from);
    work->width = (int)from->output_width;
    work->height = (int)from->output_height;
    work->divisor = divisor;
    const size_t pixels = (size_t)work->width * (size_t)work->height;
    free(work->pixels);
    work->pixels = pixels <= PIXELS_MAX ? malloc(pixels) : NULL;
    if (work->pixels == NULL) longjmp(work->escape, 1);
    while (from->output_scanline < from->output_height) {
        JSAMPROW row = work->pixels + (size_t)from->output_scanline * (size_t)work->width;
        jpeg_read_scanlines(from, &row, 1);
    }
    jpeg_finish_decompress(from);
    jpeg_destroy_decompress(from);
    work->decoding = false;
}

static void encode(struct shrinking *work, int quality)
{
    struct jpeg_compress_struct *to = &work->to;
    jpeg_create_compress(to);
    work->encoding = true;
    free(work->jpeg);
    work->jpeg = NULL;
    work->jpeg_bytes = 0;
    jpeg_mem_dest(to, &work->jpeg, &work->jpeg_bytes);
    to->image_width = (JDIMENSION)work->width;
    to->image_height = (JDIMENSION)work->height;
    to->input_components = 1;
    to->in_color_space = JCS_GRAYSCALE;
    jpeg_set_defaults(to);
    to->optimize_coding = TRUE;
    jpeg_set_quality(to, quality, TRUE);
    jpeg_start_compress(to, TRUE);
    while (to->next_scanline < to->image_height) {
        JSAMPROW row = work->pixels + (size_t)to->next_scanline * (size_t)work->width;
        jpeg_write_scanlines(to, &row, 1);
    }
    jpeg_finish_compress(to);
    jpeg_destroy_compress(to);
    work->encoding = false;
}

static uint32_t write_message(const struct shrinking *work, const fovea_preview_t *preview,
                              uint8_t *shrunk, size_t most)
{
    fovea_preview_t smaller = *preview;
    smaller.scale = preview->scale * preview->width / work->width;
    smaller.width = work->width;
    smaller.height = work->height;
    smaller.size_bytes = (int32_t)work->jpeg_bytes;
    smaller.jpeg = work->jpeg;
    if ((size_t)fovea_preview_t_encoded_size(&smaller) > most) return 0;
    return (uint32_t)fovea_preview_t_encode(shrunk, 0, (int)most, &smaller);
}

uint32_t fv_preview_shrink(struct fv_preview_fit *fit, const uint8_t *data, uint32_t bytes,
                           uint8_t *shrunk, size_t most)
{
    fovea_preview_t preview;
    const char *problem;
    size_t at;
    /* Checked first: the decoder keeps what it has allocated when it finds damage. */
    if (!fv_message_check("fovea.preview_t", data, bytes, &problem, &at) ||
        fovea_preview_t_decode(data, 0, (int)bytes, &preview) < 0)
        return 0;
    struct shrinking work = {.divisor = 0};
    jpeg_std_error(&work.errors);
    work.errors.error_exit = on_error;
    work.errors.emit_message = on_message;
    work.from.err = work.to.err = &work.errors;
    work.from.client_data = work.to.client_data = &work;
    volatile uint32_t written = 0;
    if (preview.size_bytes > 0 && setjmp(work.escape) == 0) {
        for (fit->step -= fit->step > 0; written == 0 && fit->step < STEPS; fit->step++) {
            const struct step *step = &steps[fit->step];
            if (step->divisor != work.divisor) decode(&work, &preview, step->divisor);
            encode(&work, step->quality);
            written = write_message(&work, &preview, shrunk, most);
        }
        fit->step -= fit->step > 0;
    }
    release(&work);
    fovea_preview_t_decode_cleanup(&preview);
    return written;
}

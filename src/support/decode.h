/* PNG, JPEG and BMP from memory to 8-bit grey levels, or to RGB where that is asked for.
 *
 * Colour is turned into grey by one integer formula on every machine (ITU-R BT.601 weights in 15
 * bits, as OpenCV): grey = (9798 R + 19235 G + 3735 B + 16384) >> 15. A JPEG in YCbCr gives its
 * luma channel, which is that formula applied before compression, through the accurate integer
 * transform (JDCT_ISLOW), which is exact over all of libjpeg-turbo's instruction sets. PNG: 16-bit
 * samples give their high byte, alpha is dropped. BMP: uncompressed, of 8 bits with a palette, of
 * 24 or of 32.
 *
 * Images are hostile: sizes are held against FOVEA_IMAGE_*, memory is bounded, truncated or corrupt
 * data is an error and never a half-filled frame. Allocates; for the reader thread, any number of
 * threads. */
#ifndef FOVEA_SUPPORT_DECODE_H
#define FOVEA_SUPPORT_DECODE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "fovea/status.h"

struct fv_decode_image {
    uint8_t *pixels; /* stride_bytes x height, owned by the caller; undefined after an error */
    int32_t width, height, stride_bytes;
    bool colour; /* three bytes per pixel, red first; a grey file gives three equal ones */
};

/* Size that the header states, of any value. FOVEA_ERROR_INPUT: neither PNG, JPEG nor BMP; `reason`
 * says what was found, without a file name. */
enum fovea_status fv_decode_size(const uint8_t *data, size_t bytes, int64_t *width, int64_t *height,
                                 struct fovea_error *reason);

/* The same, and FOVEA_ERROR_INPUT for a size that the runtime does not take. */
enum fovea_status fv_decode_probe(const uint8_t *data, size_t bytes, int32_t *width,
                                  int32_t *height, struct fovea_error *reason);

/* Whether the header states colours; false where there is none. */
bool fv_decode_has_colour(const uint8_t *data, size_t bytes);

/* Decode into `image`, whose size must be that of the data. */
enum fovea_status fv_decode(const uint8_t *data, size_t bytes, const struct fv_decode_image *image,
                            struct fovea_error *reason);

/* A JPEG decoder for cameras: it is made once for pictures of one width, and then makes no heap
 * call. libjpeg takes its memory from an arena of the decoder's, which is emptied before each
 * picture, so that nothing of a damaged picture outlives it. Baseline pictures of one scan; Huffman
 * tables may be missing, as in most cameras' MJPEG. One thread at a time. */
struct fv_jpeg_decoder;
enum fovea_status fv_jpeg_decoder_open(int32_t width, struct fv_jpeg_decoder **decoder,
                                       struct fovea_error *error);
void fv_jpeg_decoder_close(struct fv_jpeg_decoder *decoder);
/* Memory of the decoder's own; `*most` (or NULL): what a picture has needed of it so far. */
size_t fv_jpeg_decoder_bytes(const struct fv_jpeg_decoder *decoder, size_t *most);
/* As fv_decode_jpeg, with the same bits. */
enum fovea_status fv_jpeg_decode(struct fv_jpeg_decoder *decoder, const uint8_t *data, size_t bytes,
                                 const struct fv_decode_image *image, struct fovea_error *reason);

/* A buffer for whole files that is used again. Start with {0}. */
struct fv_file_buffer {
    uint8_t *data;
    size_t bytes, capacity;
};

/* Read a regular file of at most FV_INPUT_PICTURE_BYTES_MAX. FOVEA_GONE: there is none.
 * FOVEA_ERROR_INPUT: it cannot be read; `reason` does not name the file. */
enum fovea_status fv_file_read(struct fv_file_buffer *buffer, const char *path,
                               struct fovea_error *reason);
void fv_file_free(struct fv_file_buffer *buffer);

/* For the decoders. */
enum { FV_DECODE_SIDE_MAX = 16384 }; /* pixels of what is decoded */
void fv_decode_rgb_row(const uint8_t *rgb, uint8_t *grey, int32_t width);
enum fovea_status fv_decode_check_size(int64_t width, int64_t height, struct fovea_error *reason);
enum fovea_status fv_decode_png(const uint8_t *data, size_t bytes,
                                const struct fv_decode_image *image, struct fovea_error *reason);
enum fovea_status fv_decode_jpeg(const uint8_t *data, size_t bytes,
                                 const struct fv_decode_image *image, struct fovea_error *reason);
enum fovea_status fv_decode_jpeg_size(const uint8_t *data, size_t bytes, int64_t *width,
                                      int64_t *height, struct fovea_error *reason);
enum fovea_status fv_decode_bmp(const uint8_t *data, size_t bytes,
                                const struct fv_decode_image *image, struct fovea_error *reason);
enum fovea_status fv_decode_bmp_size(const uint8_t *data, size_t bytes, int64_t *width,
                                     int64_t *height, struct fovea_error *reason);
bool fv_decode_bmp_has_colour(const uint8_t *data, size_t bytes);

#endif

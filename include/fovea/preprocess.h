/* Preprocessing: operations on grey images before the search for features.
 *
 * A chain is an ordered list of operations with their parameters. It works on memory of the caller,
 * in place or from one image to another, and keeps no more than some rows of pixels:
 *
 *     size_t bytes = fovea_preprocess_size(&config, width, height, &error);
 *     fovea_preprocess_init(&chain, &config, width, height, memory, bytes, &error);
 *     fovea_preprocess_run(chain, &image, out, out_stride_bytes);
 *
 * Results are equal on every kernel set, compiler and architecture. They are those of OpenCV 4.6
 * to the bit for Gaussian, median, histogram equalization, normalization to a range and gamma, and
 * within one grey level for the others. Image borders are reflected without repeating the edge
 * (BORDER_REFLECT_101); the median repeats it.
 *
 * Sources: bilateral filter: Tomasi and Manduchi, ICCV 1998; contrast enhancement (CLAHE):
 * Zuiderveld, Graphics Gems IV, 1994. */
#ifndef FOVEA_PREPROCESS_H
#define FOVEA_PREPROCESS_H

#include <stddef.h>
#include <stdint.h>

#include "fovea/image.h"
#include "fovea/status.h"

#ifdef __cplusplus
extern "C" {
#endif

enum fovea_operation {
    FOVEA_OPERATION_DENOISE = 0,
    FOVEA_OPERATION_NORMALIZE = 1,
    FOVEA_OPERATION_SHARPEN = 2, /* a x + (1 - a) Gaussian(x) */
    FOVEA_OPERATION_HISTOGRAM_EQUALIZATION = 3,
    FOVEA_OPERATION_CONTRAST_ENHANCEMENT = 4, /* CLAHE */
    FOVEA_OPERATION_GAMMA = 5,                /* 255 (x / 255)^gamma */
    /* Of colours, by the grey world assumption: the loop and `fovea image` have it in their lists
     * (fovea/fovea.h); a chain of grey images refuses it, fovea_white_balance does it */
    FOVEA_OPERATION_WHITE_BALANCE = 6,
    FOVEA_OPERATION_COUNT
};

enum fovea_denoise_method {
    FOVEA_DENOISE_GAUSSIAN = 0, /* 3x3, 5x5 or 7x7 */
    FOVEA_DENOISE_MEDIAN = 1,   /* 3x3 */
    FOVEA_DENOISE_BILATERAL = 2 /* the 13 pixels within a radius of 2 */
};

enum fovea_normalize_method {
    FOVEA_NORMALIZE_RANGE = 0,    /* darkest pixel to low, brightest to high */
    FOVEA_NORMALIZE_DEVIATION = 1 /* to a mean and a standard deviation */
};

enum { FOVEA_OPERATIONS_MAX = 8, FOVEA_TILES_MAX = 16 };

/* Operations in their order; one may stand several times. */
struct fovea_operation_list {
    uint32_t count; /* [0, 8]; with 0 the image is copied */
    enum fovea_operation items[FOVEA_OPERATIONS_MAX];
};

struct fovea_preprocess_config {
    struct fovea_operation_list operations; /* default 0 operations */

    enum fovea_denoise_method denoise_method; /* default FOVEA_DENOISE_GAUSSIAN */
    /* 3, 5 or 7 of [3, 7], default 3: pixels of the Gaussian */
    uint32_t denoise_size;
    /* [0, 20] pixels, default 0: of the Gaussian, where 0 is 0.15 size + 0.35, and of the
     * bilateral's distance, where 0 is 2 */
    double denoise_sigma_px;
    double denoise_sigma_grey; /* [1, 255], default 25: of the bilateral's difference in grey */

    enum fovea_normalize_method normalize_method; /* default FOVEA_NORMALIZE_RANGE */
    uint32_t normalize_low;     /* [0, 254], default 0, less than normalize_high */
    uint32_t normalize_high;    /* [1, 255], default 255 */
    double normalize_mean;      /* [0, 255], default 128 */
    double normalize_deviation; /* [1, 128], default 50 */

    double sharpen_amount;   /* [1, 8], default 1.5: a; rounded to 1/256 */
    uint32_t sharpen_size;   /* 3, 5 or 7 of [3, 7], default 5: pixels of the Gaussian */
    double sharpen_sigma_px; /* [0, 20], default 0: as denoise_sigma_px */

    double contrast_limit;   /* [0, 1000], default 2: slope of a tile's table; 0 is without limit */
    uint32_t contrast_tiles; /* [1, 16], default 8: tiles across and down */

    double gamma; /* [0.1, 10], default 1: below 1 brightens */
};

/* A chain in the caller's memory. */
struct fovea_preprocess;

/* Set no operations and every parameter to its default. Any thread. */
void fovea_preprocess_config_default(struct fovea_preprocess_config *config);

/* Name as in configurations ("denoise", "contrast_enhancement", ...); "unknown" out of range. Any
 * thread. */
const char *fovea_operation_name(enum fovea_operation operation);

/* Bytes that a chain for images of width x height (within FOVEA_IMAGE_*) needs. 0 when a parameter
 * is out of its range: `error` names it. Init-only. */
size_t fovea_preprocess_size(const struct fovea_preprocess_config *config, int32_t width,
                             int32_t height, struct fovea_error *error);

/* Build a chain in `memory`, 64-byte aligned, which stays the caller's and must outlive it. Errors:
 * FOVEA_ERROR_ARGUMENT (a parameter, or the environment's FOVEA_CPU), FOVEA_ERROR_MEMORY (size or
 * alignment). Init-only. */
enum fovea_status fovea_preprocess_init(struct fovea_preprocess **chain,
                                        const struct fovea_preprocess_config *config, int32_t width,
                                        int32_t height, void *memory, size_t bytes,
                                        struct fovea_error *error);

/* Run the chain on a grey8 image of its size. `out` gets `height` rows, `out_stride_bytes` apart;
 * it is the image itself or does not overlap it. FOVEA_ERROR_ARGUMENT: the image or the stride does
 * not fit, and nothing is written. Real-time safe; time is proportional to the pixels and does not
 * depend on their values. One thread per chain. */
enum fovea_status fovea_preprocess_run(struct fovea_preprocess *chain,
                                       const struct fovea_image *image, uint8_t *out,
                                       int32_t out_stride_bytes);

/* White balance of an rgb24 or bgr24 image by the grey world assumption (Buchsbaum, 1980): each
 * channel is multiplied by mean of all / mean of the channel, rounded half up and limited to 255; a
 * channel that is black stays so. `out` as above, in the image's format. Real-time safe, any
 * thread. */
enum fovea_status fovea_white_balance(const struct fovea_image *image, uint8_t *out,
                                      int32_t out_stride_bytes);

#ifdef __cplusplus
}
#endif
#endif

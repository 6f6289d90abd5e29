/* Segmentation: which class each pixel of an image shows, or which object, as an int8 network
 * labels them (DeepLab, U-Net, Fast-SCNN and the like), or masks the objects that it finds.
 *
 * The mask has the size of the network's output. At the size of the image, each pixel has what the
 * pixel of the mask has in which its centre lies; of two that share an edge there, the right or
 * lower one. Pixels of the mask whose centre lies beside the image (on borders of a letterbox) have
 * no class, and pixels of the image in them have that of the nearest one whose centre lies in it.
 * The network sees the image resized, as detect.h says; nothing is interpolated, all is
 * integer arithmetic.
 *
 * In the runtime a segmentation is what the network job publishes (segmentation_t) with the stamp
 * of the image that it belongs to. */
#ifndef FOVEA_SEGMENTATION_H
#define FOVEA_SEGMENTATION_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

enum {
    FOVEA_SEGMENTATION_CLASSES_MAX = 255, /* all that a network tells apart: none is left out */
    FOVEA_SEGMENTATION_OBJECTS_MAX = 64,  /* of one image, where it masks objects: the best */
    FOVEA_SEGMENTATION_NONE = 255
};

/* A class, or one object of a class where the network tells objects apart. */
struct fovea_segmentation_class {
    int32_t class_id; /* index into the model's classes */
    int32_t object;   /* in the list of detections; -1: all pixels of the class */
    float score;      /* of the object, 0 to 1; NaN: the network gives none */
    uint32_t pixels;  /* of the mask: its area is pixels / (part.width part.height) of the image */
    /* to draw it in, of the model file or else of PASCAL VOC's palette: black is background */
    uint8_t red, green, blue, reserved;
};

/* Where the image lies in the network's input. */
struct fovea_segmentation_fit {
    int32_t input_width, input_height;
    int32_t left, top, width, height; /* part of the input that shows the image */
};

/* The mask's pixels whose centre lies in the image, along each axis; where there is none, the one
 * pixel that has the image's centre. */
struct fovea_segmentation_part {
    int32_t left, top, width, height;
};

struct fovea_segmentation {
    uint64_t inferences; /* completed since fovea_init; nothing below is valid while 0 */
    int64_t stamp_ns;    /* of the image */
    uint64_t sequence;   /* its frame's number */
    int32_t image_width, image_height;
    int32_t width, height; /* of the mask */
    struct fovea_segmentation_fit fit;
    struct fovea_segmentation_part part; /* the others have no class */
    /* x_raw = raw_scale x + raw_offset takes centres of the mask's pixels to the image: x, y */
    double raw_scale[2], raw_offset[2];
    uint32_t count;
    const struct fovea_segmentation_class *list;
    /* Row by row: index[pixel] is the place in the list, FOVEA_SEGMENTATION_NONE: no class. */
    const uint8_t *pixels, *index;
    const uint8_t
        *confidence; /* of each pixel, 0 to 255 for 0 to 1; NULL: the network gives none */
};

/* The mask at the size of the image, places in the list, image_width bytes a row. `values`: NULL,
 * or what takes the place of each pixel's place (256 entries), such as its class. Real-time safe,
 * but not bounded: some 1 ms for 640 x 480. */
void fovea_segmentation_enlarge(const struct fovea_segmentation *segmentation,
                                const uint8_t *values, uint8_t *pixels);

#ifdef __cplusplus
}
#endif
#endif

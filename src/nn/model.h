/* The model file (.fvm): one flat, little-endian, 64-byte aligned block that is used where it lies.
 *
 * Layout: header (512 bytes), tensor records (64 bytes each), operator records (256 bytes each),
 * indices of the input and output tensors, labels and names of outputs (zero-terminated), constant
 * data, 64 bytes of zeros that kernels may read past the end. Everything refers to everything by
 * offset or index; nothing is patched at load. `checksum` is CRC-32 (IEEE 802.3, as in zlib) of all
 * bytes from 16 to the end. tools/import writes it (write.py and layout.py mirror this page).
 *
 * 8-bit tensors are unsigned here: an int8 value q is held as q + 128 and its zero point moved
 * along. Quantised arithmetic only sees (value - zero point), so one set of kernels serves both
 * forms.
 *
 * A tensor record describes bytes of the arena, or of the file when constant. `storage` is the
 * record that it is a part of (itself for a whole one), so a slice of channels is a record whose
 * pixels lie `pixel_stride` bytes apart.
 *
 * Operators stand in the order in which they run; each reads only inputs, constants and what an
 * earlier one wrote. The work of an operator is cut into `rows` slices, done in order; `row_cost`
 * estimates one slice, in sixteenths of a nanosecond of the kernel set that takes longest
 * (tools/import/costs.txt). Where `parts` is above 1 so many slices make what else is one: sums
 * that such a cut leaves open stand in scratch until the next slice.
 *
 * A state is a tensor that keeps its bytes from run to run. Its bytes are values minus their zero
 * point, so that zeroed memory is the real zero. One FV_OP_COPY reads it, into the tensor that was
 * an input of the .tflite file, and a later one writes it, from the tensor that the next run shall
 * see there; both through a table where zero points or quantisations differ. Nothing else reads or
 * writes it, and no other tensor shares its bytes of the arena.
 *
 * The loader (fv_model_open) checks every number that a kernel or operator later relies on, so that
 * a hostile file is refused with the byte at fault and never causes an access out of bounds. */
#ifndef FOVEA_NN_MODEL_H
#define FOVEA_NN_MODEL_H

#include <stddef.h>
#include <stdint.h>

#include "fovea/status.h"

#ifdef __cplusplus
extern "C" {
#endif

enum {
    FV_MODEL_VERSION = 5,           /* of files with operators in parts */
    FV_MODEL_VERSION_SLOPES = 4,    /* of other files with FV_BINARY_SLOPES */
    FV_MODEL_VERSION_STATES = 3,    /* of other files with states */
    FV_MODEL_VERSION_STATELESS = 2, /* of other files without states */
    FV_MODEL_HEADER_BYTES = 512,
    FV_MODEL_SLACK_BYTES =
        64, /* that may be read past a tensor's end, in the arena and in the file */
    FV_MODEL_TENSORS_MAX = 1 << 16,
    FV_MODEL_OPS_MAX = 1 << 14,
    FV_MODEL_BYTES_MAX = 1 << 28,
    FV_MODEL_ARENA_BYTES_MAX = 1 << 28,
    FV_MODEL_IO_MAX = 16,
    FV_MODEL_LABELS_MAX = 4096,
    FV_MODEL_CONV_PIXELS = 48,  /* output pixels gathered at a time */
    FV_MODEL_REDUCE_LANES = 64, /* results that are reduced together */
    FV_MODEL_DEPTHWISE_COLUMNS =
        72 /* input columns interleaved at a time (more when the kernel is wider) */
};

enum fv_model_type {
    FV_TYPE_U8 = 0,
    FV_TYPE_I32 = 1,
    FV_TYPE_I64 = 2,
    FV_TYPE_F32 = 3,
    FV_TYPE_COUNT
};
enum fv_model_flag {
    FV_TENSOR_CONST = 1,
    FV_TENSOR_SIGNED = 2
}; /* SIGNED: was int8 in the .tflite file */

struct fv_model_tensor {
    int32_t type, flags, rank, dims[6];
    int32_t bytes;  /* from the first to the last byte that belongs to it */
    int32_t offset; /* into the arena, or the file when constant */
    float scale;
    int32_t zero;    /* in unsigned form */
    int32_t source;  /* tensor in the .tflite file, -1: none */
    int32_t storage; /* record of the whole */
    int32_t
        pixel_stride; /* bytes between neighbours along all axes but the last, which is packed */
};

enum fv_model_op_kind {
    FV_OP_NONE = 0,
    FV_OP_CONV, /* convolution of any kind but depthwise, phases of transposed ones, fully connected
                   layers */
    FV_OP_DEPTHWISE,
    FV_OP_BINARY, /* add, subtract, multiply, maximum, minimum, prelu, divide with broadcasting */
    FV_OP_POOL,
    FV_OP_REDUCE, /* mean, sum, maximum, minimum over axes */
    FV_OP_COPY, /* any move of bytes (transpose, slice, concatenate, tile, ...), through a table if
                   given */
    FV_OP_FILL,
    FV_OP_RESIZE,
    FV_OP_SOFTMAX,
    FV_OP_ARG_MAX,
    FV_OP_DEQUANTIZE,
    FV_OP_QUANTIZE,
    FV_OP_CAST,
    FV_OP_BATCH_MATMUL,
    FV_OP_DETECTION, /* TFLite_Detection_PostProcess */
    FV_OP_NORMALISE, /* each row by its length (L2_NORMALIZATION) */
    FV_OP_KIND_COUNT
};

/* Shapes of an operator on images [batch][h][w][c]; strides are bytes from pixel to pixel, rows
 * follow without gap. */
struct fv_op_image {
    int32_t batch, in_h, in_w, in_c, in_stride, out_h, out_w, out_c, out_stride;
};
struct fv_op_window {
    int32_t kh, kw, stride_y, stride_x, dilation_y, dilation_x, pad_top, pad_left;
};

/* Words that are offsets count bytes from the start of the file; 0 in `table` means none. Per
 * channel: int32 bias (holding everything constant), multiplier and shift, padded to 16 channels.
 */
struct fv_op_conv {
    struct fv_op_image image;
    struct fv_op_window window;
    int32_t k, k4; /* products per output, and the number of groups of 4 that hold them */
    int32_t zero_in, zero_out, act_min, act_max;
    int32_t row_sum_factor;  /* times the sum of the inputs of an output pixel, added to each
                                accumulator */
    int32_t single_rounding; /* 1: multiplier and shift are the low and high word of a double,
                                rounded once */
    int32_t weights;         /* int8 [out_c / 16][k4][16][4], k in order ky, kx, channel */
    int32_t bias, multiplier, shift, table;
    /* Where output pixels lie that are not neighbours, as those of one phase of a transposed
     * convolution, or of some columns alone, whose pad_left may be below zero: bytes before the
     * first, and from row to row; 0: rows follow without gap. */
    int32_t out_first, out_row;
    int32_t parts; /* of the products of a row of a fully connected layer; 0: 1 */
};
struct fv_op_depthwise {
    struct fv_op_image image;
    struct fv_op_window window;
    int32_t zero_in, zero_out, act_min, act_max;
    int32_t planes;  /* 1..3: weights are the sum of this number of int8 planes */
    int32_t c16;     /* channels rounded up to 16 */
    int32_t weights; /* int8 [planes][kh kw][c16] */
    int32_t bias, multiplier, shift, table;
};
enum fv_binary {
    FV_BINARY_ADD,
    FV_BINARY_SUB,
    FV_BINARY_MUL,
    FV_BINARY_MAX,
    FV_BINARY_MIN,
    FV_BINARY_PRELU,
    FV_BINARY_TABLE, /* any function of two bytes: `table` has 65,536, that of a and b at 256 a + b
                      */
    FV_BINARY_SLOPES /* of a alone, by place in the row: `table` has float[dims[5] + 1], of values
                        below zero_a at each place, then of the others (fv_k_nn_slopes_u8_fn) */
};
struct fv_op_binary {
    int32_t function, dims[6], a[6], b[6], out[6]; /* byte strides by axis */
    int32_t zero_a, zero_b, zero_out, m_a, s_a, m_b, s_b, m_out, s_out, act_min, act_max, table;
};
struct fv_op_pool {
    struct fv_op_image image;
    struct fv_op_window window;
    int32_t average, is_signed, act_min, act_max;
    /* Of a row of pixels, by taps: of the first pixel, then of the next. Averages have int32[in_c]
     * in scratch. 0: 1. */
    int32_t parts;
};
/* MEAN is SUM too: only the multiplier tells them apart */
enum fv_reduce { FV_REDUCE_MEAN, FV_REDUCE_MAX, FV_REDUCE_MIN };
struct fv_op_reduce {
    /* kept axes with strides, dropped axes with strides */
    int32_t function, dims[4], outer[4], count[4], inner[4];
    int32_t elements, multiplier, shift, zero_in, zero_out;
    /* Of a row, by elements: of the first FV_MODEL_REDUCE_LANES results (of one where outer[3] is
     * not 1), then of the next. They have int32[FV_MODEL_REDUCE_LANES] in scratch. 0: 1. */
    int32_t parts;
};
struct fv_op_copy {
    int32_t dims[6], src[6], dst[6], src_first, dst_first, element_bytes, table;
};
struct fv_op_fill {
    int32_t bytes, value;
};
enum fv_resize { FV_RESIZE_NEAREST, FV_RESIZE_FLOAT, FV_RESIZE_SIGNED, FV_RESIZE_EXACT };
struct fv_op_resize {
    struct fv_op_image image;
    /* tables of 3 words per output row or column: lower, upper, weight of the upper one */
    int32_t mode, rows, columns;
    /* EXACT: weights are whole, in 2^-bits, where float arithmetic makes no error; SIGNED: the
     * same for int8 */
    int32_t bits;
};
struct fv_op_softmax {
    int32_t outer, depth,
        table; /* int32[256]: exp(-d) in Q0.31 by distance from the maximum, -1: left out */
};
struct fv_op_arg_max {
    int32_t outer, axis, inner, element_bytes, minimum;
};
struct fv_op_dequantize {
    int32_t count, table; /* float[256] */
};
struct fv_op_quantize {
    int32_t count;
    float scale;
    int32_t zero;
};
struct fv_op_cast {
    int32_t count;
};
struct fv_op_matmul {
    /* strides in bytes; columns of a are packed */
    int32_t batch[2], a_batch[2], b_batch[2], m, k, n, a_row, b_row, b_column;
    int32_t zero_a, zero_b, zero_out, multiplier, shift;
    int32_t single_rounding; /* as in convolutions: a fully connected layer whose weights are
                                computed */
    int32_t bias;            /* offset of int32[n], 0: none */
    int32_t pack;            /* columns packed by a slice, a divisor of 16; 0: 16 */
    int32_t parts;           /* of the columns, each of whole blocks of 16; 0: 1 */
};
struct fv_op_detection {
    int32_t anchors, classes, class_offset, max_detections, max_per_anchor, per_class, regular_nms;
    float score_threshold, iou_threshold, y_scale, x_scale, h_scale, w_scale;
    int32_t anchor_data, box_table, score_table; /* float[anchors][4], float[256] twice */
    int32_t parts; /* of each selection, by the boxes that it is compared with; 0: 1 */
};

/* Rows divided by the root of the sum of their squares, in 1/128; the output's zero point is 128.
 */
struct fv_op_normalise {
    int32_t outer, depth, zero_in;
    int32_t is_signed; /* scales by 128 after the first rounding, as the reference does for int8 */
};

struct fv_model_op {
    int32_t kind;
    int32_t code;   /* operator code of the .tflite file, for people */
    int32_t source; /* index of the operator in the .tflite file, -1: added by the import */
    int32_t input_count, output_count, inputs[4], outputs[4];
    int32_t rows;
    int32_t scratch; /* tensor record, or -1 */
    int32_t row_cost;
    union {
        int32_t words[48];
        struct fv_op_conv conv;
        struct fv_op_depthwise depthwise;
        struct fv_op_binary binary;
        struct fv_op_pool pool;
        struct fv_op_reduce reduce;
        struct fv_op_copy copy;
        struct fv_op_fill fill;
        struct fv_op_resize resize;
        struct fv_op_softmax softmax;
        struct fv_op_arg_max arg_max;
        struct fv_op_dequantize dequantize;
        struct fv_op_quantize quantize;
        struct fv_op_cast cast;
        struct fv_op_matmul matmul;
        struct fv_op_detection detection;
        struct fv_op_normalise normalise;
    } u;
};

/* How an image becomes the input: value = pixel (0..255) through `table_*`, see
 * src/nn/input.h. */
enum fv_model_fit { FV_FIT_STRETCH = 0, FV_FIT_LETTERBOX = 1 };
struct fv_model_preprocess {
    int32_t fit;
    int32_t width, height, channels;
    int32_t order; /* 0: red green blue, 1: blue green red, 2: grey */
    /* real input = (pixel - mean) * scale, then quantised with the input tensor's parameters */
    float mean[3];
    float scale[3];
    int32_t pad; /* pixel value of letterbox borders */
    int32_t reserved[4];
};

enum fv_model_decoder {
    FV_DECODER_NONE = 0,
    FV_DECODER_CLASSIFIER,  /* scores of the whole image */
    FV_DECODER_SSD,         /* outputs of FV_OP_DETECTION */
    FV_DECODER_SSD_RAW,     /* box encodings and scores with anchors in the file */
    FV_DECODER_YOLOV5,      /* [n][5 + classes]: centre, size, objectness, classes */
    FV_DECODER_YOLOV8,      /* [4 + classes][n] */
    FV_DECODER_YOLOV2,      /* [h][w][anchors (5 + classes)] */
    FV_DECODER_FOMO,        /* [h][w][1 + classes], class 0 is background */
    FV_DECODER_SEGMENT,     /* [h][w] class indices, or [h][w][classes] scores */
    FV_DECODER_EMBEDDING,   /* numbers that only other embeddings compare with: raw outputs */
    FV_DECODER_YOLOV8_POSE, /* [4 + classes + points * values][n] */
    FV_DECODER_YOLOV8_SEG,  /* [4 + classes + coefficients][n], and prototypes [h][w][coefficients]
                             */
    FV_DECODER_YOLOV8_OBB,  /* [4 + classes + 1][n]: boxes turned about their centre by the last */
    FV_DECODER_END2END, /* [n][6 + points * values]: corners, score, class; no suppression is due */
    FV_DECODER_MOVENET, /* [points][3]: y x score; or [n][points * 3 + 5], corners and score last */
    FV_DECODER_BLAZE,   /* [n][4 + points * 2] and [n][1] against anchors */
    FV_DECODER_LANDMARKS, /* [points][values] of one object, and its score */
    FV_DECODER_YOLOX,     /* [n][5 + classes], in cells of 8, 16, 32 and 64 pixels */
    FV_DECODER_YOLOV3,    /* several [h][w][anchors (5 + classes)], before their activation */
    FV_DECODER_COUNT
};
enum { FV_LOGITS_SCORES = 1, FV_LOGITS_POINTS = 2 };
enum { FV_ROLE_BOXES = 0, FV_ROLE_SCORES, FV_ROLE_PROTOTYPES };
enum { FV_MODEL_POINTS_MAX = 1000, FV_MODEL_POINT_VALUES_MAX = 8, FV_MODEL_COEFFICIENTS_MAX = 256 };
struct fv_model_decode {
    int32_t kind, classes;
    float score_threshold, iou_threshold;
    int32_t class_agnostic, max_detections;
    int32_t normalised; /* box coordinates are fractions of the input size, not pixels */
    int32_t anchor_count;
    float anchors[16];   /* width, height pairs (YOLOv2: in cells) */
    int32_t first_label; /* index of the label of class 0 */
    int32_t background;  /* classifiers: class 0 is background */
    int32_t thresholds;  /* offset of float[classes], 0: score_threshold for all */
    int32_t anchor_data; /* SSD_RAW: offset of float[n][4] */
    float box_scales[4]; /* SSD_RAW: y x h w */
    /* Keypoints of each object, the numbers of each, and which of these is its score (0: none). */
    int32_t point_count, point_values, point_score;
    int32_t logits; /* bits FV_LOGITS_*: what is still before its LOGISTIC */
    /* The output, counted from 1, that holds boxes or points, scores, prototypes; 0: the first,
     * second, third. */
    int32_t roles[3];
    int32_t coefficients; /* of a mask */
    /* Colours of classes: offset of uint8_t[colour_count][3], red green blue; 0: none are given. */
    int32_t colours, colour_count;
    int32_t probabilities; /* SEGMENT: the scores of a pixel are probabilities */
    int32_t reserved[21];
};

struct fv_model_header {
    char magic[4]; /* "FVM" 1 */
    uint32_t version, file_bytes, checksum;
    uint32_t reserved;
    uint32_t tensor_count, tensors, op_count, ops;
    uint32_t input_count, inputs, output_count, outputs;
    uint32_t label_count, labels, label_bytes;
    uint32_t data, data_bytes;
    uint32_t arena_bytes; /* slack included */
    uint32_t macs_low, macs_high;
    uint32_t output_names, output_name_bytes; /* zero-terminated, one per output; 0: none */
    uint32_t unused;
    char name[64];
    struct fv_model_preprocess preprocess;
    struct fv_model_decode decode;
    uint32_t state_count, states; /* indices of tensors, as inputs and outputs are */
    uint32_t tail[6];
};

/* A checked model. Views into the caller's bytes, which must stay where they are while the model is
 * used, and a table beside them that a network is set up with. */
struct fv_model {
    const uint8_t *base;
    const struct fv_model_header *header;
    const struct fv_model_tensor *tensors;
    const struct fv_model_op *ops;
    const int32_t *inputs, *outputs, *states;
    uint32_t *real; /* nn/real.h; NULL: none */
};

/* Check `bytes` bytes at `data` (64-byte aligned) as a model file. Init-only.
 * FOVEA_ERROR_INPUT: `error` names the byte at fault, what was found and what was expected; `model`
 * is untouched. `name` stands in error texts. */
enum fovea_status fv_model_open(const void *data, size_t bytes, const char *name,
                                struct fv_model *model, struct fovea_error *error);

/* Label of a class, or NULL. Any thread. */
const char *fv_model_label(const struct fv_model *model, int32_t index);
/* Colour of a class as the file gives it, red green blue, or NULL. Any thread. */
const uint8_t *fv_model_colour(const struct fv_model *model, int32_t class_id);
static inline uint32_t fv_model_label_count(const struct fv_model *model)
{
    return model->header->label_count;
}
/* Name of an output in the .tflite file, or NULL. Any thread. */
const char *fv_model_output_name(const struct fv_model *model, uint32_t index);
/* How many inputs and outputs it has, and the tensor that output `index` is. Any thread. */
static inline uint32_t fv_model_input_count(const struct fv_model *model)
{
    return model->header->input_count;
}
static inline uint32_t fv_model_output_count(const struct fv_model *model)
{
    return model->header->output_count;
}
/* How many tensors keep their bytes from run to run. Any thread. */
static inline uint32_t fv_model_state_count(const struct fv_model *model)
{
    return model->header->state_count;
}
static inline int32_t fv_model_output(const struct fv_model *model, uint32_t index)
{
    return model->outputs[index];
}
static inline const char *fv_model_name(const struct fv_model *model)
{
    return model->header->name;
}

/* Name of an operator kind for people. Any thread, never NULL. */
const char *fv_model_kind_name(int32_t kind);

/* CRC-32 as in zlib. Any thread. */
uint32_t fv_model_checksum(const uint8_t *data, size_t bytes);

#ifdef __cplusplus
}
#endif
#endif

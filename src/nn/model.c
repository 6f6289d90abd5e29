#include "nn/model.h"

#include <string.h>

#include "nn/model_check.h"

uint32_t fv_model_checksum(const uint8_t *data, size_t bytes)
{
    uint32_t table[8][256];
    for (uint32_t i = 0; i < 256; i++) {
        uint32_t value = i;
        for (int bit = 0; bit < 8; bit++)
            value = (value >> 1) ^ ((value & 1u) != 0 ? 0xEDB88320u : 0u);
        table[0][i] = value;
    }
    for (uint32_t i = 0; i < 256; i++) {
        for (int k = 1; k < 8; k++)
            table[k][i] = (table[k - 1][i] >> 8) ^ table[0][table[k - 1][i] & 0xFF];
    }
    uint32_t crc = 0xFFFFFFFFu;
    size_t i = 0;
    for (; i + 8 <= bytes; i += 8) { /* eight bytes at a time ("slicing by 8") */
        uint32_t low, high;
        memcpy(&low, data + i, 4);
        memcpy(&high, data + i + 4, 4);
        low ^= crc;
        crc = table[7][low & 0xFF] ^ table[6][low >> 8 & 0xFF] ^ table[5][low >> 16 & 0xFF] ^
              table[4][low >> 24] ^ table[3][high & 0xFF] ^ table[2][high >> 8 & 0xFF] ^
              table[1][high >> 16 & 0xFF] ^ table[0][high >> 24];
    }
    for (; i < bytes; i++)
        crc = (crc >> 8) ^ table[0][(crc ^ data[i]) & 0xFF];
    return ~crc;
}

static enum fovea_status fail(struct fovea_error *error, const char *name, size_t byte,
                              const char *what, int64_t found, const char *expected)
{
    return fovea_error_set(error, FOVEA_ERROR_INPUT, "%s: byte %zu: %s is %lld, expected %s", name,
                           byte, what, (long long)found, expected);
}

/* A table of `count` entries of `size` bytes at `offset`, aligned to 4, inside the file. */
static int fits(const struct fv_model_header *h, uint32_t offset, uint64_t count, uint64_t size)
{
    return offset % 4 == 0 && offset >= FV_MODEL_HEADER_BYTES && offset <= h->file_bytes &&
           count * size <= h->file_bytes - offset;
}

static enum fovea_status check_header(const struct fv_model_header *h, size_t bytes,
                                      const char *name, struct fovea_error *error)
{
    static const char magic[4] = {'F', 'V', 'M', 1};
    if (bytes < FV_MODEL_HEADER_BYTES)
        return fail(error, name, bytes, "the file's size", (int64_t)bytes, "at least 512 bytes");
    if (memcmp(h->magic, magic, sizeof magic) != 0) {
        return fovea_error_set(
            error, FOVEA_ERROR_INPUT,
            "%s: byte 0: not a Fovea model (found %02x %02x %02x %02x, expected 46 56 4d 01)", name,
            (unsigned)(uint8_t)h->magic[0], (unsigned)(uint8_t)h->magic[1],
            (unsigned)(uint8_t)h->magic[2], (unsigned)(uint8_t)h->magic[3]);
    }
    if (h->version < FV_MODEL_VERSION_STATELESS)
        return fail(error, name, 4, "the version of the model format", h->version,
                    "2 to 5: only the Fovea before 0.1 that made it reads it, import the .tflite "
                    "file again");
    if (h->version > FV_MODEL_VERSION)
        return fail(error, name, 4, "the version of the model format", h->version,
                    "2 to 5: a later Fovea made it and reads it, or import the .tflite file again");
    if (h->file_bytes != bytes)
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "%s: byte 8: the stated size is %llu, expected the file's %zu", name,
                               (unsigned long long)h->file_bytes, bytes);
    if (bytes > FV_MODEL_BYTES_MAX)
        return fail(error, name, 8, "the size", h->file_bytes, "at most 2^28");
    const uint32_t crc = fv_model_checksum((const uint8_t *)h + 16, bytes - 16);
    if (crc != h->checksum)
        return fail(error, name, 12, "the checksum", h->checksum,
                    "that of the contents: the file is damaged");
    if (h->tensor_count > FV_MODEL_TENSORS_MAX ||
        !fits(h, h->tensors, h->tensor_count, sizeof(struct fv_model_tensor))) {
        return fail(error, name, 20, "the tensor count", h->tensor_count,
                    "a table inside the file");
    }
    if (h->op_count > FV_MODEL_OPS_MAX ||
        !fits(h, h->ops, h->op_count, sizeof(struct fv_model_op))) {
        return fail(error, name, 28, "the operator count", h->op_count, "a table inside the file");
    }
    if (h->input_count < 1 || h->input_count > FV_MODEL_IO_MAX ||
        !fits(h, h->inputs, h->input_count, 4)) {
        return fail(error, name, 36, "the input count", h->input_count, "1 to 16");
    }
    if (h->output_count < 1 || h->output_count > FV_MODEL_IO_MAX ||
        !fits(h, h->outputs, h->output_count, 4)) {
        return fail(error, name, 44, "the output count", h->output_count, "1 to 16");
    }
    const uint32_t most = h->version == FV_MODEL_VERSION_STATELESS ? 0 : FV_MODEL_IO_MAX,
                   least = h->version == FV_MODEL_VERSION_STATES;
    if (h->state_count > most || h->state_count < least ||
        (h->state_count > 0 && !fits(h, h->states, h->state_count, 4))) {
        return fail(
            error, name, offsetof(struct fv_model_header, state_count), "the number of states",
            h->state_count,
            "0 in version 2, 1 to 16 in version 3, at most 16 in later ones, inside the file");
    }
    if (h->label_count > FV_MODEL_LABELS_MAX || !fits(h, h->labels, h->label_bytes, 1)) {
        return fail(error, name, 52, "the label count", h->label_count,
                    "at most 4096 inside the file");
    }
    if (h->arena_bytes < FV_MODEL_SLACK_BYTES || h->arena_bytes > FV_MODEL_ARENA_BYTES_MAX) {
        return fail(error, name, 72, "the arena's size", h->arena_bytes, "64 to 2^28 bytes");
    }
    if (memchr(h->name, 0, sizeof h->name) == NULL)
        return fail(error, name, 96, "the name", 0, "a zero within 64 bytes");
    return FOVEA_OK;
}

/* How many zero-terminated texts fill `bytes` bytes at `text`; -1: the last one does not end. */
static int64_t texts_in(const uint8_t *text, uint32_t bytes)
{
    int64_t zeros = 0;
    for (uint32_t i = 0; i < bytes; i++)
        zeros += text[i] == 0;
    return bytes == 0 || text[bytes - 1] == 0 ? zeros : -1;
}

static enum fovea_status check_texts(const struct fv_model_header *h, const uint8_t *base,
                                     const char *name, struct fovea_error *error)
{
    const int64_t labels = texts_in(base + h->labels, h->label_bytes);
    if (labels != (int64_t)h->label_count)
        return fail(error, name, h->labels, "the number of labels", labels, "as many as stated");
    if (h->output_names == 0) return FOVEA_OK;
    const size_t at = offsetof(struct fv_model_header, output_names);
    if (h->output_names < FV_MODEL_HEADER_BYTES || h->output_names > h->file_bytes ||
        h->output_name_bytes > h->file_bytes - h->output_names)
        return fail(error, name, at, "the offset of the outputs' names", h->output_names,
                    "a place inside the file");
    const int64_t names = texts_in(base + h->output_names, h->output_name_bytes);
    if (names != (int64_t)h->output_count)
        return fail(error, name, at, "the number of the outputs' names", names,
                    "as many as outputs");
    return FOVEA_OK;
}

static int64_t elements(const struct fv_model_tensor *t)
{
    int64_t count = 1;
    for (int32_t i = 0; i < t->rank; i++) {
        if (t->dims[i] < 1 || count > (INT64_C(1) << 31) / t->dims[i]) return -1;
        count *= t->dims[i];
    }
    return count;
}

/* Word of the record at fault, or -1. */
static int32_t tensor_fault(const struct fv_model *m, const struct fv_model_tensor *t)
{
    static const int32_t size[FV_TYPE_COUNT] = {1, 4, 8, 4};
    const struct fv_model_header *h = m->header;
    if (t->type < 0 || t->type >= FV_TYPE_COUNT) return 0;
    if ((t->flags & ~(FV_TENSOR_CONST | FV_TENSOR_SIGNED)) != 0) return 1;
    if (t->rank < 0 || t->rank > 6) return 2;
    const int64_t count = elements(t);
    if (count < 1) return 3;
    const int32_t last = t->rank == 0 ? 1 : t->dims[t->rank - 1];
    if (t->pixel_stride < (int64_t)last * size[t->type]) return 15;
    if (t->pixel_stride != (int64_t)last * size[t->type] && t->type != FV_TYPE_U8) return 15;
    const int64_t bytes = (count / last - 1) * t->pixel_stride + (int64_t)last * size[t->type];
    if (t->bytes != bytes) return 9;
    const int64_t room = (t->flags & FV_TENSOR_CONST) != 0 ? h->file_bytes : h->arena_bytes;
    if (t->offset < 0 || t->offset % size[t->type] != 0 ||
        t->offset + bytes + FV_MODEL_SLACK_BYTES > room)
        return 10;
    if (!(t->scale > 0.0f && t->scale < 1e30f)) return 11;
    if (t->zero < 0 || t->zero > 255) return 12;
    if (t->storage < 0 || (uint32_t)t->storage >= h->tensor_count) return 14;
    const struct fv_model_tensor *whole = &m->tensors[t->storage];
    if (&m->tensors[whole->storage < 0 || (uint32_t)whole->storage >= h->tensor_count
                        ? 0
                        : whole->storage] != whole)
        return 14;
    if (((whole->flags ^ t->flags) & FV_TENSOR_CONST) != 0 || t->offset < whole->offset ||
        t->offset + bytes > (int64_t)whole->offset + whole->bytes)
        return 14;
    return -1;
}

static enum fovea_status check_tensors(const struct fv_model *m, const char *name,
                                       struct fovea_error *error)
{
    static const char *const words[16] = {
        "type",  "flags", "rank",   "shape", "shape",      "shape",  "shape",   "shape",
        "shape", "size",  "offset", "scale", "zero point", "source", "storage", "pixel stride"};
    for (uint32_t i = 0; i < m->header->tensor_count; i++) {
        const int32_t fault = tensor_fault(m, &m->tensors[i]);
        if (fault < 0) continue;
        int32_t found;
        memcpy(&found, (const uint8_t *)&m->tensors[i] + fault * 4, 4);
        return fovea_error_set(
            error, FOVEA_ERROR_INPUT,
            "%s: byte %zu: tensor %u: %s %d does not fit the type, the shape or the memory", name,
            (size_t)m->header->tensors + i * sizeof *m->tensors + (size_t)fault * 4, i,
            words[fault], found);
    }
    return FOVEA_OK;
}

/* Whether scratch shares bytes of the arena with an operand: what is kept there (indices among
 * others) must stay as written. */
static int scratch_is_shared(const struct fv_model *m, const struct fv_model_op *op)
{
    const struct fv_model_tensor *s = &m->tensors[op->scratch];
    for (int32_t i = 0; i < op->input_count + op->output_count; i++) {
        const struct fv_model_tensor *t =
            &m->tensors[i < op->input_count ? op->inputs[i] : op->outputs[i - op->input_count]];
        if ((t->flags & FV_TENSOR_CONST) != 0) continue;
        if (t->offset < (int64_t)s->offset + s->bytes && s->offset < (int64_t)t->offset + t->bytes)
            return 1;
    }
    return 0;
}

/* Inputs were written before and outputs are no constants: `written` holds a bit per storage
 * record. */
static const char *order_fault(const struct fv_model *m, const struct fv_model_op *op,
                               uint8_t *written, int32_t *word)
{
    const int32_t count = (int32_t)m->header->tensor_count;
    *word = 3;
    if (op->input_count < 0 || op->input_count > 4 || op->output_count < 1 || op->output_count > 4)
        return "operand count out of range";
    for (int32_t i = 0; i < op->input_count; i++) {
        *word = 5 + i;
        if (op->inputs[i] < 0 || op->inputs[i] >= count) return "no such tensor";
        const struct fv_model_tensor *t = &m->tensors[op->inputs[i]];
        if ((t->flags & FV_TENSOR_CONST) == 0 &&
            (written[t->storage / 8] >> t->storage % 8 & 1) == 0) {
            return "reads a tensor that nothing wrote before (a cycle or a gap)";
        }
    }
    for (int32_t i = 0; i < op->output_count; i++) {
        *word = 9 + i;
        if (op->outputs[i] < 0 || op->outputs[i] >= count) return "no such tensor";
        const struct fv_model_tensor *t = &m->tensors[op->outputs[i]];
        if ((t->flags & FV_TENSOR_CONST) != 0) return "writes a constant";
        written[t->storage / 8] |= (uint8_t)(1 << t->storage % 8);
    }
    *word = 14;
    if (op->scratch < -1 || op->scratch >= count) return "no such tensor";
    if (op->scratch >= 0 && (m->tensors[op->scratch].flags & FV_TENSOR_CONST) != 0)
        return "scratch is a constant";
    if (op->scratch >= 0 && scratch_is_shared(m, op))
        return "scratch shares memory with an operand";
    *word = 15;
    if (op->row_cost < 1) return "row cost below 1";
    return NULL;
}

static enum fovea_status check_io(const struct fv_model *m, uint8_t *written, int outputs,
                                  const char *name, struct fovea_error *error)
{
    const struct fv_model_header *h = m->header;
    const int32_t *list = outputs ? m->outputs : m->inputs;
    const uint32_t count = outputs ? h->output_count : h->input_count;
    const size_t at = outputs ? h->outputs : h->inputs;
    for (uint32_t i = 0; i < count; i++) {
        if (list[i] < 0 || (uint32_t)list[i] >= h->tensor_count)
            return fail(error, name, at + 4 * i, "the tensor", list[i], "one that exists");
        const struct fv_model_tensor *t = &m->tensors[list[i]];
        const int is_const = (t->flags & FV_TENSOR_CONST) != 0;
        if (!outputs) {
            if (is_const) return fail(error, name, at + 4 * i, "the input", list[i], "no constant");
            written[t->storage / 8] |= (uint8_t)(1 << t->storage % 8);
        } else if (!is_const && (written[t->storage / 8] >> t->storage % 8 & 1) == 0) {
            return fail(error, name, at + 4 * i, "the output", list[i], "a tensor that is written");
        }
    }
    return FOVEA_OK;
}

static enum fovea_status check_ops(const struct fv_model *m, const char *name,
                                   struct fovea_error *error)
{
    uint8_t written[FV_MODEL_TENSORS_MAX / 8];
    memset(written, 0, sizeof written);
    enum fovea_status status = check_io(m, written, 0, name, error);
    if (status != FOVEA_OK) return status;
    for (uint32_t i = 0; i < m->header->state_count; i++) { /* by earlier runs */
        const struct fv_model_tensor *t = &m->tensors[m->states[i]];
        written[t->storage / 8] |= (uint8_t)(1 << t->storage % 8);
    }
    for (uint32_t i = 0; i < m->header->op_count; i++) {
        const struct fv_model_op *op = &m->ops[i];
        int32_t word = 0;
        const char *fault = op->kind <= FV_OP_NONE || op->kind >= FV_OP_KIND_COUNT
                                ? "unknown kind"
                                : order_fault(m, op, written, &word);
        if (fault == NULL) fault = fv_model_check_op(m, op, &word);
        if (fault == NULL) continue;
        int32_t found;
        memcpy(&found, (const uint8_t *)op + word * 4, 4);
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "%s: byte %zu: operator %u (%s): %s (found %d)", name,
                               (size_t)m->header->ops + i * sizeof *op + (size_t)word * 4, i,
                               fv_model_kind_name(op->kind), fault, found);
    }
    return check_io(m, written, 1, name, error);
}

/* A float of the header is a plain number. */
static int finite_between(float value, float low, float high)
{
    return value >= low && value <= high;
}

static enum fovea_status check_use(const struct fv_model *m, const char *name,
                                   struct fovea_error *error)
{
    const struct fv_model_preprocess *p = &m->header->preprocess;
    const struct fv_model_decode *d = &m->header->decode;
    const size_t at = offsetof(struct fv_model_header, preprocess),
                 to = offsetof(struct fv_model_header, decode);
    if (p->fit < 0 || p->fit > 1) return fail(error, name, at, "the fit", p->fit, "0 or 1");
    if (p->width < 0 || p->width > 8192 || p->height < 0 || p->height > 8192)
        return fail(error, name, at + 4, "the image size", p->width, "0 to 8192");
    if (p->channels < 0 || p->channels > 4 || p->order < 0 || p->order > 2)
        return fail(error, name, at + 12, "the channels", p->channels, "0 to 4");
    for (int i = 0; i < 3; i++) {
        if (!finite_between(p->mean[i], -1e6f, 1e6f) || !finite_between(p->scale[i], -1e6f, 1e6f)) {
            return fail(error, name, at + 20 + 4 * (size_t)i, "the mean or scale", i,
                        "a number up to 1e6");
        }
    }
    if (p->pad < 0 || p->pad > 255)
        return fail(error, name, at + 44, "the border", p->pad, "0 to 255");
    if (d->kind < 0 || d->kind >= FV_DECODER_COUNT)
        return fail(error, name, to, "the decoder", d->kind, "a known kind");
    if (d->classes < 0 || d->classes > FV_MODEL_LABELS_MAX)
        return fail(error, name, to + 4, "the number of classes", d->classes, "0 to 4096");
    if (!finite_between(d->score_threshold, 0, 1) || !finite_between(d->iou_threshold, 0, 1))
        return fail(error, name, to + 8, "a threshold", 0, "0 to 1");
    if (d->max_detections < 0 || d->max_detections > 4096)
        return fail(error, name, to + 20, "the number of detections", d->max_detections,
                    "0 to 4096");
    if (d->anchor_count < 0 || d->anchor_count > 8)
        return fail(error, name, to + 28, "the number of anchors", d->anchor_count, "0 to 8");
    for (int i = 0; i < 16; i++) {
        if (!finite_between(d->anchors[i], 0, 1e6f))
            return fail(error, name, to + 32, "an anchor", i, "0 to 1e6");
    }
    if (d->point_count < 0 || d->point_count > FV_MODEL_POINTS_MAX)
        return fail(error, name, to + 128, "the number of keypoints", d->point_count, "0 to 1000");
    const int32_t least = d->point_count > 0 ? 2 : 0;
    if (d->point_values < least || d->point_values > FV_MODEL_POINT_VALUES_MAX)
        return fail(error, name, to + 132, "the numbers of a keypoint", d->point_values, "2 to 8");
    if (d->point_score < 0 || d->point_score >= d->point_values + (d->point_count == 0))
        return fail(error, name, to + 136, "the number that is a keypoint's score", d->point_score,
                    "one that it has");
    if (d->coefficients < 0 || d->coefficients > FV_MODEL_COEFFICIENTS_MAX)
        return fail(error, name, to + 156, "the coefficients of a mask", d->coefficients,
                    "0 to 256");
    for (size_t i = 0; i < sizeof d->roles / sizeof *d->roles; i++) {
        if (d->roles[i] < 0 || (uint32_t)d->roles[i] > m->header->output_count)
            return fail(error, name, to + 144 + 4 * i, "an output of the decoder", d->roles[i],
                        "one of the file's");
    }
    if (d->thresholds != 0 &&
        (d->thresholds < 0 || !fits(m->header, (uint32_t)d->thresholds, (uint64_t)d->classes, 4))) {
        return fail(error, name, to + 104, "the thresholds' offset", d->thresholds,
                    "a table inside the file");
    }
    if (d->colour_count < 0 || d->colour_count > FV_MODEL_LABELS_MAX)
        return fail(error, name, to + 164, "the number of colours", d->colour_count, "0 to 4096");
    if (d->colour_count > 0 &&
        (d->colours < 0 || !fits(m->header, (uint32_t)d->colours, (uint64_t)d->colour_count, 3)))
        return fail(error, name, to + 160, "the colours' offset", d->colours,
                    "a table inside the file");
    return FOVEA_OK;
}

enum fovea_status fv_model_open(const void *data, size_t bytes, const char *name,
                                struct fv_model *model, struct fovea_error *error)
{
    if ((uintptr_t)data % 64 != 0)
        return fovea_error_set(error, FOVEA_ERROR_ARGUMENT,
                               "%s: loaded at an address that is not a multiple of 64", name);
    const uint8_t *base = data;
    const struct fv_model_header *h = data;
    enum fovea_status status = check_header(h, bytes, name, error);
    if (status != FOVEA_OK) return status;
    const struct fv_model m = {
        .base = base,
        .header = h,
        .tensors = (const struct fv_model_tensor *)(const void *)(base + h->tensors),
        .ops = (const struct fv_model_op *)(const void *)(base + h->ops),
        .inputs = (const int32_t *)(const void *)(base + h->inputs),
        .outputs = (const int32_t *)(const void *)(base + h->outputs),
        .states = h->state_count == 0 ? NULL : (const int32_t *)(const void *)(base + h->states),
    };
    status = check_texts(h, base, name, error);
    if (status == FOVEA_OK) status = check_tensors(&m, name, error);
    if (status == FOVEA_OK) status = fv_model_check_state_list(&m, name, error);
    if (status == FOVEA_OK) status = check_ops(&m, name, error);
    if (status == FOVEA_OK) status = fv_model_check_state_use(&m, name, error);
    if (status == FOVEA_OK) status = check_use(&m, name, error);
    if (status == FOVEA_OK) *model = m;
    return status;
}

/* Text `index` of those that stand at `text`. */
static const char *text_at(const char *text, uint32_t index)
{
    for (uint32_t i = 0; i < index; i++)
        text += strlen(text) + 1;
    return text;
}

const char *fv_model_label(const struct fv_model *model, int32_t index)
{
    const struct fv_model_header *h = model->header;
    if (index < 0 || (uint32_t)index >= h->label_count) return NULL;
    return text_at((const char *)model->base + h->labels, (uint32_t)index);
}

const uint8_t *fv_model_colour(const struct fv_model *model, int32_t class_id)
{
    const struct fv_model_decode *d = &model->header->decode;
    if (class_id < 0 || class_id >= d->colour_count) return NULL;
    return model->base + d->colours + (size_t)class_id * 3;
}

const char *fv_model_output_name(const struct fv_model *model, uint32_t index)
{
    const struct fv_model_header *h = model->header;
    if (h->output_names == 0 || index >= h->output_count) return NULL;
    return text_at((const char *)model->base + h->output_names, index);
}

const char *fv_model_kind_name(int32_t kind)
{
    static const char *const names[FV_OP_KIND_COUNT] = {
        "none",     "convolution", "depthwise",      "binary",    "pool",     "reduce",
        "copy",     "fill",        "resize",         "softmax",   "arg max",  "dequantise",
        "quantise", "cast",        "matrix product", "detection", "normalise"};
    return kind < 0 || kind >= FV_OP_KIND_COUNT ? "unknown" : names[kind];
}

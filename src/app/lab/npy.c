#include "app/lab/npy.h"

#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

#include "nn/model.h"
#include "support/input.h"
#include "support/text.h"

static const struct type {
    const char *descr, *name;
    size_t bytes;
} types[] = {[FOVEA_TENSOR_INT8] = {"|i1", "int8", 1},
             [FOVEA_TENSOR_UINT8] = {"|u1", "uint8", 1},
             [FOVEA_TENSOR_INT32] = {"<i4", "int32", 4},
             [FOVEA_TENSOR_FLOAT32] = {"<f4", "float32", 4},
             [FOVEA_TENSOR_INT64] = {"<i8", "int64", 8}};
enum { TYPE_COUNT = sizeof types / sizeof types[0], DICTIONARY_BYTES = 4096 };

const char *fv_npy_describe(enum fovea_tensor_type type, int32_t axis_count, const int32_t *shape,
                            char *text, size_t bytes)
{
    size_t at = (size_t)snprintf(text, bytes, "%s [", types[type].name);
    for (int32_t i = 0; i < axis_count && at < bytes; i++)
        at += (size_t)snprintf(text + at, bytes - at, "%s%d", i == 0 ? "" : ", ", shape[i]);
    if (at < bytes) snprintf(text + at, bytes - at, "]");
    return text;
}

/* ---- reading --------------------------------------------------------------------------------- */

/* What follows a key of the dictionary, NULL where it has none. */
static const char *value_of(const char *dictionary, const char *key)
{
    const char *at = strstr(dictionary, key);
    if (at == NULL) return NULL;
    at += strlen(key);
    return at + strspn(at, ": ");
}

static bool read_type(const char *descr, enum fovea_tensor_type *type)
{
    for (int i = 0; descr != NULL && i < TYPE_COUNT; i++) {
        if (types[i].descr == NULL || descr[0] != '\'' ||
            strncmp(descr + 1, types[i].descr, 3) != 0 || descr[4] != '\'')
            continue;
        *type = (enum fovea_tensor_type)i;
        return true;
    }
    return false;
}

/* "(1, 24, 32, 3)"; each number from 1 on, their product within 2^31. */
static bool read_shape(const char *at, struct fv_npy *array, size_t *count)
{
    if (at == NULL || *at != '(') return false;
    *count = 1;
    array->axis_count = 0;
    for (at += 1 + strspn(at + 1, " "); *at != ')'; at += strspn(at, ", ")) {
        char *end;
        const long value = strtol(at, &end, 10);
        if (end == at || value < 1 || value > INT32_MAX || array->axis_count == FV_NPY_AXES_MAX ||
            *count > (size_t)INT32_MAX / (size_t)value)
            return false;
        array->shape[array->axis_count++] = (int32_t)value;
        *count *= (size_t)value;
        at = end;
    }
    return true;
}

enum fovea_status fv_npy_parse(const char *name, const uint8_t *data, size_t bytes,
                               struct fv_npy *array, struct fovea_error *error)
{
    char dictionary[DICTIONARY_BYTES];
    *array = (struct fv_npy){.file = NULL};
    if (bytes < 12 || memcmp(data, "\x93NUMPY", 6) != 0)
        return fovea_error_set(error, FOVEA_ERROR_INPUT, "%.300s: byte 0: expected a .npy file",
                               name);
    const size_t begin = data[6] == 1 ? 10 : 12;
    const size_t length = data[6] == 1 ? (size_t)data[8] | (size_t)data[9] << 8
                                       : (size_t)data[8] | (size_t)data[9] << 8 |
                                             (size_t)data[10] << 16 | (size_t)data[11] << 24;
    if (length >= sizeof dictionary || length > bytes - begin)
        return fovea_error_set(
            error, FOVEA_ERROR_INPUT,
            "%.300s: byte 8: found a description of %zu bytes, expected less than %d in the file",
            name, length, DICTIONARY_BYTES);
    memcpy(dictionary, data + begin, length);
    dictionary[length] = 0;
    size_t count;
    const char *order = value_of(dictionary, "'fortran_order'");
    if (!read_type(value_of(dictionary, "'descr'"), &array->type))
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "%.300s: descr: expected int8, uint8, int32, int64 or float32",
                               name);
    if (order == NULL || strncmp(order, "False", 5) != 0)
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "%.300s: fortran_order: expected False, as numpy.ascontiguousarray "
                               "makes it",
                               name);
    if (!read_shape(value_of(dictionary, "'shape'"), array, &count))
        return fovea_error_set(
            error, FOVEA_ERROR_INPUT,
            "%.300s: shape: expected at most %d axes, none empty, of at most 2^31 elements", name,
            FV_NPY_AXES_MAX);
    array->bytes = count * types[array->type].bytes;
    if (array->bytes != bytes - begin - length)
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "%.300s: found %zu bytes of elements, expected %zu", name,
                               bytes - begin - length, array->bytes);
    array->data = data + begin + length;
    return FOVEA_OK;
}

enum fovea_status fv_npy_read(const char *path, struct fv_npy *array, struct fovea_error *error)
{
    char *file;
    size_t bytes;
    *array = (struct fv_npy){.file = NULL};
    enum fovea_status status = fv_text_read(path, FV_INPUT_MODEL_BYTES_MAX, &file, &bytes, error);
    if (status != FOVEA_OK) return status;
    status = fv_npy_parse(path, (const uint8_t *)file, bytes, array, error);
    if (status != FOVEA_OK) {
        free(file);
        return status;
    }
    array->file = file;
    return FOVEA_OK;
}

/* ---- writing --------------------------------------------------------------------------------- */

static void put16(uint8_t *to, uint32_t value)
{
    to[0] = (uint8_t)value;
    to[1] = (uint8_t)(value >> 8);
}

static void put32(uint8_t *to, uint32_t value)
{
    put16(to, value & 0xffff);
    put16(to + 2, value >> 16);
}

static bool put(struct fv_npz *npz, const void *data, size_t bytes)
{
    npz->at += bytes;
    return bytes == 0 || fwrite(data, 1, bytes, npz->stream) == bytes;
}

/* The description before the elements; its length makes them begin at a multiple of 64. */
static size_t describe(const struct fv_npy *array, uint8_t head[512])
{
    static const uint8_t magic[8] = {0x93, 'N', 'U', 'M', 'P', 'Y', 1, 0};
    char *text = (char *)head + 10;
    int n = snprintf(text, 480, "{'descr': '%s', 'fortran_order': False, 'shape': (",
                     types[array->type].descr);
    for (int32_t i = 0; i < array->axis_count; i++)
        n += snprintf(text + n, (size_t)(480 - n), "%d,%s", array->shape[i],
                      i + 1 < array->axis_count ? " " : "");
    n += snprintf(text + n, (size_t)(480 - n), "), }");
    const int bytes = (10 + n + 1 + 63) / 64 * 64;
    memset(text + n, ' ', (size_t)(bytes - 10 - n));
    head[bytes - 1] = '\n';
    memcpy(head, magic, sizeof magic);
    put16(head + 8, (uint32_t)bytes - 10);
    return (size_t)bytes;
}

/* What local and central headers share, from the needed version to the name's length. */
static void put_entry(uint8_t *to, const struct fv_npz_entry *entry)
{
    memset(to, 0, 26);
    put16(to, 20);
    put16(to + 8, 0x21); /* 1 January 1980: the same outputs make the same file */
    put32(to + 10, entry->checksum);
    put32(to + 14, entry->bytes);
    put32(to + 18, entry->bytes);
    put16(to + 22, (uint32_t)strlen(entry->name));
}

void fv_npz_begin(struct fv_npz *npz, FILE *stream)
{
    *npz = (struct fv_npz){.stream = stream};
}

bool fv_npz_add(struct fv_npz *npz, const char *name, const struct fv_npy *array)
{
    uint8_t head[512], local[30] = {'P', 'K', 3, 4};
    const size_t head_bytes = describe(array, head), bytes = head_bytes + array->bytes;
    if (npz->count == FV_NPZ_ENTRIES_MAX || npz->at + bytes + (1 << 16) > UINT32_MAX) return false;
    uint8_t *whole = malloc(bytes);
    if (whole == NULL) return false;
    memcpy(whole, head, head_bytes);
    if (array->bytes > 0) memcpy(whole + head_bytes, array->data, array->bytes);
    struct fv_npz_entry *entry = &npz->entries[npz->count++];
    *entry = (struct fv_npz_entry){.checksum = fv_model_checksum(whole, bytes),
                                   .bytes = (uint32_t)bytes,
                                   .at = (uint32_t)npz->at};
    snprintf(entry->name, sizeof entry->name, "%.70s.npy", name);
    put_entry(local + 4, entry);
    const bool written = put(npz, local, sizeof local) &&
                         put(npz, entry->name, strlen(entry->name)) && put(npz, whole, bytes);
    free(whole);
    return written;
}

bool fv_npz_end(struct fv_npz *npz)
{
    const uint64_t begin = npz->at;
    bool written = true;
    for (int i = 0; i < npz->count && written; i++) {
        uint8_t central[46] = {'P', 'K', 1, 2, 20, 0};
        put_entry(central + 6, &npz->entries[i]);
        put32(central + 42, npz->entries[i].at);
        written = put(npz, central, sizeof central) &&
                  put(npz, npz->entries[i].name, strlen(npz->entries[i].name));
    }
    uint8_t end[22] = {'P', 'K', 5, 6};
    put16(end + 8, (uint32_t)npz->count);
    put16(end + 10, (uint32_t)npz->count);
    put32(end + 12, (uint32_t)(npz->at - begin));
    put32(end + 16, (uint32_t)begin);
    return written && put(npz, end, sizeof end);
}

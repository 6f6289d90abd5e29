#include "app/lab/model_run.h"

#include <stdlib.h>
#include <string.h>

#include "app/lab/commands.h"
#include "app/config/model_file.h"
#include "app/lab/npy.h"
#include "support/aligned.h"
#include "support/picture.h"
#include "support/files.h"
#include "support/output.h"
#include "support/say.h"

struct engine {
    struct fv_model_file file;
    void *memory;
    struct fovea_network *network;
    uint32_t inputs, outputs;
    uint8_t *kept[FV_MODEL_IO_MAX]; /* of each output, all runs one after the other */
};

static void engine_close(struct engine *e)
{
    for (uint32_t i = 0; i < e->outputs; i++)
        free(e->kept[i]);
    free(e->memory);
    fv_model_file_free(&e->file);
}

static enum fovea_status out_of_memory(const char *path, struct fovea_error *error)
{
    return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "%.300s: out of memory", path);
}

static enum fovea_status engine_open(struct engine *e, const char *path, int count,
                                     struct fovea_error *error)
{
    size_t bytes;
    enum fovea_status status = fv_model_file_read(path, &e->file, error);
    if (status == FOVEA_OK) status = fovea_network_size(e->file.data, e->file.bytes, &bytes, error);
    if (status != FOVEA_OK) return status;
    e->memory = fv_aligned_zeroed(bytes);
    if (e->memory == NULL) return out_of_memory(path, error);
    status = fovea_network_init(e->memory, bytes, e->file.data, e->file.bytes, &e->network, error);
    if (status != FOVEA_OK) return status;
    e->inputs = fovea_network_input_count(e->network);
    if ((uint32_t)count % e->inputs != 0)
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "%.300s: found %d files, expected %u for each run, one per input",
                               path, count, e->inputs);
    const size_t runs = (size_t)count / e->inputs;
    e->outputs = fovea_network_output_count(e->network);
    for (uint32_t i = 0; i < e->outputs; i++) {
        struct fovea_tensor t;
        (void)fovea_network_output(e->network, i, &t);
        e->kept[i] = malloc(runs * t.bytes + 1);
        if (e->kept[i] == NULL) return out_of_memory(path, error);
    }
    return FOVEA_OK;
}

/* ---- inputs ---------------------------------------------------------------------------------- */

static bool is_array(const char *path)
{
    const char *dot = strrchr(path, '.');
    return dot != NULL && strcmp(dot, ".npy") == 0;
}

/* Whether two shapes are the same but for axes of 1 at their beginning. */
static bool same_shape(const struct fv_npy *array, const struct fovea_tensor *t)
{
    int32_t a = 0, b = 0;
    while (a < array->axis_count && array->shape[a] == 1)
        a++;
    while (b < t->axis_count && t->shape[b] == 1)
        b++;
    return array->axis_count - a == t->axis_count - b &&
           memcmp(array->shape + a, t->shape + b,
                  (size_t)(t->axis_count - b) * sizeof t->shape[0]) == 0;
}

static enum fovea_status set_array(struct engine *e, uint32_t input, const char *path,
                                   struct fovea_error *error)
{
    struct fv_npy array;
    struct fovea_tensor t;
    char found[128], expected[128];
    enum fovea_status status = fv_npy_read(path, &array, error);
    if (status != FOVEA_OK) return status;
    (void)fovea_network_input(e->network, input, &t);
    if (array.type != t.type || !same_shape(&array, &t)) {
        fv_npy_describe(array.type, array.axis_count, array.shape, found, sizeof found);
        fv_npy_describe(t.type, t.axis_count, t.shape, expected, sizeof expected);
        status = fovea_error_set(error, FOVEA_ERROR_INPUT, "%.300s: found %s, expected %s", path,
                                 found, expected);
    } else {
        status = fovea_network_set(e->network, input, array.data, array.bytes);
    }
    free(array.file);
    return status;
}

static enum fovea_status set_picture(struct engine *e, const char *path, struct fovea_error *error)
{
    struct fovea_image image;
    struct fovea_tensor t;
    char text[128];
    enum fovea_status status = fv_picture_read_colour(path, &image, error);
    if (status != FOVEA_OK) return status;
    if (fovea_network_set_image(e->network, &image) != FOVEA_OK) {
        (void)fovea_network_input(e->network, 0, &t);
        status = fovea_error_set(
            error, FOVEA_ERROR_INPUT,
            "%.300s: found a picture, expected .npy files: the model has %u input%s, the first %s",
            path, e->inputs, e->inputs == 1 ? "" : "s",
            fv_npy_describe(t.type, t.axis_count, t.shape, text, sizeof text));
    }
    free((void *)(uintptr_t)image.data);
    return status;
}

static enum fovea_status run_once(struct engine *e, char **files, size_t run,
                                  struct fovea_error *error)
{
    enum fovea_status status = FOVEA_OK;
    for (uint32_t i = 0; i < e->inputs && status == FOVEA_OK; i++)
        status =
            is_array(files[i]) ? set_array(e, i, files[i], error) : set_picture(e, files[i], error);
    if (status != FOVEA_OK) return status;
    (void)fovea_network_run(e->network, 0);
    for (uint32_t i = 0; i < e->outputs; i++) {
        struct fovea_tensor t;
        (void)fovea_network_output(e->network, i, &t);
        memcpy(e->kept[i] + run * t.bytes, t.data, t.bytes);
    }
    return FOVEA_OK;
}

/* ---- outputs --------------------------------------------------------------------------------- */

static void print_output(const char *key, const struct fovea_tensor *t)
{
    char text[128];
    printf("%-10s%s", key, fv_npy_describe(t->type, t->axis_count, t->shape, text, sizeof text));
    if (t->type == FOVEA_TENSOR_INT8 || t->type == FOVEA_TENSOR_UINT8)
        printf(", scale %.9g, zero point %d", (double)t->scale, t->zero_point);
    printf(", %s\n", t->name);
}

static bool add_output(const struct engine *e, struct fv_npz *npz, uint32_t index, int32_t runs)
{
    struct fovea_tensor t;
    char key[24], name[48];
    (void)fovea_network_output(e->network, index, &t);
    snprintf(key, sizeof key, "output%u", index);
    struct fv_npy array = {.type = t.type,
                           .axis_count = t.axis_count + 1,
                           .shape = {runs},
                           .data = e->kept[index],
                           .bytes = (size_t)runs * t.bytes};
    memcpy(array.shape + 1, t.shape, (size_t)t.axis_count * sizeof t.shape[0]);
    const struct fv_npy scale = {
        .type = FOVEA_TENSOR_FLOAT32, .data = &t.scale, .bytes = sizeof t.scale};
    const struct fv_npy zero = {
        .type = FOVEA_TENSOR_INT32, .data = &t.zero_point, .bytes = sizeof t.zero_point};
    print_output(key, &t);
    if (!fv_npz_add(npz, key, &array)) return false;
    snprintf(name, sizeof name, "%s.scale", key);
    if (!fv_npz_add(npz, name, &scale)) return false;
    snprintf(name, sizeof name, "%s.zero_point", key);
    return fv_npz_add(npz, name, &zero);
}

static void print_states(const struct engine *e, int runs)
{
    const uint32_t count = fv_model_state_count(&e->file.model);
    if (count == 0) return;
    printf("%-10s%u, kept from run to run, zero before the first of %d\n", "states", count, runs);
}

static int write_outputs(const struct engine *e, int32_t runs, const char *out)
{
    struct fovea_error error;
    struct fv_output output = FV_OUTPUT_CLOSED;
    struct fv_npz npz;
    if (fv_output_open(&output, out, FV_OUTPUT_WHOLE, &error) != FOVEA_OK)
        return fv_say_wrong("--out %s", error.text);
    FILE *stream = fv_output_stream(&output);
    bool written = stream != NULL;
    fv_npz_begin(&npz, stream);
    for (uint32_t i = 0; i < e->outputs && written; i++)
        written = add_output(e, &npz, i, runs);
    written = written && fv_npz_end(&npz);
    if (!written) {
        fv_output_discard(&output);
        return fv_say_failed("--out %.300s: not written: the disk is full, or it passes 4 GiB",
                             out);
    }
    if (fv_output_close(&output, &error) != FOVEA_OK) return fv_say_failed("%s", error.text);
    return FV_EXIT_OK;
}

int fv_model_run(const char *path, char **files, int count, const char *out)
{
    struct engine e = {.outputs = 0};
    struct fovea_error error;
    const char *blame;
    const struct fv_file written[] = {{"--out", out}, {0}}, read[] = {{"FILE", path}, {0}};
    enum fovea_status status = fv_files_apart(written, read, &error);
    for (int i = 0; i < count && status == FOVEA_OK; i++) {
        const struct fv_file input[] = {{"INPUT", files[i]}, {0}};
        status = fv_files_apart(written, input, &error);
    }
    if (status == FOVEA_OK) status = fv_files_writable(written, &blame, &error);
    if (status == FOVEA_OK) status = engine_open(&e, path, count, &error);
    const int runs = status == FOVEA_OK ? count / (int)e.inputs : 0;
    for (int i = 0; i < runs && status == FOVEA_OK; i++)
        status = run_once(&e, files + (ptrdiff_t)i * e.inputs, (size_t)i, &error);
    int exit_status;
    if (status == FOVEA_OK) print_states(&e, runs);
    if (status == FOVEA_OK)
        exit_status = write_outputs(&e, runs, out);
    else if (status == FOVEA_ERROR_SYSTEM)
        exit_status = fv_say_failed("%s", error.text);
    else
        exit_status = fv_say_wrong("%s", error.text);
    engine_close(&e);
    return exit_status;
}

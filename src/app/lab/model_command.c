/* fovea model: info says what is in a model file, what it costs, and how fast it runs here; run
 * writes its raw outputs. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "app/lab/commands.h"
#include "support/aligned.h"
#include "app/config/model_file.h"
#include "app/config/options.h"
#include "app/lab/model_run.h"
#include "support/say.h"
#include "detect/decode.h"
#include "drivers/clock.h"
#include "nn/run.h"

static int64_t cpu_ns(void)
{
    return fv_clock_ns(CLOCK_THREAD_CPUTIME_ID);
}

static void print_shape(const struct fv_model *model, const char *what, const int32_t *list,
                        uint32_t count)
{
    static const char *const types[FV_TYPE_COUNT] = {"uint8", "int32", "int64", "float32"};
    for (uint32_t i = 0; i < count; i++) {
        const struct fv_model_tensor *t = &model->tensors[list[i]];
        const int is_signed = t->type == FV_TYPE_U8 && (t->flags & FV_TENSOR_SIGNED) != 0;
        printf("%-10s%s", what, is_signed ? "int8" : types[t->type]);
        for (int32_t k = 0; k < t->rank; k++)
            printf("%s%d", k == 0 ? " " : " x ", t->dims[k]);
        if (t->type == FV_TYPE_U8)
            printf(", scale %g, zero point %d", (double)t->scale, t->zero - (is_signed ? 128 : 0));
        printf("\n");
    }
}

static void print_operators(const struct fv_model *model)
{
    int32_t counts[FV_OP_KIND_COUNT] = {0};
    for (uint32_t i = 0; i < model->header->op_count; i++)
        ++counts[model->ops[i].kind];
    printf("operators ");
    for (int32_t kind = 0, first = 1; kind < FV_OP_KIND_COUNT; kind++) {
        if (counts[kind] == 0) continue;
        printf("%s%d %s", first ? "" : ", ", counts[kind], fv_model_kind_name(kind));
        first = 0;
    }
    printf("\n");
}

static void print_decoder(const struct fv_model *model)
{
    const struct fv_model_decode *d = &model->header->decode;
    const uint32_t gives = fv_detect_gives(model);
    printf("%-10s%s", "decoder", fv_detect_decoder_name(model));
    if (gives == 0) printf(": raw outputs");
    if ((gives & FV_DETECT_CLASSES) != 0) printf(": classes of the image");
    if ((gives & FV_DETECT_BOXES) != 0) printf(": boxes");
    if ((gives & FV_DETECT_POINTS) != 0)
        printf("%s%d keypoints", (gives & FV_DETECT_BOXES) != 0 ? ", " : ": ",
               fv_detect_point_count(model));
    if ((gives & FV_DETECT_MASK) != 0)
        printf("%s", (gives & FV_DETECT_BOXES) != 0 ? ", masks" : ": a mask");
    printf("\n");
    if (gives == 0) return;
    printf("%-10sscore at least %g%s", "limits", (double)d->score_threshold,
           d->thresholds != 0 ? " or as classes have it" : "");
    if ((gives & FV_DETECT_BOXES) != 0) printf(", overlap at most %g", (double)d->iou_threshold);
    printf(", at most %d\n", d->max_detections);
}

/* The best of several runs on this processor: milliseconds and the longest unit. */
static enum fovea_status time_model(const struct fv_model *model, const struct fv_kernels *kernels,
                                    double *best_ms, double *unit_ms)
{
    uint8_t *arena = fv_aligned_zeroed(fv_nn_arena_bytes(model));
    if (arena == NULL) return FOVEA_ERROR_SYSTEM;
    *best_ms = 1e9;
    *unit_ms = 1e9;
    const int64_t start = cpu_ns();
    for (int run = 0; run < 200 && (run < 3 || cpu_ns() - start < 1000000000); run++) {
        struct fv_nn_progress progress = {0, 0};
        uint32_t done;
        double total = 0, longest = 0;
        enum fovea_status status = FOVEA_AGAIN;
        while (status == FOVEA_AGAIN) {
            const int64_t before = cpu_ns();
            status = fv_nn_run(model, kernels, arena, &progress, 1, &done);
            const double ms = (double)(cpu_ns() - before) * 1e-6;
            total += ms;
            longest = ms > longest ? ms : longest;
        }
        *best_ms = total < *best_ms ? total : *best_ms;
        *unit_ms = longest < *unit_ms ? longest : *unit_ms;
    }
    free(arena);
    return FOVEA_OK;
}

/* The most that the matrix kernel reaches here on a product that fits the caches, in GMAC/s: the
 * yardstick. */
static double peak_gmacs(const struct fv_kernels *kernels)
{
    enum { M = 48, K = 512, N = 64, LOOPS = 200 };
    uint8_t *memory = fv_aligned_new(M * K + N * K + 4096 + M * N * 4);
    if (memory == NULL) return 0;
    memset(memory, 1, M * K + N * K + 4096 + M * N * 4);
    int32_t *words = (int32_t *)(void *)(memory + M * K + N * K);
    const struct fv_nn_gemm g = {.k = K,
                                 .k4 = K / 4,
                                 .n = N,
                                 .weights = (const int8_t *)(memory + M * K),
                                 .bias = words,
                                 .multiplier = words,
                                 .shift = words + 64,
                                 .zero_out = 0,
                                 .act_min = 0,
                                 .act_max = 255};
    for (int i = 0; i < 64; i++)
        words[64 + i] = -10;
    double best = 0;
    for (int round = 0; round < 20; round++) {
        const int64_t before = cpu_ns();
        for (int i = 0; i < LOOPS; i++)
            kernels->nn_gemm_u8(&g, memory, K, memory + M * K + N * K + 4096, N, M);
        const double rate = (double)M * K * N * LOOPS / (double)(cpu_ns() - before);
        best = rate > best ? rate : best;
    }
    free(memory);
    return best;
}

static int info(const char *path)
{
    struct fv_model_file file;
    struct fovea_error error;
    enum fv_cpu_set set;
    struct fv_kernels kernels;
    if (fv_cpu_from_environment(&set, &error) != FOVEA_OK ||
        fv_model_file_read(path, &file, &error) != FOVEA_OK) {
        return fv_say_wrong("%s", error.text);
    }
    fv_kernels_init(&kernels, set);
    fv_model_file_prepare(&file, &kernels);
    const struct fv_model *model = &file.model;
    const struct fv_model_header *h = model->header;
    const double macs = (double)h->macs_high * 4294967296.0 + (double)h->macs_low;
    printf("%-10s%s\n", "name", h->name);
    print_shape(model, "input", model->inputs, h->input_count);
    print_shape(model, "output", model->outputs, h->output_count);
    print_shape(model, "state", model->states, fv_model_state_count(model));
    print_operators(model);
    printf("%-10s%.1f million multiply-accumulates, %u labels\n", "work", macs * 1e-6,
           h->label_count);
    print_decoder(model);
    printf("%-10sconstants %u bytes, arena %u bytes, file %zu bytes\n", "memory", h->data_bytes,
           h->arena_bytes, file.bytes);
    double best_ms, unit_ms;
    const uint32_t units = fv_nn_units(model);
    if (time_model(model, &kernels, &best_ms, &unit_ms) != FOVEA_OK) {
        fv_model_file_free(&file);
        return fv_say_failed("%s: out of memory", path);
    }
    const double rate = macs * 1e-6 / best_ms, peak = peak_gmacs(&kernels);
    printf("%-10s%u, the longest %.3f ms\n", "units", units, unit_ms);
    printf("%-10s%.3f ms with %s, %.1f GMAC/s, %.0f %% of the matrix kernel's %.0f GMAC/s\n",
           "time", best_ms, fv_cpu_set_name(kernels.set), rate, peak > 0 ? 100 * rate / peak : 0,
           peak);
    fv_model_file_free(&file);
    return FV_EXIT_OK;
}

int fv_command_model(int argc, char **argv)
{
    const char *out = NULL;
    const struct fv_option options[] = {
        {"out", "FILE", FV_OPTION_TEXT, &out,
         "for run: the outputs as .npz, output0 and so on, with scale and zero_point"},
        {0},
    };
    int first;
    const enum fv_options_result result =
        fv_options_parse(options, "info FILE | run FILE INPUT...", 2, 1 << 20, argc, argv, &first);
    if (result != FV_OPTIONS_READ) return result == FV_OPTIONS_HELP ? FV_EXIT_OK : FV_EXIT_WRONG;
    const char *action = argv[first], *path = argv[first + 1];
    const int inputs = argc - first - 2;
    if (strcmp(action, "run") == 0) {
        if (inputs == 0) return fv_say_wrong("model run: expected pictures or .npy files");
        if (out == NULL) return fv_say_wrong("model run: --out FILE is missing");
        return fv_model_run(path, argv + first + 2, inputs, out);
    }
    if (strcmp(action, "info") != 0)
        return fv_say_wrong("model: unknown action '%s'; expected info or run", action);
    if (inputs > 0) return fv_say_wrong("model info: found %d files, expected one", inputs + 1);
    if (out != NULL) return fv_say_wrong("model info: --out: found, expected with run alone");
    return info(path);
}

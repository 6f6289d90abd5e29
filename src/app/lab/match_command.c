/* fovea match: which features of two pictures belong together. */
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>

#include "support/aligned.h"
#include "support/canvas.h"
#include "app/lab/commands.h"
#include "app/lab/extract.h"
#include "support/files.h"
#include "app/config/options.h"
#include "support/say.h"
#include "features/match.h"

/* The pictures side by side, a line for every match, its colour by the direction of the line. */
static enum fovea_status draw(const struct fv_extract *a, const struct fv_extract *b,
                              const struct fv_match *matches, uint32_t count, const char *path,
                              struct fovea_error *error)
{
    static const uint32_t colours[6] = {0xff5544, 0xffbb33, 0xaadd33, 0x33ccbb, 0x4499ff, 0xdd77ff};
    const int shift = a->image.width;
    const int height = a->image.height > b->image.height ? a->image.height : b->image.height;
    struct fv_canvas canvas;
    enum fovea_status status = fv_canvas_create(&canvas, shift + b->image.width, height, 0);
    if (status != FOVEA_OK) return fovea_error_set(error, status, "%.300s: out of memory", path);
    fv_canvas_image(&canvas, 0, 0, &a->image);
    fv_canvas_image(&canvas, shift, 0, &b->image);
    for (uint32_t i = 0; i < count; i++) {
        const struct fovea_local_feature *p = &a->found.features[matches[i].query],
                                         *q = &b->found.features[matches[i].train];
        const uint32_t colour = colours[i % 6];
        fv_canvas_line(&canvas, p->x_px, p->y_px, q->x_px + (float)shift, q->y_px, 1, colour);
        fv_canvas_disc(&canvas, p->x_px, p->y_px, 2.5f, colour);
        fv_canvas_disc(&canvas, q->x_px + (float)shift, q->y_px, 2.5f, colour);
    }
    status = fv_canvas_write(&canvas, path, error);
    fv_canvas_free(&canvas);
    return status;
}

static void print_json(const struct fv_extract *a, const struct fv_extract *b,
                       const struct fv_match *matches, uint32_t count)
{
    printf("{\"features\": [%u, %u], \"matches\": [", a->found.count, b->found.count);
    for (uint32_t i = 0; i < count; i++) {
        const struct fovea_local_feature *p = &a->found.features[matches[i].query],
                                         *q = &b->found.features[matches[i].train];
        printf(
            "%s\n  {\"a\": %u, \"b\": %u, \"a_px\": [%.4f, %.4f], \"b_px\": [%.4f, %.4f], \"distance\": %u}",
            i == 0 ? "" : ",", matches[i].query, matches[i].train, (double)p->x_px, (double)p->y_px,
            (double)q->x_px, (double)q->y_px, matches[i].distance);
    }
    printf("\n]}\n");
}

/* Memory for matching sets of `count_max`: the matcher's and the matches. NULL: none left. */
static struct fv_match *take_memory(uint32_t count_max, struct fv_matcher *matcher, void **memory)
{
    struct fv_arena arena;
    struct fv_match *matches = NULL;
    *memory = NULL;
    for (int round = 0; round < 2; round++) {
        if (round == 0) {
            fv_arena_count(&arena);
        } else {
            const size_t bytes = arena.used;
            *memory = fv_aligned_new(bytes);
            if (*memory == NULL) return NULL;
            fv_arena_init(&arena, *memory, bytes);
        }
        fv_matcher_carve(matcher, count_max, &arena);
        matches = fv_arena_take(&arena, count_max, sizeof *matches);
    }
    return matches;
}

static enum fv_exit match(const struct fv_extract *a, const struct fv_extract *b,
                          uint32_t count_max, uint16_t ratio_q8, const char *picture, bool json)
{
    struct fovea_error error;
    struct fv_matcher matcher;
    struct fv_kernels kernels;
    enum fv_cpu_set cpu;
    void *memory;
    if (fv_cpu_from_environment(&cpu, &error) != FOVEA_OK) return fv_say_wrong("%s", error.text);
    fv_kernels_init(&kernels, cpu);
    struct fv_match *matches = take_memory(count_max, &matcher, &memory);
    if (matches == NULL) return fv_say_failed("out of memory");
    const struct fv_match_rules rules = {FV_MATCH_DISTANCE_ANY, ratio_q8, true};
    const uint32_t count = fv_match_all(&matcher, &kernels, a->found.descriptors, a->found.count,
                                        b->found.descriptors, b->found.count, &rules, matches);
    enum fv_exit status = FV_EXIT_OK;
    if (picture != NULL && draw(a, b, matches, count, picture, &error) != FOVEA_OK)
        status = fv_say_failed("%s", error.text);
    else if (json)
        print_json(a, b, matches, count);
    else
        printf("%u matches of %u and %u features\n", count, a->found.count, b->found.count);
    free(memory);
    return status;
}

int fv_command_match(int argc, char **argv)
{
    uint64_t max = 1000, ratio = 80;
    const char *picture = NULL;
    bool json = false;
    const struct fv_option options[] = {
        {"max", "N", FV_OPTION_COUNT, &max, "most features to find in each picture (default 1000)"},
        {"ratio", "PERCENT", FV_OPTION_COUNT, &ratio,
         "keep matches nearer than PERCENT of the second nearest (default 80; 100 keeps all)"},
        {"draw", "FILE", FV_OPTION_TEXT, &picture, "write both pictures with the matches as PNG"},
        {"json", NULL, FV_OPTION_FLAG, &json, "print every match"},
        {0},
    };
    int first;
    const enum fv_options_result result =
        fv_options_parse(options, "A B", 2, 2, argc, argv, &first);
    if (result != FV_OPTIONS_READ) return result == FV_OPTIONS_HELP ? FV_EXIT_OK : FV_EXIT_WRONG;

    struct fovea_extract_config config;
    struct fovea_error error;
    struct fv_extract a, b;
    if (ratio < 1 || ratio > 100)
        return fv_say_wrong("--ratio: found %" PRIu64 ", expected 1 to 100 (percent)", ratio);
    const struct fv_file written[] = {{"--draw", picture}, {0}},
                         read[] = {{"A", argv[first]}, {"B", argv[first + 1]}, {0}};
    if (fv_extract_config(NULL, NULL, max, &config, &error) != FOVEA_OK ||
        fv_files_apart(written, read, &error) != FOVEA_OK)
        return fv_say_wrong("%s", error.text);
    enum fv_exit status;
    if (fv_extract(argv[first], NULL, &config, &a, &error) != FOVEA_OK) {
        status = fv_say_wrong("%s", error.text);
    } else {
        if (fv_extract(argv[first + 1], NULL, &config, &b, &error) != FOVEA_OK)
            status = fv_say_wrong("%s", error.text);
        else
            status = match(&a, &b, config.count_max, (uint16_t)(ratio * 256 / 100), picture, json);
        fv_extract_free(&b);
    }
    fv_extract_free(&a);
    return status;
}

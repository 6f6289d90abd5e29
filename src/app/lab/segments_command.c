/* fovea segments: the line segments of a picture. */
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>

#include "app/lab/commands.h"
#include "app/config/options.h"
#include "fovea/segments.h"
#include "support/aligned.h"
#include "support/canvas.h"
#include "support/files.h"
#include "support/picture.h"
#include "support/say.h"
#include "support/text.h"

enum { DARKER = 3, COLOURS = 6 };

static enum fovea_status read_length(const char *text, double *value, struct fovea_error *error)
{
    if (text == NULL) return FOVEA_OK;
    if (fv_text_number(text, value) && *value >= 0 && *value <= 10000) return FOVEA_OK;
    return fovea_error_set(error, FOVEA_ERROR_ARGUMENT,
                           "--min-length: found '%.100s', expected 0 to 10000 pixels", text);
}

/* The picture, darker, with each segment in one of some colours. */
static enum fovea_status draw(const struct fovea_image *image,
                              const struct fovea_segments_found *found, const char *path,
                              struct fovea_error *error)
{
    static const uint32_t colours[COLOURS] = {0xff5050, 0x50ff50, 0x60a0ff,
                                              0xffe040, 0xff60ff, 0x40ffff};
    struct fv_canvas canvas;
    enum fovea_status status = fv_canvas_create(&canvas, image->width, image->height, 0);
    if (status != FOVEA_OK)
        return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "out of memory: a picture of %d x %d",
                               image->width, image->height);
    fv_canvas_image(&canvas, 0, 0, image);
    for (size_t i = 0; i < (size_t)image->width * (size_t)image->height * 3; i++)
        canvas.rgb[i] /= DARKER;
    for (uint32_t i = 0; i < found->count; i++) {
        const struct fovea_segment *s = &found->list[i];
        fv_canvas_line(&canvas, s->x0_px, s->y0_px, s->x1_px, s->y1_px, 1.2f, colours[i % COLOURS]);
    }
    status = fv_canvas_write(&canvas, path, error);
    fv_canvas_free(&canvas);
    return status;
}

static void print(const struct fovea_image *image, const struct fovea_segments_found *found,
                  bool json)
{
    if (!json) {
        printf("%u segments in %d x %d\n", found->count, image->width, image->height);
        return;
    }
    printf("{\"width\": %d, \"height\": %d, \"segments\": [", image->width, image->height);
    for (uint32_t i = 0; i < found->count; i++) {
        const struct fovea_segment *s = &found->list[i];
        printf("%s\n  {\"begin_px\": [%.3f, %.3f], \"end_px\": [%.3f, %.3f], \"width_px\": %.3f}",
               i == 0 ? "" : ",", (double)s->x0_px, (double)s->y0_px, (double)s->x1_px,
               (double)s->y1_px, (double)s->width_px);
    }
    printf("\n]}\n");
}

static enum fovea_status find(const struct fovea_segments_config *config,
                              const struct fovea_image *image, const char *path, bool json,
                              struct fovea_error *error)
{
    struct fovea_segments *segments = NULL;
    struct fovea_segments_found found;
    const size_t bytes = fovea_segments_size(config, image->width, image->height, error);
    if (bytes == 0) return FOVEA_ERROR_ARGUMENT;
    void *memory = fv_aligned_new(bytes);
    if (memory == NULL)
        return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "out of memory: %zu bytes", bytes);
    enum fovea_status status =
        fovea_segments_init(&segments, config, image->width, image->height, memory, bytes, error);
    if (status == FOVEA_OK && fovea_segments_run(segments, image, &found) != FOVEA_OK)
        status = fovea_error_set(error, FOVEA_ERROR_ARGUMENT,
                                 "the detector refuses a picture of %d x %d pixels", image->width,
                                 image->height);
    if (status == FOVEA_OK) status = draw(image, &found, path, error);
    if (status == FOVEA_OK) print(image, &found, json);
    free(memory);
    return status;
}

int fv_command_segments(int argc, char **argv)
{
    const char *length = NULL;
    bool json = false;
    const struct fv_option options[] = {
        {"min-length", "PIXELS", FV_OPTION_TEXT, &length, "leave out shorter segments (default 0)"},
        {"json", NULL, FV_OPTION_FLAG, &json, "print every segment"},
        {0},
    };
    int first;
    const enum fv_options_result result =
        fv_options_parse(options, "IN OUT", 2, 2, argc, argv, &first);
    if (result != FV_OPTIONS_READ) return result == FV_OPTIONS_HELP ? FV_EXIT_OK : FV_EXIT_WRONG;
    struct fovea_error error;
    struct fovea_segments_config config;
    struct fovea_image image = {0};
    const struct fv_file written[] = {{"OUT", argv[first + 1]}, {0}},
                         read[] = {{"IN", argv[first]}, {0}};
    fovea_segments_config_default(&config);
    enum fovea_status status = fv_files_apart(written, read, &error);
    if (status == FOVEA_OK) status = fv_picture_check_name("OUT", argv[first + 1], &error);
    if (status == FOVEA_OK) status = read_length(length, &config.length_min_px, &error);
    if (status == FOVEA_OK) status = fv_picture_read(argv[first], &image, &error);
    if (status == FOVEA_OK) status = find(&config, &image, argv[first + 1], json, &error);
    free((void *)(uintptr_t)image.data);
    if (status == FOVEA_OK) return FV_EXIT_OK;
    return status == FOVEA_ERROR_SYSTEM ? fv_say_failed("%s", error.text)
                                        : fv_say_wrong("%s", error.text);
}

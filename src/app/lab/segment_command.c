/* fovea segment: which class each pixel of a picture shows, as a picture, and judged by labels. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "app/config/options.h"
#include "app/lab/commands.h"
#include "app/lab/confusion.h"
#include "app/lab/inference.h"
#include "app/lab/label_files.h"
#include "app/lab/label_picture.h"
#include "support/canvas.h"
#include "support/picture.h"
#include "support/files.h"
#include "support/json.h"
#include "support/say.h"

struct asked {
    const char *model, *draw, *mask, *labels, *map;
    bool json;
    struct fv_label_files files; /* what is judged, with `labels` */
};

static enum fovea_status draw(const struct fv_inference *engine, const struct fovea_image *image,
                              const char *path, struct fovea_error *error)
{
    struct fv_canvas canvas;
    enum fovea_status status = fv_canvas_create(&canvas, image->width, image->height, 0);
    if (status != FOVEA_OK) return fovea_error_set(error, status, "%.300s: out of memory", path);
    fv_canvas_image(&canvas, 0, 0, image);
    fv_found_draw(&engine->found, &canvas);
    status = fv_canvas_write(&canvas, path, error);
    fv_canvas_free(&canvas);
    return status;
}

/* The classes as grey levels at the size of the picture, FOVEA_SEGMENTATION_NONE where there is
 * none. */
static enum fovea_status write_mask(const struct fovea_segmentation *seen, const char *path,
                                    struct fovea_error *error)
{
    const size_t pixels = (size_t)seen->image_width * (size_t)seen->image_height;
    uint8_t classes[256], *mask = malloc(pixels);
    if (mask == NULL)
        return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "%.300s: out of memory", path);
    memset(classes, FOVEA_SEGMENTATION_NONE, sizeof classes);
    for (uint32_t i = 0; i < seen->count; i++)
        if (seen->list[i].class_id < FOVEA_SEGMENTATION_NONE)
            classes[i] = (uint8_t)seen->list[i].class_id;
    fovea_segmentation_enlarge(seen, classes, mask);
    const struct fovea_image image = {.data = mask,
                                      .width = seen->image_width,
                                      .height = seen->image_height,
                                      .stride_bytes = seen->image_width,
                                      .format = FOVEA_PIXEL_GREY8,
                                      .size_bytes = pixels};
    const enum fovea_status status = fv_picture_write(path, &image, error);
    free(mask);
    return status;
}

static void print(const struct fv_inference *engine, const char *path,
                  const struct fovea_image *image)
{
    printf("{\"image\": ");
    fv_json_text(stdout, path);
    printf(", \"width\": %d, \"height\": %d, ", image->width, image->height);
    fv_found_print_mask(&engine->found, false);
    printf("}\n");
}

static enum fovea_status judge(struct fv_confusion *confusion,
                               const struct fovea_segmentation *seen, const char *path,
                               struct fovea_error *error)
{
    uint8_t *labels = NULL;
    enum fovea_status status =
        fv_label_picture_read(path, seen->image_width, seen->image_height, &labels, error);
    if (status != FOVEA_OK) return status;
    status = fv_confusion_add(confusion, labels, seen);
    free(labels);
    if (status != FOVEA_OK) fovea_error_set(error, status, "%.300s: out of memory", path);
    return status;
}

static enum fovea_status take(struct fv_inference *engine, struct fv_confusion *confusion,
                              const struct asked *asked, const char *path, const char *labels,
                              struct fovea_error *error)
{
    struct fovea_image image;
    struct fovea_segmentation seen;
    enum fovea_status status = fv_picture_read_colour(path, &image, error);
    if (status != FOVEA_OK) return status;
    if (fv_inference_run(engine, &image) != FOVEA_OK)
        status = fovea_error_set(error, FOVEA_ERROR_INPUT,
                                 "%.300s: its first input is not an image of 1 or 3 channels",
                                 asked->model);
    if (status == FOVEA_OK) {
        fv_found_segmentation(&engine->found, &seen);
        if (labels == NULL) print(engine, path, &image);
        if (asked->draw != NULL) status = draw(engine, &image, asked->draw, error);
        if (status == FOVEA_OK && asked->mask != NULL)
            status = write_mask(&seen, asked->mask, error);
        if (status == FOVEA_OK && labels != NULL) status = judge(confusion, &seen, labels, error);
    }
    free((void *)(uintptr_t)image.data);
    return status;
}

/* Which of the pictures are judged, and a line about those that are not. */
static enum fovea_status find_labels(struct asked *asked, char **paths, int count,
                                     struct fovea_error *error)
{
    struct fv_label_files *files = &asked->files;
    const enum fovea_status status = fv_label_files_find(files, asked->labels, paths, count, error);
    if (status == FOVEA_OK && files->count < count)
        fv_say_note("segment: %d of %d pictures left out: %d label pictures (*.mask.png), %d of "
                    "further cameras (*.camN.*), which have no labels",
                    count - files->count, count, files->masks, files->others);
    return status;
}

static enum fovea_status check(struct asked *asked, char **paths, int count,
                               struct fovea_error *error)
{
    const char *single = asked->draw != NULL ? "--draw" : asked->mask != NULL ? "--mask" : NULL;
    if (single != NULL && count > 1)
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "segment: %s: found %d pictures, expected one", single, count);
    if ((asked->labels == NULL) != (asked->map == NULL))
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "segment: %s: found without %s, expected both",
                               asked->map == NULL ? "--evaluate" : "--classes-map",
                               asked->map == NULL ? "--classes-map" : "--evaluate");
    if (fv_picture_check_name("segment: --draw", asked->draw, error) != FOVEA_OK ||
        fv_picture_check_name("segment: --mask", asked->mask, error) != FOVEA_OK)
        return FOVEA_ERROR_INPUT;
    enum fovea_status status = FOVEA_OK;
    if (asked->labels != NULL) status = find_labels(asked, paths, count, error);
    if (status != FOVEA_OK || single == NULL) return status;
    const struct fv_file written[] = {{"--draw", asked->draw}, {"--mask", asked->mask}, {0}},
                         read[] = {
                             {"IMAGE", paths[0]},
                             {"--evaluate", asked->labels != NULL ? asked->files.labels[0] : NULL},
                             {"--model", asked->model},
                             {"--classes-map", asked->map},
                             {0}};
    const char *blame;
    status = fv_files_apart(written, read, error);
    return status == FOVEA_OK ? fv_files_writable(written, &blame, error) : status;
}

static enum fovea_status run(struct fv_inference *engine, struct asked *asked, char **paths,
                             int count, struct fovea_error *error)
{
    static struct fv_confusion confusion;
    enum fovea_status status = check(asked, paths, count, error);
    if (status == FOVEA_OK) status = fv_inference_open(engine, asked->model, error);
    if (status != FOVEA_OK) return status;
    if ((fv_detect_gives(&engine->file.model) & FV_DETECT_MASK) == 0)
        return fovea_error_set(
            error, FOVEA_ERROR_INPUT,
            "%.300s: found decoder %s, expected a network that gives a class to each pixel, or masks of objects",
            asked->model, fv_detect_decoder_name(&engine->file.model));
    if (asked->map != NULL)
        status = fv_confusion_open(&confusion, asked->map, &engine->file.model, error);
    const struct fv_label_files *files = &asked->files;
    for (int i = 0; i < count && status == FOVEA_OK && asked->labels == NULL; i++)
        status = take(engine, &confusion, asked, paths[i], NULL, error);
    for (int i = 0; i < files->count && status == FOVEA_OK; i++)
        status = take(engine, &confusion, asked, files->pictures[i], files->labels[i], error);
    if (status != FOVEA_OK || asked->labels == NULL) return status;
    if (confusion.pixels == 0)
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "%.300s: found no label of the label pictures in %.300s, expected a "
                               "class for at least one of their labels",
                               asked->map, asked->labels);
    fv_confusion_print(&confusion, asked->json);
    return FOVEA_OK;
}

int fv_command_segment(int argc, char **argv)
{
    static struct fv_inference engine; /* too large for the stack */
    struct asked asked = {0};
    const struct fv_option options[] = {
        {"model", "FILE", FV_OPTION_TEXT, &asked.model, "model file (.fvm) made by tools/import"},
        {"draw", "FILE", FV_OPTION_TEXT, &asked.draw,
         "write the picture, with the classes in their colours over it, as PNG"},
        {"mask", "FILE", FV_OPTION_TEXT, &asked.mask,
         "write the class of each pixel as a PNG of grey levels; 255: none"},
        {"evaluate", "DIR", FV_OPTION_TEXT, &asked.labels,
         "judge by label pictures: DIR/NAME.mask.png for IMAGE NAME, or DIR/NAME.png where DIR holds no "
         "*.mask.png, whose pixels are class numbers"},
        {"classes-map", "FILE", FV_OPTION_TEXT, &asked.map,
         "for --evaluate: lines 'LABEL CLASS', the label pictures' number and the network's class, "
         "other or ignore; labels without a line are ignored"},
        {"json", NULL, FV_OPTION_FLAG, &asked.json, "for --evaluate: print a line of JSON"},
        {"units", "N", FV_OPTION_COUNT, &engine.units,
         "run N units at a time, as the loop does (same results)"},
        {0},
    };
    int first;
    const enum fv_options_result result =
        fv_options_parse(options, "IMAGE...", 1, 1 << 20, argc, argv, &first);
    if (result != FV_OPTIONS_READ) return result == FV_OPTIONS_HELP ? FV_EXIT_OK : FV_EXIT_WRONG;
    if (asked.model == NULL) return fv_say_wrong("segment: --model FILE is missing");
    struct fovea_error error;
    const enum fovea_status status = run(&engine, &asked, argv + first, argc - first, &error);
    fv_inference_close(&engine);
    fv_label_files_free(&asked.files);
    if (status == FOVEA_OK) return FV_EXIT_OK;
    return status == FOVEA_ERROR_SYSTEM ? fv_say_failed("%s", error.text)
                                        : fv_say_wrong("%s", error.text);
}

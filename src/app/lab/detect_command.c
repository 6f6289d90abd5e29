/* fovea detect: what a network finds in pictures, as JSON lines and drawn. */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "app/lab/commands.h"
#include "support/canvas.h"
#include "support/picture.h"
#include "support/files.h"
#include "app/config/options.h"
#include "app/lab/inference.h"
#include "support/say.h"

/* The part of a picture's name that its drawing keeps. */
static const char *stem(const char *path, int *length)
{
    const char *slash = strrchr(path, '/'), *name = slash == NULL ? path : slash + 1,
               *dot = strrchr(name, '.');
    *length = dot == NULL ? (int)strlen(name) : (int)(dot - name);
    return name;
}

static int by_stem(const void *a, const void *b)
{
    int length_a, length_b;
    const char *name_a = stem(*(char *const *)a, &length_a),
               *name_b = stem(*(char *const *)b, &length_b);
    const int order = strncmp(name_a, name_b, (size_t)(length_a < length_b ? length_a : length_b));
    return order != 0 ? order : length_a - length_b;
}

/* No two pictures are drawn into one file. */
static enum fovea_status check_stems(char **paths, int count, const char *folder,
                                     struct fovea_error *error)
{
    char **sorted = malloc((size_t)count * sizeof *sorted);
    enum fovea_status status = FOVEA_OK;
    if (sorted == NULL) return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "detect: out of memory");
    memcpy(sorted, paths, (size_t)count * sizeof *sorted);
    qsort(sorted, (size_t)count, sizeof *sorted, by_stem);
    for (int i = 1; i < count && status == FOVEA_OK; i++) {
        int length;
        const char *name = stem(sorted[i], &length);
        if (by_stem(&sorted[i - 1], &sorted[i]) == 0 && strcmp(sorted[i - 1], sorted[i]) != 0)
            status = fovea_error_set(
                error, FOVEA_ERROR_INPUT,
                "--draw %.200s: found %.200s and %.200s, both to be drawn into %.*s.png; expected different names",
                folder, sorted[i - 1], sorted[i], length < 200 ? length : 200, name);
    }
    free(sorted);
    return status;
}

/* The folder of the drawings, into which they can be written. */
static enum fovea_status make_folder(const char *folder, struct fovea_error *error)
{
    char slashed[1024];
    const char *blame;
    const struct fv_file written[] = {{"--draw", slashed}, {0}};
    if (mkdir(folder, 0777) != 0 && errno != EEXIST)
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "--draw %.300s: the folder cannot be made: %s", folder,
                               strerror(errno));
    snprintf(slashed, sizeof slashed, "%.600s/", folder);
    return fv_files_writable(written, &blame, error);
}

/* dir/name.png with what was found. */
static enum fovea_status draw(const struct fv_inference *engine, const char *path,
                              const struct fovea_image *image, const char *folder,
                              struct fovea_error *error)
{
    char target[1024];
    int length;
    const char *name = stem(path, &length);
    snprintf(target, sizeof target, "%.600s/%.*s.png", folder, length, name);
    const struct fv_file written[] = {{"--draw", target}, {0}}, read[] = {{"IMAGE", path}, {0}};
    enum fovea_status status = fv_files_apart(written, read, error);
    if (status != FOVEA_OK) return status;
    struct fv_canvas canvas;
    status = fv_canvas_create(&canvas, image->width, image->height, 0);
    if (status != FOVEA_OK) return fovea_error_set(error, status, "%.300s: out of memory", target);
    fv_canvas_image(&canvas, 0, 0, image);
    fv_found_draw(&engine->found, &canvas);
    status = fv_canvas_write(&canvas, target, error);
    fv_canvas_free(&canvas);
    return status;
}

int fv_command_detect(int argc, char **argv)
{
    static struct fv_inference engine; /* too large for the stack */
    const char *model = NULL, *folder = NULL;
    const struct fv_option options[] = {
        {"model", "FILE", FV_OPTION_TEXT, &model, "model file (.fvm) made by tools/import"},
        {"draw", "DIR", FV_OPTION_TEXT, &folder,
         "write each picture with what was found as PNG into DIR, which is created if it does not exist"},
        {"units", "N", FV_OPTION_COUNT, &engine.units,
         "run N units at a time, as the loop does (same results)"},
        {0},
    };
    int first;
    const enum fv_options_result result =
        fv_options_parse(options, "IMAGE...", 1, 1 << 20, argc, argv, &first);
    if (result != FV_OPTIONS_READ) return result == FV_OPTIONS_HELP ? FV_EXIT_OK : FV_EXIT_WRONG;
    if (model == NULL) return fv_say_wrong("detect: --model FILE is missing");
    struct fovea_error error;
    if (fv_inference_open(&engine, model, &error) != FOVEA_OK) {
        fv_inference_close(&engine);
        return fv_say_wrong("%s", error.text);
    }
    int status = FV_EXIT_OK;
    if (folder != NULL && (check_stems(argv + first, argc - first, folder, &error) != FOVEA_OK ||
                           make_folder(folder, &error) != FOVEA_OK))
        status = fv_say_wrong("%s", error.text);
    if (fv_detect_gives(&engine.file.model) == 0)
        fv_say("%s: its decoder is %s, the lists stay empty: fovea model run gives its outputs",
               model, fv_detect_decoder_name(&engine.file.model));
    if (fv_model_state_count(&engine.file.model) > 0)
        fv_say("%s: its states go from each picture to the next, zero before the first", model);
    for (int i = first; i < argc && status == FV_EXIT_OK; i++) {
        struct fovea_image image;
        if (fv_picture_read_colour(argv[i], &image, &error) != FOVEA_OK) {
            status = fv_say_wrong("%s", error.text);
            break;
        }
        if (fv_inference_run(&engine, &image) != FOVEA_OK) {
            status = fv_say_wrong("%s: its first input is not an image of 1 or 3 channels", model);
        } else {
            fv_found_print(&engine.found, argv[i], &image);
            if (folder != NULL) {
                const enum fovea_status drawn = draw(&engine, argv[i], &image, folder, &error);
                if (drawn == FOVEA_ERROR_INPUT)
                    status = fv_say_wrong("%s", error.text);
                else if (drawn != FOVEA_OK)
                    status = fv_say_failed("%s", error.text);
            }
        }
        free((void *)(uintptr_t)image.data);
    }
    fv_inference_close(&engine);
    return status;
}

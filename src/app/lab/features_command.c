/* fovea features: local features of a picture, by any method. */
#include <stdio.h>
#include <string.h>

#include "support/canvas.h"
#include "app/lab/commands.h"
#include "app/lab/extract.h"
#include "support/files.h"
#include "support/picture.h"
#include "app/config/options.h"
#include "support/say.h"
#include "base/elementary.h"
#include "features/scale_space.h"
#include "support/text.h"

enum { LEVEL_COLOURS = 8 };

/* From fine (warm) to coarse (cold) levels. */
static const uint32_t level_colour[LEVEL_COLOURS] = {0xff5544, 0xff9933, 0xffdd33, 0xaadd33,
                                                     0x44cc66, 0x33ccbb, 0x4499ff, 0xbb77ff};

/* Each feature as a circle with a hand that shows its direction: SIFT and SURF of their size,
 * others of a third of their patch. */
static enum fovea_status draw(const struct fv_extract *extract, const char *path,
                              struct fovea_error *error)
{
    struct fv_canvas canvas;
    const float part = extract->config.descriptor == FOVEA_DESCRIPTOR_FLOAT ? 1 : 1.f / 3;
    enum fovea_status status =
        fv_canvas_create(&canvas, extract->image.width, extract->image.height, 0);
    if (status != FOVEA_OK) return fovea_error_set(error, status, "%.300s: out of memory", path);
    fv_canvas_image(&canvas, 0, 0, &extract->image);
    for (uint32_t i = 0; i < extract->found.count; i++) {
        const struct fovea_local_feature *f = &extract->found.features[i];
        const uint32_t colour =
            level_colour[f->level < LEVEL_COLOURS ? f->level : LEVEL_COLOURS - 1];
        const float radius = f->size_px / 2 * part;
        fv_canvas_circle(&canvas, f->x_px, f->y_px, radius, 1, colour);
        fv_canvas_line(&canvas, f->x_px, f->y_px,
                       f->x_px + radius * (float)fv_cos((double)f->angle_rad),
                       f->y_px + radius * (float)fv_sin((double)f->angle_rad), 1, colour);
    }
    status = fv_canvas_write(&canvas, path, error);
    fv_canvas_free(&canvas);
    return status;
}

static void print_json(const struct fv_extract *extract)
{
    const struct fovea_extracted *found = &extract->found;
    printf(
        "{\"width\": %d, \"height\": %d, \"method\": \"%s\", \"descriptor\": \"%s\", \"features\": [",
        extract->image.width, extract->image.height,
        fovea_feature_method_name(extract->config.method),
        fovea_descriptor_name(extract->config.descriptor));
    for (uint32_t i = 0; i < found->count; i++) {
        const struct fovea_local_feature *f = &found->features[i];
        printf(
            "%s\n  {\"x_px\": %.4f, \"y_px\": %.4f, \"size_px\": %.3f, \"level\": %u, \"response\": %g, \"angle_rad\": %.6f, \"descriptor\": \"",
            i == 0 ? "" : ",", (double)f->x_px, (double)f->y_px, (double)f->size_px, f->level,
            (double)f->response, (double)f->angle_rad);
        for (uint32_t k = 0; k < found->descriptor_bytes; k++)
            printf("%02x", found->descriptors[(size_t)i * found->descriptor_bytes + k]);
        printf("\"}");
    }
    printf("\n]}\n");
}

static void print_summary(const struct fv_extract *extract)
{
    uint32_t on_level[FV_SCALE_OCTAVES_MAX] = {0}, levels = 1;
    for (uint32_t i = 0; i < extract->found.count; i++) {
        const uint32_t level = extract->found.features[i].level;
        on_level[level]++;
        if (level >= levels) levels = level + 1;
    }
    printf("%u features in %d x %d pixels, by level:", extract->found.count, extract->image.width,
           extract->image.height);
    for (uint32_t level = 0; level < levels; level++)
        printf(" %u", on_level[level]);
    printf("\n");
}

static bool read_box(const char *text, struct fv_mask_box *box)
{
    float *const sides[4] = {&box->x_min, &box->y_min, &box->x_max, &box->y_max};
    for (int i = 0; i < 4; i++) {
        char word[32];
        double value;
        size_t length = strcspn(text, ",");
        if (length >= sizeof word || (text[length] == ',') != (i < 3)) return false;
        memcpy(word, text, length);
        word[length] = '\0';
        if (!fv_text_number(word, &value) || value < -1e6 || value > 1e6) return false;
        *sides[i] = (float)value;
        text += length + (i < 3);
    }
    return box->x_max > box->x_min && box->y_max > box->y_min;
}

int fv_command_features(int argc, char **argv)
{
    const char *picture = NULL, *mask = NULL;
    bool json = false;
    struct fv_extract_request request;
    struct fv_option_list ignored = {0};
    struct fv_option options[FV_OPTIONS_MAX + 1] = {{0}};
    const struct fv_option own[] = {
        {"mask", "FILE", FV_OPTION_TEXT, &mask,
         "PNG of the size of the picture, black where features are ignored"},
        {"ignore", "X,Y,X,Y", FV_OPTION_LIST, &ignored,
         "box in pixels, minimum then maximum, in which features are ignored; may be repeated"},
        {"draw", "FILE", FV_OPTION_TEXT, &picture, "write the picture with its features as PNG"},
        {"json", NULL, FV_OPTION_FLAG, &json, "print every feature with its descriptor"},
        {0},
    };
    int first;
    fv_extract_offer(&request, 500, options);
    fv_member_options_join(options, own);
    const enum fv_options_result result =
        fv_options_parse(options, "IMAGE", 1, 1, argc, argv, &first);
    if (result != FV_OPTIONS_READ) return result == FV_OPTIONS_HELP ? FV_EXIT_OK : FV_EXIT_WRONG;

    struct fovea_extract_config config;
    struct fovea_error error;
    struct fv_extract extract;
    const struct fv_file written[] = {{"--draw", picture}, {0}},
                         read[] = {{"IMAGE", argv[first]}, {"--mask", mask}, {0}};
    if (fv_extract_config(&request, &config, &error) != FOVEA_OK ||
        fv_files_apart(written, read, &error) != FOVEA_OK ||
        fv_picture_check_name("--draw", picture, &error) != FOVEA_OK)
        return fv_say_wrong("%s", error.text);
    struct fv_mask_box boxes[FV_OPTION_LIST_MAX];
    for (int i = 0; i < ignored.count; i++)
        if (!read_box(ignored.values[i], &boxes[i]))
            return fv_say_wrong(
                "--ignore: found '%.100s', expected four numbers: min x, min y, max x, max y",
                ignored.values[i]);
    const struct fv_extract_ignore ignore = {mask, boxes, (uint32_t)ignored.count};
    enum fv_exit status = FV_EXIT_OK;
    if (fv_extract(argv[first], &ignore, &config, &extract, &error) != FOVEA_OK)
        status = fv_say_wrong("%s", error.text);
    else if (picture != NULL && draw(&extract, picture, &error) != FOVEA_OK)
        status = fv_say_failed("%s", error.text);
    else if (json)
        print_json(&extract);
    else
        print_summary(&extract);
    fv_extract_free(&extract);
    return status;
}

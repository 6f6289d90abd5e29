/* fovea export: frames of any source as PNG files, with their truth as COCO annotations where the
 * source knows it.
 *
 * DIR/000000.png ..., of a rig DIR/000000.cam1.png ... too (where the camera gave an image),
 * DIR/truth.json and, with --masks, DIR/000000.mask.png (the class of every pixel: objects, floor,
 * wall, obstacle, pit, or 0; `mask_classes` of the truth names them) and DIR/classes-map.txt, which
 * says for `fovea segment --evaluate` what each is to a network that labels pixels. The truth is
 * that of the first camera, whose images alone it lists. For training and evaluating detectors and
 * multi-object tracking. Boxes are COCO's: [left, top, width, height], (0, 0) the corner of the
 * first pixel; `track_id` is constant over the run and `visible` the visible fraction. */
#include <errno.h>
#include <inttypes.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>

#include "app/lab/commands.h"
#include "app/config/options.h"
#include "support/picture.h"
#include "support/progress.h"
#include "support/say.h"
#include "support/output.h"
#include "app/config/setup.h"
#include "drivers/table.h"
#include "fovea/source.h"

static const char *const class_names[FOVEA_TRUTH_CLASS_COUNT] = {
    "background", "ball", "cone", "box", "person", "floor", "wall", "obstacle", "pit"};

/* What each is to a network with classes as `segmenter.fvm` has them. */
static const char *const pixel_class[FOVEA_TRUTH_CLASS_COUNT] = {
    "other", "movable", "movable", "movable", "movable", "floor", "wall", "obstacle", "obstacle"};

enum { PATH_BYTES = 1024 };

struct export_run {
    const char *folder, *uri;
    bool masks;
    const struct fovea_source_ops *ops;
    struct fovea_source *source;
    bool made;                  /* the folder, at the first frame that can be written */
    FILE *images, *annotations; /* the two lists of the JSON, joined at the end */
    uint64_t frames, boxes;
    uint64_t others;   /* images of the cameras after the first */
    uint64_t expected; /* frames; 0: not known */
    struct fv_progress progress;
};

static enum fovea_status write_picture(const struct export_run *export, const char *suffix,
                                       const struct fovea_image *image, struct fovea_error *error)
{
    char path[PATH_BYTES];
    snprintf(path, sizeof path, "%.900s/%06" PRIu64 "%s.png", export->folder, export->frames,
             suffix);
    return fv_picture_write(path, image, error);
}

static enum fovea_status refuse_folder(const struct export_run *export, int why,
                                       struct fovea_error *error)
{
    return fovea_error_set(error,
                           why == ENOSPC || why == EROFS ? FOVEA_ERROR_SYSTEM : FOVEA_ERROR_INPUT,
                           "%.300s: %s; expected a folder that can be made", export->folder,
                           why == EEXIST ? "exists" : strerror(why));
}

/* Once. */
static enum fovea_status make_folder(struct export_run *export, struct fovea_error *error)
{
    if (!export->made && mkdir(export->folder, 0777) != 0)
        return refuse_folder(export, errno, error);
    export->made = true;
    return FOVEA_OK;
}

/* All zeros where the source knows none. */
static enum fovea_status get_truth(const struct export_run *export, const struct fovea_frame *frame,
                                   struct fovea_truth *truth, struct fovea_error *error)
{
    memset(truth, 0, sizeof *truth);
    if (export->ops->truth == NULL || export->ops->truth(export->source, frame, truth) != FOVEA_OK)
        memset(truth, 0, sizeof *truth);
    if (!export->masks || truth->class_mask != NULL) return FOVEA_OK;
    return fovea_error_set(error, FOVEA_ERROR_INPUT,
                           "--masks: found no class of each pixel in %.300s, expected a source "
                           "that knows them, as sim:",
                           export->uri);
}

static enum fovea_status write_truth(struct export_run *export, const struct fovea_frame *frame,
                                     const struct fovea_truth *truth, struct fovea_error *error)
{
    for (uint32_t i = 0; i < truth->box_count; i++) {
        const struct fovea_truth_box *b = &truth->boxes[i];
        const double w = (double)(b->x_max_px - b->x_min_px),
                     h = (double)(b->y_max_px - b->y_min_px);
        fprintf(
            export->annotations,
            "%s\n  {\"id\": %" PRIu64 ", \"image_id\": %" PRIu64
            ", \"category_id\": %d, \"track_id\": %u, \"bbox\": [%.2f, %.2f, %.2f, %.2f], \"area\": %.2f, \"iscrowd\": 0, \"visible\": %.4f}",
            export->boxes == 0 ? "" : ",", export->boxes + 1, export->frames, (int)b->object_class,
            b->id, (double)b->x_min_px, (double)b->y_min_px, w, h, w * h,
            (double)b->visible_fraction);
        export->boxes++;
    }
    if (!export->masks) return FOVEA_OK;
    const struct fovea_image mask = {.data = truth->class_mask,
                                     .width = frame->images[0].width,
                                     .height = frame->images[0].height,
                                     .stride_bytes = frame->images[0].width,
                                     .format = FOVEA_PIXEL_GREY8};
    return write_picture(export, ".mask", &mask, error);
}

/* The images of the cameras after the first. */
static enum fovea_status write_others(struct export_run *export, const struct fovea_frame *frame,
                                      struct fovea_error *error)
{
    enum fovea_status status = FOVEA_OK;
    for (uint32_t i = 1; i < frame->image_count && status == FOVEA_OK; i++) {
        char suffix[16];
        if (frame->images[i].data == NULL) continue;
        snprintf(suffix, sizeof suffix, ".cam%u", i);
        status = write_picture(export, suffix, &frame->images[i], error);
        export->others += status == FOVEA_OK;
    }
    return status;
}

/* What cannot be written is refused before the folder is made. */
static enum fovea_status write_frame(struct export_run *export, const struct fovea_frame *frame,
                                     struct fovea_error *error)
{
    struct fovea_truth truth;
    if (frame->images[0].data == NULL) return FOVEA_OK; /* nothing to number */
    if (frame->images[0].format != FOVEA_PIXEL_GREY8)
        return fovea_error_set(error, FOVEA_ERROR_UNSUPPORTED,
                               "export: found frames in colour, expected grey ones");
    enum fovea_status status = get_truth(export, frame, &truth, error);
    if (status == FOVEA_OK) status = make_folder(export, error);
    if (status != FOVEA_OK) return status;
    fprintf(export->images,
            "%s\n  {\"id\": %" PRIu64 ", \"file_name\": \"%06" PRIu64
            ".png\", \"width\": %d, \"height\": %d, \"stamp_ns\": %" PRId64 "}",
            export->frames == 0 ? "" : ",", export->frames, export->frames, frame->images[0].width,
            frame->images[0].height, frame->stamp_ns);
    status = write_picture(export, "", &frame->images[0], error);
    if (status == FOVEA_OK) status = write_others(export, frame, error);
    if (status == FOVEA_OK) status = write_truth(export, frame, &truth, error);
    export->frames++;
    return status;
}

static enum fovea_status write_frames(struct export_run *export, struct fovea_error *error)
{
    struct fovea_frame frame;
    enum fovea_status status = export->ops->start(export->source, error);
    if (status < 0) return status;
    while ((status = export->ops->dequeue(export->source, INT64_MAX, &frame)) != FOVEA_END) {
        if (status < 0)
            return fv_source_failed(export->ops, export->source, export->uri, status, error);
        if (status != FOVEA_OK) continue;
        const enum fovea_status written = write_frame(export, &frame, error);
        export->ops->requeue(export->source, &frame);
        if (written != FOVEA_OK) return written;
        fv_progress_show(&export->progress, export->frames,
                         export->expected > 0 ? (double)export->frames / (double)export->expected
                                              : -1.0);
    }
    export->ops->stop(export->source);
    return FOVEA_OK;
}

static void append(FILE *to, FILE *from)
{
    char part[4096];
    rewind(from);
    for (size_t n; (n = fread(part, 1, sizeof part, from)) > 0;)
        fwrite(part, 1, n, to);
}

static void write_classes(FILE *file, int first, int end)
{
    for (int c = first; c < end; c++)
        fprintf(file, "%s\n  {\"id\": %d, \"name\": \"%s\"}", c == first ? "" : ",", c,
                class_names[c]);
}

/* DIR/name; NULL: `error` says why. */
static FILE *open_output(const struct export_run *export, const char *name,
                         struct fv_output *output, struct fovea_error *error)
{
    char path[PATH_BYTES];
    snprintf(path, sizeof path, "%.900s/%s", export->folder, name);
    if (fv_output_open(output, path, FV_OUTPUT_WHOLE, error) != FOVEA_OK) return NULL;
    FILE *file = fv_output_stream(output);
    if (file != NULL) return file;
    fv_output_discard(output);
    fovea_error_set(error, FOVEA_ERROR_SYSTEM, "%s: out of memory", path);
    return NULL;
}

static enum fovea_status write_map(const struct export_run *export, struct fovea_error *error)
{
    struct fv_output output;
    FILE *file = open_output(export, "classes-map.txt", &output, error);
    if (file == NULL) return FOVEA_ERROR_SYSTEM;
    for (int c = 0; c < FOVEA_TRUTH_CLASS_COUNT; c++)
        fprintf(file, "%d %s # %s\n", c, pixel_class[c], class_names[c]);
    return fv_output_close(&output, error);
}

static enum fovea_status write_json(const struct export_run *export, struct fovea_error *error)
{
    struct fv_output output;
    FILE *file = open_output(export, "truth.json", &output, error);
    if (file == NULL) return FOVEA_ERROR_SYSTEM;
    fprintf(file, "{\"images\": [");
    append(file, export->images);
    fprintf(file, "\n], \"annotations\": [");
    append(file, export->annotations);
    fprintf(file, "\n], \"categories\": [");
    write_classes(file, 1, FOVEA_TRUTH_OBJECT_COUNT);
    if (export->masks) {
        fprintf(file, "\n], \"mask_classes\": [");
        write_classes(file, 0, FOVEA_TRUTH_CLASS_COUNT);
    }
    fprintf(file, "\n]}\n");
    return fv_output_close(&output, error);
}

static enum fovea_status run(struct export_run *export, struct fovea_error *error)
{
    struct stat there;
    if (lstat(export->folder, &there) == 0) return refuse_folder(export, EEXIST, error);
    export->images = tmpfile();
    export->annotations = tmpfile();
    enum fovea_status status = FOVEA_OK;
    if (export->images == NULL || export->annotations == NULL)
        status = fovea_error_set(error, FOVEA_ERROR_SYSTEM, "export: no temporary file: %s",
                                 strerror(errno));
    if (status == FOVEA_OK) status = write_frames(export, error);
    if (status == FOVEA_OK) status = make_folder(export, error); /* there was no frame */
    if (status == FOVEA_OK) status = write_json(export, error);
    if (status == FOVEA_OK && export->masks) status = write_map(export, error);
    if (export->images != NULL) fclose(export->images);
    if (export->annotations != NULL) fclose(export->annotations);
    return status;
}

int fv_command_export(int argc, char **argv)
{
    struct export_run export = {0};
    struct fovea_source_selection selection = {.step = 1};
    const char *uri = "sim:", *address;
    const struct fv_option options[] = {
        {"source", "URI", FV_OPTION_TEXT, &uri, FV_SETUP_SOURCE_HELP},
        {"frames", "N", FV_OPTION_POSITIVE, &selection.frames, "end after N frames"},
        {"start", "N", FV_OPTION_COUNT, &selection.start, "start with frame N, counted from 0"},
        {"step", "K", FV_OPTION_POSITIVE, &selection.step, "take every K-th frame"},
        {"reverse", NULL, FV_OPTION_FLAG, &selection.reverse, "play the recording backwards"},
        {"masks", NULL, FV_OPTION_FLAG, &export.masks,
         "write the class of every pixel too, and classes-map.txt"},
        {0},
    };
    int first;
    const enum fv_options_result result =
        fv_options_parse(options, "DIR", 1, 1, argc, argv, &first);
    if (result == FV_OPTIONS_HELP) fv_setup_sources_print();
    if (result != FV_OPTIONS_READ) return result == FV_OPTIONS_HELP ? FV_EXIT_OK : FV_EXIT_WRONG;
    struct fovea_error error;
    export.folder = argv[first];
    export.uri = uri;
    if (fv_source_find(uri, &export.ops, &address, &error) != FOVEA_OK)
        return fv_say_wrong("%s", error.text);
    if (export.ops->open(address, &selection, &export.source, &error) != FOVEA_OK)
        return fv_say_wrong("%s", error.text);
    enum fovea_status status = FOVEA_OK;
    if (selection.frames == 0 && export.ops->info(export.source)->frame_count == 0)
        status = fovea_error_set(&error, FOVEA_ERROR_INPUT,
                                 "export: the source is endless: --frames N is missing");
    const uint64_t count = export.ops->info(export.source)->frame_count, limit = selection.frames;
    export.expected = count == 0 || (limit > 0 && limit < count) ? limit : count;
    fv_progress_begin(&export.progress, "export");
    if (status == FOVEA_OK) status = run(&export, &error);
    fv_progress_end(&export.progress);
    export.ops->close(export.source);
    if (status != FOVEA_OK)
        return status == FOVEA_ERROR_SYSTEM ? fv_say_failed("%s", error.text)
                                            : fv_say_wrong("%s", error.text);
    printf("%" PRIu64 " frames, ", export.frames);
    if (export.others > 0) printf("%" PRIu64 " images of other cameras, ", export.others);
    printf("%" PRIu64 " boxes in %s\n", export.boxes, export.folder);
    return FV_EXIT_OK;
}

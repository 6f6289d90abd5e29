/* fovea rectify: a picture without the distortion of its lens. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "support/aligned.h"
#include "app/lab/commands.h"
#include "support/files.h"
#include "app/config/options.h"
#include "support/picture.h"
#include "support/say.h"
#include "support/calibration.h"
#include "support/text.h"
#include "image/rectify.h"

struct request {
    const char *camera, *which, *shape, *size, *calibration;
    bool keep_all, scale;
};

/* "WxH", or the picture's own size. */
static bool read_size(const char *text, const struct fovea_image *image, int32_t *width,
                      int32_t *height)
{
    char word[16];
    int64_t across = image->width, down = image->height;
    if (text != NULL) {
        const size_t length = strcspn(text, "x");
        if (length >= sizeof word || text[length] == '\0') return false;
        memcpy(word, text, length);
        word[length] = '\0';
        if (!fv_text_integer(word, &across) || !fv_text_integer(text + length + 1, &down))
            return false;
        if (across < 0 || across > 99999 || down < 0 || down > 99999)
            return false; /* the rectified image knows its own bounds */
    }
    *width = (int32_t)across;
    *height = (int32_t)down;
    return true;
}

static enum fovea_status choose_rectified(const struct request *request,
                                          const struct fovea_camera *camera,
                                          const struct fovea_image *image,
                                          struct fv_rectified *rectified, struct fovea_error *error)
{
    int32_t width, height;
    const bool cylinder = request->shape != NULL && strcmp(request->shape, "cylinder") == 0;
    if (request->shape != NULL && !cylinder && strcmp(request->shape, "pinhole") != 0)
        return fovea_error_set(error, FOVEA_ERROR_ARGUMENT,
                               "--shape: found '%.100s', expected pinhole or cylinder",
                               request->shape);
    if (cylinder && request->calibration != NULL)
        return fovea_error_set(
            error, FOVEA_ERROR_ARGUMENT,
            "--write-camera: calibration files hold no cylinder, expected --shape pinhole");
    if (!read_size(request->size, image, &width, &height))
        return fovea_error_set(error, FOVEA_ERROR_ARGUMENT,
                               "--size: found '%.100s', expected WIDTHxHEIGHT", request->size);
    return fv_rectified_choose(camera, cylinder ? FV_RECTIFIED_CYLINDER : FV_RECTIFIED_PINHOLE,
                               request->keep_all ? FV_RECTIFIED_KEEP_ALL : FV_RECTIFIED_CROP, width,
                               height, rectified, error);
}

static enum fovea_status write_camera(const char *path, const struct fv_rectified *rectified,
                                      struct fovea_error *error)
{
    struct fv_calibration calibration = {0};
    calibration.camera.width = rectified->width;
    calibration.camera.height = rectified->height;
    calibration.camera.lens = FOVEA_LENS_RADTAN;
    calibration.camera.fx = rectified->fx;
    calibration.camera.fy = rectified->fy;
    calibration.camera.cx = rectified->cx;
    calibration.camera.cy = rectified->cy;
    return fv_calibration_write(path, FV_CALIBRATION_ROS, &calibration, NULL, error);
}

/* Map, resample, write. */
static enum fovea_status resample(const struct fovea_camera *camera,
                                  const struct fv_rectified *rectified,
                                  const struct fovea_image *image, const char *path,
                                  struct fovea_error *error)
{
    struct fv_rectify rectify;
    struct fv_kernels kernels;
    struct fv_arena arena;
    enum fv_cpu_set cpu;
    enum fovea_status status = fv_cpu_from_environment(&cpu, error);
    if (status != FOVEA_OK) return status;
    fv_kernels_init(&kernels, cpu);
    fv_arena_count(&arena);
    fv_rectify_carve(&rectify, camera, rectified, &arena);
    const size_t out_bytes = (size_t)rectify.stride_bytes * (size_t)rectified->height;
    fv_arena_take_raw(&arena, out_bytes, 1);
    const size_t bytes = arena.used;
    void *memory = fv_aligned_new(bytes);
    if (memory == NULL)
        return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "out of memory: %zu bytes", bytes);
    fv_arena_init(&arena, memory, bytes);
    fv_rectify_carve(&rectify, camera, rectified, &arena);
    const struct fv_plane source =
        fv_plane_of(image->data, image->width, image->height, image->stride_bytes);
    const struct fv_plane out = {fv_arena_take_raw(&arena, out_bytes, 1), rectified->width,
                                 rectified->height, rectify.stride_bytes};
    fv_rectify_run(&rectify, &kernels, &source, &out);
    const struct fovea_image result = {out.pixels,           rectified->width,  rectified->height,
                                       rectify.stride_bytes, FOVEA_PIXEL_GREY8, out_bytes};
    status = fv_picture_write(path, &result, error);
    free(memory);
    return status;
}

static enum fovea_status rectify(const struct request *request, const char *in, const char *out,
                                 struct fovea_error *error)
{
    struct fv_calibration calibration;
    struct fovea_image image = {0};
    struct fv_rectified rectified;
    enum fovea_status status =
        fv_calibration_read(request->camera, request->which, &calibration, error);
    if (status == FOVEA_OK) status = fv_picture_read(in, &image, error);
    if (status == FOVEA_OK)
        status = fv_calibration_fit(&calibration.camera, image.width, image.height, request->scale,
                                    request->camera, error);
    if (status == FOVEA_OK)
        status = choose_rectified(request, &calibration.camera, &image, &rectified, error);
    if (status == FOVEA_OK) status = resample(&calibration.camera, &rectified, &image, out, error);
    if (status == FOVEA_OK && request->calibration != NULL)
        status = write_camera(request->calibration, &rectified, error);
    if (status == FOVEA_OK)
        printf("%s of %d x %d pixels, f %.4f, centre %.4f %.4f\n",
               rectified.shape == FV_RECTIFIED_PINHOLE ? "pinhole" : "cylinder", rectified.width,
               rectified.height, rectified.fx, rectified.cx, rectified.cy);
    free((void *)(uintptr_t)image.data);
    return status;
}

int fv_command_rectify(int argc, char **argv)
{
    struct request request = {0};
    const struct fv_option options[] = {
        {"camera", "FILE", FV_OPTION_TEXT, &request.camera,
         "calibration of the camera that took the picture"},
        {"which", "NAME", FV_OPTION_TEXT, &request.which,
         "camera of a camera chain file (default the first)"},
        {"scale-camera", NULL, FV_OPTION_FLAG, &request.scale,
         "scale a calibration that was made at another resolution"},
        {"shape", "SHAPE", FV_OPTION_TEXT, &request.shape,
         "pinhole (default), or cylinder for wide fisheyes"},
        {"keep-all", NULL, FV_OPTION_FLAG, &request.keep_all,
         "keep the whole field of the camera, with black margins"},
        {"size", "WxH", FV_OPTION_TEXT, &request.size,
         "size of the result (default that of the picture)"},
        {"write-camera", "FILE", FV_OPTION_TEXT, &request.calibration,
         "write the calibration of the result (ROS camera_info)"},
        {0},
    };
    int first;
    const enum fv_options_result result =
        fv_options_parse(options, "IN OUT", 2, 2, argc, argv, &first);
    if (result != FV_OPTIONS_READ) return result == FV_OPTIONS_HELP ? FV_EXIT_OK : FV_EXIT_WRONG;
    if (request.camera == NULL) return fv_say_wrong("rectify: no camera, expected --camera FILE");
    struct fovea_error error;
    const struct fv_file written[] = {
        {"OUT", argv[first + 1]}, {"--write-camera", request.calibration}, {0}};
    const struct fv_file read[] = {{"IN", argv[first]}, {"--camera", request.camera}, {0}};
    enum fovea_status status = fv_files_apart(written, read, &error);
    if (status == FOVEA_OK) status = fv_picture_check_name("OUT", argv[first + 1], &error);
    if (status == FOVEA_OK) status = rectify(&request, argv[first], argv[first + 1], &error);
    if (status == FOVEA_OK) return FV_EXIT_OK;
    return status == FOVEA_ERROR_SYSTEM ? fv_say_failed("%s", error.text)
                                        : fv_say_wrong("%s", error.text);
}

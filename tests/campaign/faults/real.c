#include "real.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "drivers/table.h"
#include "fovea/source.h"
#include "plan.h"
#include "play.h"
#include "support/picture.h"

/* Frames of the source from its middle 640 x 480, by means of 2 x 2. */
static void shrink(const struct fovea_image *from, uint8_t *to)
{
    const int left = (from->width - 2 * FAULTS_WIDTH) / 2,
              top = (from->height - 2 * FAULTS_HEIGHT) / 2;
    for (int y = 0; y < FAULTS_HEIGHT; y++)
        for (int x = 0; x < FAULTS_WIDTH; x++) {
            const uint8_t *a = from->data + (size_t)(top + 2 * y) * (size_t)from->stride_bytes +
                               left + 2 * x,
                          *b = a + from->stride_bytes;
            to[y * FAULTS_WIDTH + x] = (uint8_t)((a[0] + a[1] + b[0] + b[1] + 2) / 4);
        }
}

static void write_camera(const char *folder, const struct fovea_camera *camera)
{
    char path[FAULTS_TEXT];
    (void)snprintf(path, sizeof path, "%s/camera.yaml", folder);
    FILE *file = fopen(path, "w");
    if (file == NULL) faults_die("camera.yaml cannot be written");
    const double left = (camera->width - 2 * FAULTS_WIDTH) / 2,
                 top = (camera->height - 2 * FAULTS_HEIGHT) / 2;
    fprintf(file,
            "image_width: %d\nimage_height: %d\ncamera_name: shrunk\ncamera_matrix:\n  rows: 3\n"
            "  cols: 3\n  data: [%.9g, 0.0, %.9g, 0.0, %.9g, %.9g, 0.0, 0.0, 1.0]\n"
            "distortion_model: plumb_bob\ndistortion_coefficients:\n  rows: 1\n  cols: 5\n"
            "  data: [%.9g, %.9g, %.9g, %.9g, 0.0]\n",
            FAULTS_WIDTH, FAULTS_HEIGHT, camera->fx / 2, (camera->cx - left - 0.5) / 2,
            camera->fy / 2, (camera->cy - top - 0.5) / 2, camera->k[0], camera->k[1], camera->k[2],
            camera->k[3]);
    if (fclose(file)) faults_die("camera.yaml cannot be written");
}

/* All frames into the folder `to`. */
static void shrink_all(const char *uri, const char *to)
{
    static uint8_t pixels[FAULTS_WIDTH * FAULTS_HEIGHT];
    char path[FAULTS_TEXT];
    const char *address;
    const struct fovea_source_ops *ops;
    struct fovea_source *source;
    struct fovea_frame frame;
    struct fovea_error error;
    const struct fovea_source_selection all = {.step = 1};
    if (fv_source_find(uri, &ops, &address, &error) || ops->open(address, &all, &source, &error) ||
        ops->start(source, &error))
        faults_die(error.text);
    write_camera(to, &ops->info(source)->rig.cameras[0].camera);
    (void)snprintf(path, sizeof path, "%s/rgb.txt", to);
    FILE *list = fopen(path, "w");
    if (list == NULL) faults_die("rgb.txt cannot be written");
    for (int n = 0; ops->dequeue(source, INT64_MAX, &frame) == FOVEA_OK; n++) {
        const struct fovea_image small = {.width = FAULTS_WIDTH,
                                          .height = FAULTS_HEIGHT,
                                          .stride_bytes = FAULTS_WIDTH,
                                          .format = FOVEA_PIXEL_GREY8,
                                          .data = pixels,
                                          .size_bytes = sizeof pixels};
        shrink(&frame.images[0], pixels);
        (void)snprintf(path, sizeof path, "%s/%d.png", to, n);
        if (fv_picture_write(path, &small, &error)) faults_die(error.text);
        fprintf(list, "%.9f %d.png\n", 1e-9 * (double)frame.stamp_ns, n);
        ops->requeue(source, &frame);
    }
    ops->stop(source);
    ops->close(source);
    if (fclose(list)) faults_die("rgb.txt cannot be written");
}

void faults_real(const char *uri, const char *folder, const char *name)
{
    char begun[FAULTS_TEXT / 2], whole[FAULTS_TEXT / 2];
    (void)snprintf(begun, sizeof begun, "%s/%s.begun", folder, name);
    (void)snprintf(whole, sizeof whole, "%s/%s", folder, name);
    if (access(whole, F_OK) == 0) return;
    if (mkdir(begun, 0777) && errno != EEXIST) faults_die("a folder cannot be made");
    shrink_all(uri, begun);
    if (rename(begun, whole)) faults_die("a folder cannot be renamed");
}

/* The library in a program of your own: raw grey frames come on stdin, a pose per frame goes out.
 *
 *     loop WIDTH HEIGHT FX FY CX CY [RATE_HZ] <frames
 *
 * Frames of WIDTH x HEIGHT bytes follow one another; the camera is a pinhole without distortion.
 * Each line is "seconds state x y z": where the camera is, in the frame that it had at the start.
 * The unit of x y z is the median depth at the start (docs/frames-and-time.md). */
#include <stdio.h>
#include <stdlib.h>

#include <fovea/fovea.h>

static int fail(const char *what, const struct fovea_error *error)
{
    fprintf(stderr, "loop: %s: %s\n", what, error->text);
    return 2;
}

static void pose_print(const struct fovea *rt, double seconds)
{
    static const char *const states[] = {"starting", "tracking", "weak", "lost"};
    struct fovea_pose pose;
    fovea_pose_get(rt, &pose);
    printf("%.3f %s", seconds, states[pose.state]);
    if (pose.posed) /* else T_world_cam does not hold */
        printf(" %.6f %.6f %.6f", pose.T_world_cam[3], pose.T_world_cam[7], pose.T_world_cam[11]);
    printf("\n");
}

int main(int argc, char **argv)
{
    struct fovea_config config;
    struct fovea_error error;
    struct fovea *rt;
    size_t bytes;
    if (argc < 7) {
        fprintf(stderr, "usage: loop WIDTH HEIGHT FX FY CX CY [RATE_HZ] <frames\n");
        return 2;
    }

    /* What is to be done. Every member that is not set keeps its default. */
    fovea_config_default(&config);
    struct fovea_camera *camera = &config.rig.cameras[0].camera;
    camera->width = atoi(argv[1]);
    camera->height = atoi(argv[2]);
    camera->fx = atof(argv[3]);
    camera->fy = atof(argv[4]);
    camera->cx = atof(argv[5]);
    camera->cy = atof(argv[6]);
    if (fovea_camera_prepare(camera, &error) != FOVEA_OK) return fail("camera", &error);

    /* All memory, before the first frame. */
    if (fovea_size(&config, &bytes, &error) != FOVEA_OK) return fail("configuration", &error);
    const size_t whole = (bytes + FOVEA_BLOCK_ALIGNMENT - 1) & ~(size_t)(FOVEA_BLOCK_ALIGNMENT - 1);
    void *block = aligned_alloc(FOVEA_BLOCK_ALIGNMENT, whole);
    const size_t frame_bytes = (size_t)camera->width * (size_t)camera->height;
    unsigned char *pixels = malloc(frame_bytes);
    if (block == NULL || pixels == NULL) return 1;
    if (fovea_init(block, bytes, &config, &rt, &error) != FOVEA_OK) return fail("start", &error);

    /* The loop. */
    const double period_s = 1.0 / (argc > 7 ? atof(argv[7]) : 30.0);
    for (unsigned n = 0; fread(pixels, 1, frame_bytes, stdin) == frame_bytes; n++) {
        struct fovea_inputs inputs = {0};
        struct fovea_outputs outputs; /* LCM messages, encoded: send them or ignore them */
        struct fovea_frame frame = {
            .images = {{.data = pixels,
                        .width = camera->width,
                        .height = camera->height,
                        .stride_bytes = camera->width,
                        .format = FOVEA_PIXEL_GREY8,
                        .size_bytes = frame_bytes}},
            .image_count = 1,
            .stamp_ns = (int64_t)(n * period_s * 1e9),
            .clock = FOVEA_CLOCK_RECORDED,
            .sequence = n,
        };
        inputs.frame = &frame;
        inputs.now_ns = frame.stamp_ns;
        fovea_grants_fixed(&config, &inputs.grants); /* by the clock: struct fovea_governor */
        fovea_step(rt, &inputs, &outputs);           /* the pose of this frame */
        pose_print(rt, n * period_s);
        fovea_work(rt, &inputs.grants, &outputs); /* the map, in units of at most 0.25 ms */
    }
    free(pixels);
    free(block); /* there is nothing else to destroy */
    return 0;
}

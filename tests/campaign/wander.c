/* A long walk on the simulated camera: frames must cost at the end what they cost after a while, when pools
 * are full, and memory must not grow by a byte.
 *
 * Usage: wander FRAMES [OPTIONS]     step and work of every frame are timed in CPU time of this thread. Of
 * 108,000 frames (an hour at 30 Hz) the median of the last sixth (ten minutes) may be at most 1.05 times that
 * of frames 9,000 to 27,000 (minutes 5 to 15); of fewer frames, the same shares. OPTIONS go to sim:wander.
 * Exit 0 when that holds and resident memory at the end is that of the same place. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <time.h>
#include <unistd.h>

#include "fovea/fovea.h"
#include "fovea/source.h"
#include "runtime/state.h"

static const double ratio_max = 1.05;

_Noreturn static void die(const char *what)
{
    fprintf(stderr, "%s\n", what);
    exit(2);
}

static double cpu_ms(void)
{
    struct timespec now;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
    return 1e3 * (double)now.tv_sec + 1e-6 * (double)now.tv_nsec;
}

static long resident_bytes(void)
{
    long pages = 0, resident = 0;
    FILE *file = fopen("/proc/self/statm", "r");
    if (file == NULL || fscanf(file, "%ld %ld", &pages, &resident) != 2) die("/proc/self/statm");
    fclose(file);
    return resident * sysconf(_SC_PAGESIZE);
}

static int by_value(const void *a, const void *b)
{
    const float x = *(const float *)a, y = *(const float *)b;
    return (x > y) - (x < y);
}

static double median(float *values, size_t count)
{
    qsort(values, count, sizeof *values, by_value);
    return (double)values[count / 2];
}

int main(int argc, char **argv)
{
    if (argc < 2) die("usage: wander FRAMES [OPTIONS]");
    const size_t frames = (size_t)atol(argv[1]), early = frames / 12, early_end = frames / 4,
                 late = frames - frames / 6;
    char uri[256];
    (void)snprintf(uri, sizeof uri, "sim:wander%s%s", argc > 2 ? "?" : "", argc > 2 ? argv[2] : "");
    const struct fovea_source_ops *ops;
    const char *address;
    struct fovea_error error;
    struct fovea_source *source;
    const struct fovea_source_selection all = {.step = 1, .frames = frames};
    if (fovea_source_find(uri, &ops, &address, &error) || ops->open(address, &all, &source, &error) ||
        ops->start(source, &error))
        die(error.text);
    struct fovea_config config;
    fovea_config_default(&config);
    config.odometry.keyframes = FOVEA_ODOMETRY_KEYFRAMES_MAX;
    config.camera = ops->info(source)->camera;
    size_t bytes;
    struct fovea *rt;
    if (fovea_camera_prepare(&config.camera, &error) || fovea_size(&config, &bytes, &error)) die(error.text);
    const size_t whole = (bytes + 4095) / 4096 * 4096;
    void *memory = aligned_alloc(FOVEA_BLOCK_ALIGNMENT, whole);
    float *spent = calloc(frames, sizeof *spent);
    if (memory == NULL || spent == NULL) die("no memory");
    /* As `fovea run` does: every page of the block is touched at the start. Code that first runs after the count must
     * not count either. */
    memset(memory, 0xa5, whole);
    for (size_t i = 0; i < frames; i++)
        spent[i] = 1;
    if (fovea_init(memory, bytes, &config, &rt, &error)) die(error.text);
    if (mlockall(MCL_CURRENT)) fputs("pages cannot be locked: code may yet become resident\n", stderr);

    struct fovea_frame frame;
    struct fovea_inputs inputs = {.temperature_c = NAN};
    struct fovea_outputs outputs;
    fovea_grants_fixed(&config, &inputs.grants);
    size_t n = 0, posed = 0;
    long resident_early = 0;
    for (; n < frames && ops->dequeue(source, INT64_MAX, &frame) == FOVEA_OK; n++) {
        inputs.frame = &frame;
        inputs.now_ns = frame.stamp_ns;
        const double begin = cpu_ms();
        (void)fovea_step(rt, &inputs, &outputs);
        (void)fovea_work(rt, &inputs.grants, &outputs);
        spent[n] = (float)(cpu_ms() - begin);
        struct fovea_pose pose;
        fovea_pose_get(rt, &pose);
        posed += pose.posed;
        ops->requeue(source, &frame);
        if (n == early) resident_early = resident_bytes();
    }
    const long resident_end = resident_bytes();
    if (n < frames) die("the source ended early");
    const struct fv_odometry *o = &rt->odometry;
    const double first = median(spent + early, early_end - early), last = median(spent + late, frames - late);
    printf(
        "%zu of %zu frames posed; %u keyframes, %u landmarks; %u loops closed, %u maps merged, %u resets\n",
        posed, n, o->map.state->keyframe_count, o->map.state->landmark_count, o->loop.state->counts.closed,
        o->loop.state->counts.merged, o->state->reset_counter);
    printf("median CPU ms per frame: %.3f early, %.3f at the end (%.3f times; at most %.2f)\n", first, last,
           last / first, ratio_max);
    printf("resident bytes: %ld early, %ld at the end; block %zu\n", resident_early, resident_end, bytes);
    ops->stop(source);
    ops->close(source);
    free(memory);
    free(spent);
    return last <= ratio_max * first && resident_early == resident_end ? 0 : 1;
}

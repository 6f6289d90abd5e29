/* A long walk on the simulated camera: frames must cost at the end what they cost after a while,
 * when pools are full, and memory must not grow by a byte.
 *
 * Usage: wander FRAMES [OPTIONS]     step and work of every frame are timed in CPU time of this
 * thread. Of 108,000 frames (an hour at 30 Hz) the median of the last sixth (ten minutes) may be at
 * most 1.05 times that of frames 9,000 to 27,000 (minutes 5 to 15); of fewer frames, the same
 * shares. OPTIONS go to sim:wander. Exit 0 when that holds and resident memory at the end is that
 * of the same place.
 *
 * wander --soak STEPS [OPTIONS]     at 160 x 120 unless OPTIONS say otherwise. From step 10,000 on
 * (of fewer than 100,000 steps: from a tenth on) every 1,000th step, and the last, must find memory
 * that is in no file, the resident set and open descriptors equal to the byte; and of ten equal
 * parts behind that step the last may take at most 1.05 times what the first takes. Other programs
 * that come and go slow CPU time down, too: of each part the least median of ten stretches counts
 * (a part of under 20,000 steps is one stretch), and is printed. Of fewer than 100,000 steps the
 * ratio is not judged: what is seen in a part decides more. At least half of the frames must be
 * posed: what sees nothing has nothing that could grow. */
#include <dirent.h>
#include <inttypes.h>
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <time.h>
#include <unistd.h>

#include "app/run/process.h"
#include "fovea/fovea.h"
#include "drivers/table.h"
#include "fovea/source.h"
#include "runtime/state.h"

enum { PARTS = 10, STRETCHES = 10, STRETCH_MIN = 2000, DRIFT_STEPS = 100000 };

static const double ratio_max = 1.05, posed_min = 0.5;

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

/* The least median of equal stretches of `values`, or of all where these are few; sorts them. */
static double least_median(float *values, size_t count)
{
    const size_t stretches = count < STRETCHES * STRETCH_MIN ? 1 : STRETCHES,
                 stretch = count / stretches;
    double least = INFINITY;
    for (size_t i = 0; i < stretches; i++)
        least = fmin(least, median(values + i * stretch, stretch));
    return least;
}

/* What must not change. */
struct holding {
    uint64_t anonymous, resident;
    int descriptors;
};

static struct holding holding_now(void)
{
    struct holding now = {.anonymous = fv_process_anonymous_bytes(),
                          .resident = fv_process_resident_bytes()};
    DIR *folder = opendir("/proc/self/fd");
    if (folder == NULL || now.anonymous == 0) die("/proc/self");
    while (readdir(folder) != NULL)
        now.descriptors++;
    closedir(folder);
    return now;
}

/* The runtime on an endless walk, and what each frame took. */
struct walk {
    const struct fovea_source_ops *ops;
    struct fovea_source *source;
    struct fovea_config config;
    struct fovea *rt;
    size_t bytes, frames, posed;
    float *spent; /* CPU ms */
    long resident_early, resident_end;
    /* of a soak */
    bool soak;
    struct holding held;
    size_t looks, changed_at; /* looks that were taken; the first step with other values */
};

static void begin(struct walk *walk, const char *uri)
{
    const char *address;
    struct fovea_error error;
    const struct fovea_source_selection all = {.step = 1, .frames = walk->frames};
    if (fv_source_find(uri, &walk->ops, &address, &error) ||
        walk->ops->open(address, &all, &walk->source, &error) ||
        walk->ops->start(walk->source, &error))
        die(error.text);
    struct fovea_config *config = &walk->config;
    fovea_config_default(config);
    config->odometry.keyframes = FOVEA_ODOMETRY_KEYFRAMES_MAX;
    config->rig.cameras[0].camera = walk->ops->info(walk->source)->rig.cameras[0].camera;
    if (fovea_camera_prepare(&config->rig.cameras[0].camera, &error) ||
        fovea_size(config, &walk->bytes, &error))
        die(error.text);
    const size_t whole = (walk->bytes + 4095) / 4096 * 4096;
    void *memory = aligned_alloc(FOVEA_BLOCK_ALIGNMENT, whole);
    walk->spent = calloc(walk->frames, sizeof *walk->spent);
    if (memory == NULL || walk->spent == NULL) die("no memory");
    /* As `fovea run` does: every page of the block is touched at the start. Code that first runs
     * after the count must not count either. */
    memset(memory, 0xa5, whole);
    for (size_t i = 0; i < walk->frames; i++)
        walk->spent[i] = 1;
    if (fovea_init(memory, walk->bytes, config, &walk->rt, &error)) die(error.text);
    if (mlockall(MCL_CURRENT))
        fputs("pages cannot be locked: code may yet become resident\n", stderr);
}

/* Hold what the process has at step n against what it had at step `early`. Files of /proc are read
 * from the heap: the first look of all is not compared with, as it may make that grow. */
static void look(struct walk *walk, size_t n, size_t early)
{
    if (n == 0) (void)holding_now();
    if (n == early) walk->held = holding_now();
    if (n <= early || (n % 1000 != 0 && n + 1 < walk->frames)) return;
    const struct holding now = holding_now(), *held = &walk->held;
    walk->looks++;
    if (now.anonymous == held->anonymous && now.resident == held->resident &&
        now.descriptors == held->descriptors)
        return;
    if (walk->changed_at == 0)
        printf("step %zu: %" PRIu64 " bytes in no file, %" PRIu64 " resident, %d descriptors\n", n,
               now.anonymous, now.resident, now.descriptors);
    if (walk->changed_at == 0) walk->changed_at = n;
}

/* All frames; what is resident is noted after frame number `early`. */
static void go(struct walk *walk, size_t early)
{
    struct fovea_frame frame;
    struct fovea_inputs inputs = {.temperature_c = NAN};
    struct fovea_outputs outputs;
    size_t n = 0;
    fovea_grants_fixed(&walk->config, &inputs.grants);
    for (; n < walk->frames && walk->ops->dequeue(walk->source, INT64_MAX, &frame) == FOVEA_OK;
         n++) {
        inputs.frame = &frame;
        inputs.now_ns = frame.stamp_ns;
        const double began = cpu_ms();
        (void)fovea_step(walk->rt, &inputs, &outputs);
        (void)fovea_work(walk->rt, &inputs.grants, &outputs);
        walk->spent[n] = (float)(cpu_ms() - began);
        struct fovea_pose pose;
        fovea_pose_get(walk->rt, &pose);
        walk->posed += pose.posed;
        walk->ops->requeue(walk->source, &frame);
        if (n == early) walk->resident_early = resident_bytes();
        if (walk->soak) look(walk, n, early);
        if (walk->soak && n % 100000 == 99999) fprintf(stderr, "step %zu\n", n + 1);
    }
    walk->resident_end = resident_bytes();
    if (n < walk->frames) die("the source ended early");
}

static void end(struct walk *walk)
{
    walk->ops->stop(walk->source);
    walk->ops->close(walk->source);
    free(walk->rt);
    free(walk->spent);
}

static void say_map(const struct walk *walk)
{
    const struct fv_odometry *o = &walk->rt->odometry;
    printf(
        "%zu of %zu frames posed; %u keyframes, %u landmarks; %u closures, %u maps merged, %u resets\n",
        walk->posed, walk->frames, o->map.state->keyframe_count, o->map.state->landmark_count,
        o->closure.state->counts.closed, o->closure.state->counts.merged, o->state->reset_counter);
}

static int soak(size_t steps, const char *options)
{
    struct walk walk = {.frames = steps, .soak = true};
    const size_t early = steps < DRIFT_STEPS ? steps / PARTS : 10000,
                 part = (steps - early) / PARTS;
    char uri[256];
    (void)snprintf(uri, sizeof uri, "sim:wander?%s",
                   options != NULL ? options : "width=160&height=120");
    begin(&walk, uri);
    go(&walk, early);
    printf("least median CPU ms per step, by ten parts:");
    double first = 0, last = 0;
    for (size_t i = 0; i < PARTS; i++) {
        last = least_median(walk.spent + early + i * part, part);
        if (i == 0) first = last;
        printf(" %.4f", last);
    }
    printf("\n");
    const double ratio = last / first;
    const bool judged = steps >= DRIFT_STEPS, steady = !judged || ratio <= ratio_max;
    say_map(&walk);
    printf("step %zu: %" PRIu64 " bytes in no file, %" PRIu64
           " resident, %d descriptors; %zu looks later %s\n",
           early, walk.held.anonymous, walk.held.resident, walk.held.descriptors, walk.looks,
           walk.changed_at == 0 ? "all are equal" : "NOT ALL ARE EQUAL");
    printf("%.4f in the first of the ten parts behind it, %.4f in the last (%.3f times)%s\n", first,
           last, ratio,
           !judged  ? ", not judged"
           : steady ? ""
                    : ": DRIFT");
    end(&walk);
    const bool sees = (double)walk.posed >= posed_min * (double)steps;
    if (!sees) printf("fewer than %.0f %% of the frames are posed\n", 100 * posed_min);
    return walk.changed_at == 0 && walk.looks > 0 && steady && sees ? 0 : 1;
}

int main(int argc, char **argv)
{
    if (argc > 2 && strcmp(argv[1], "--soak") == 0 && atol(argv[2]) >= 100)
        return soak((size_t)atol(argv[2]), argc > 3 ? argv[3] : NULL);
    if (argc < 2 || atol(argv[1]) < 100) die("usage: wander [--soak] FRAMES [OPTIONS]");
    struct walk walk = {.frames = (size_t)atol(argv[1])};
    const size_t early = walk.frames / 12, early_end = walk.frames / 4,
                 late = walk.frames - walk.frames / 6;
    char uri[256];
    (void)snprintf(uri, sizeof uri, "sim:wander%s%s", argc > 2 ? "?" : "", argc > 2 ? argv[2] : "");
    begin(&walk, uri);
    go(&walk, early);
    const double first = median(walk.spent + early, early_end - early),
                 last = median(walk.spent + late, walk.frames - late);
    say_map(&walk);
    printf("median CPU ms per frame: %.3f early, %.3f at the end (%.3f times; at most %.2f)\n",
           first, last, last / first, ratio_max);
    printf("resident bytes: %ld early, %ld at the end; block %zu\n", walk.resident_early,
           walk.resident_end, walk.bytes);
    end(&walk);
    return last <= ratio_max * first && walk.resident_early == walk.resident_end ? 0 : 1;
}

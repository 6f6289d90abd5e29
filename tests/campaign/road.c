/* How far the maps of drives can be trusted: runs of any source with truth, and for each the maps
 * that the odometry published as `tracking`, by the scale of their windows.
 * tools/evaluate/sim_road.sh makes a table of it.
 *
 * Usage: road FRAMES STARTS URI...     STARTS: "0", or first frames as "0,7,15"; one line per run:
 *
 *   uri start ratio tracking weak lost maps inliers depth parallax
 *
 * ratio: of the windows of 10 steps of a map, estimated over true length of their path, the largest
 * over the least; of the run's worst map that had at least 10 frames published as `tracking`; 0:
 * none had. inliers, depth (m): 10th, 50th and 90th percentile over frames with a pose, the depth
 * that of their inliers, by the true scale. parallax: of a landmark at the median depth, degrees
 * between two frames. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fovea/fovea.h"
#include "drivers/table.h"
#include "fovea/source.h"
#include "runtime/state.h"

enum { FRAMES_MAX = 1000, WINDOW = 10, SAMPLES_MAX = 400000 };

struct run {
    struct fovea *rt;
    const struct fovea_source_ops *ops;
    struct fovea_source *source;
    int frames;
    struct fovea_pose pose[FRAMES_MAX];
    double truth[FRAMES_MAX][12];
};

static struct run run;
static float depths[SAMPLES_MAX], inliers[FRAMES_MAX];
static int depth_count, inlier_count;

_Noreturn static void die(const char *what)
{
    fprintf(stderr, "road: %s\n", what);
    exit(2);
}

static double moved(const double a[12], const double b[12])
{
    const double d[3] = {b[3] - a[3], b[7] - a[7], b[11] - a[11]};
    return sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
}

static void open_run(const char *uri, int start, int frames)
{
    struct fovea_error error;
    const char *address;
    const struct fovea_source_selection selection = {
        .start = (uint64_t)start, .step = 1, .frames = (uint64_t)frames};
    memset(&run, 0, sizeof run);
    if (fv_source_find(uri, &run.ops, &address, &error) ||
        run.ops->open(address, &selection, &run.source, &error) ||
        run.ops->start(run.source, &error))
        die(error.text);
    struct fovea_config config;
    fovea_config_default(&config);
    config.rig.cameras[0].camera = run.ops->info(run.source)->rig.cameras[0].camera;
    config.preview.period_frames = 0;
    size_t bytes;
    if (fovea_size(&config, &bytes, &error)) die(error.text);
    void *memory = aligned_alloc(FOVEA_BLOCK_ALIGNMENT, (bytes + 4095) / 4096 * 4096);
    if (memory == NULL || fovea_init(memory, bytes, &config, &run.rt, &error)) die(error.text);
}

static int ascending(const void *a, const void *b)
{
    const float x = *(const float *)a, y = *(const float *)b;
    return (x > y) - (x < y);
}

static double percentile(const float *sorted, int count, int in_100)
{
    return count > 0 ? (double)sorted[(int)((long)(count - 1) * in_100 / 100)] : 0;
}

/* Depths of the landmarks that the last frame found, in metres: the unit of the map by its last
 * window. */
static void gather_depths(void)
{
    const int n = run.frames - 1;
    const struct fovea_pose *pose = &run.pose[n];
    const struct fv_map *map = &run.rt->odometry.map;
    uint32_t last = 0;
    double way = 0, real = 0;
    if (!pose->posed || n < WINDOW) return;
    for (int k = n - WINDOW; k < n; k++) {
        if (!run.pose[k].posed || run.pose[k].map_id != pose->map_id) return;
        way += moved(run.pose[k].T_world_cam, run.pose[k + 1].T_world_cam);
        real += moved(run.truth[k], run.truth[k + 1]);
    }
    inliers[inlier_count++] = (float)pose->inliers;
    for (uint32_t i = 0; i < map->limits.landmarks; i++)
        if (map->landmarks[i].used && map->landmarks[i].seen > last) last = map->landmarks[i].seen;
    for (uint32_t i = 0; i < map->limits.landmarks && way > 0; i++) {
        const struct fv_landmark *l = &map->landmarks[i];
        double z = 0;
        if (!l->used || l->seen != last || depth_count == SAMPLES_MAX) continue;
        for (int k = 0; k < 3; k++)
            z += pose->T_world_cam[4 * k + 2] * (l->point[k] - pose->T_world_cam[4 * k + 3]);
        if (z > 0) depths[depth_count++] = (float)(z * real / way);
    }
}

static void one_frame(const struct fovea_frame *frame)
{
    struct fovea_inputs inputs = {.frame = frame, .now_ns = frame->stamp_ns, .temperature_c = NAN};
    struct fovea_outputs outputs;
    struct fovea_config config;
    fovea_config_default(&config);
    fovea_grants_fixed(&config, &inputs.grants);
    if (run.ops->truth_pose(run.source, frame, run.truth[run.frames]) != FOVEA_OK)
        die("a frame without truth");
    (void)fovea_step(run.rt, &inputs, &outputs);
    fovea_pose_get(run.rt, &run.pose[run.frames++]);
    gather_depths();
    (void)fovea_work(run.rt, &inputs.grants, &outputs);
}

static bool same_map(int a, int b)
{
    return run.pose[a].posed && run.pose[b].posed && run.pose[a].map_id == run.pose[b].map_id &&
           run.pose[a].reset_counter == run.pose[b].reset_counter;
}

/* Estimated over true length of the path of the window that ends at a frame; 0: it is in no map, or
 * the truth stood. */
static double window_scale(int end)
{
    double way = 0, real = 0;
    if (end < WINDOW) return 0;
    for (int k = end - WINDOW; k < end; k++) {
        if (!same_map(k, end)) return 0;
        way += moved(run.pose[k].T_world_cam, run.pose[k + 1].T_world_cam);
        real += moved(run.truth[k], run.truth[k + 1]);
    }
    return real > 0.1 ? way / real : 0;
}

/* The worst map's largest over its least scale. */
static double worst_ratio(void)
{
    double worst = 0, least = 0, largest = 0;
    int tracking = 0;
    for (int n = 0; n < run.frames; n++) {
        const double scale = window_scale(n);
        if (n == 0 || !same_map(n - 1, n)) {
            least = largest = 0;
            tracking = 0;
        }
        tracking += run.pose[n].state == FOVEA_TRACKING_OK;
        if (scale > 0 && (least == 0 || scale < least)) least = scale;
        if (scale > largest) largest = scale;
        if (tracking >= WINDOW && largest > worst * least) worst = largest / least;
    }
    return worst;
}

static void report(const char *uri, int start)
{
    int count[4] = {0, 0, 0, 0}, maps = 0;
    double way = 0;
    for (int n = 0; n < run.frames; n++) {
        count[run.pose[n].state]++;
        maps += run.pose[n].posed && (n == 0 || !run.pose[n - 1].posed);
        if (n > 0) way += moved(run.truth[n - 1], run.truth[n]);
    }
    qsort(depths, (size_t)depth_count, sizeof *depths, ascending);
    qsort(inliers, (size_t)inlier_count, sizeof *inliers, ascending);
    const double middle = percentile(depths, depth_count, 50);
    printf("%s %d %.2f %d %d %d %d %.0f %.0f %.0f %.1f %.1f %.1f %.2f\n", uri, start, worst_ratio(),
           count[FOVEA_TRACKING_OK], count[FOVEA_TRACKING_WEAK], count[FOVEA_TRACKING_LOST], maps,
           percentile(inliers, inlier_count, 10), percentile(inliers, inlier_count, 50),
           percentile(inliers, inlier_count, 90), percentile(depths, depth_count, 10), middle,
           percentile(depths, depth_count, 90),
           middle > 0 ? way / (run.frames - 1) / middle * 57.29578 : 0);
    fflush(stdout);
}

static void run_one(const char *uri, int start, int frames)
{
    struct fovea_frame frame;
    open_run(uri, start, frames);
    depth_count = inlier_count = 0;
    while (run.frames < frames && run.ops->dequeue(run.source, INT64_MAX, &frame) == FOVEA_OK) {
        one_frame(&frame);
        run.ops->requeue(run.source, &frame);
    }
    report(uri, start);
    run.ops->stop(run.source);
    run.ops->close(run.source);
    free(run.rt);
}

int main(int argc, char **argv)
{
    if (argc < 4 || atoi(argv[1]) < 2 || atoi(argv[1]) > FRAMES_MAX)
        die("usage: road FRAMES STARTS URI...");
    for (int i = 3; i < argc; i++)
        for (const char *at = argv[2]; at != NULL && *at != '\0';) {
            char *end;
            run_one(argv[i], (int)strtol(at, &end, 10), atoi(argv[1]));
            at = *end == ',' ? end + 1 : NULL;
        }
    return 0;
}

/* Closures in the simulated corridor, seed by seed, against the truth: how many runs close their
 * loop, whether any loop is false, and how far the poses are off after closing, as a fraction of
 * the path.
 *
 * Usage: closures SEEDS NEEDED OPTIONS [RECORD]     exit 0 when at least NEEDED runs made a
 * closure, none was false, and the map of every run that closed one is within 0.3 % of the path in
 * the end. OPTIONS go to sim:corridor, for example textures=repeated. RECORD: a file of the seeds
 * that are done, which are not run again. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "app/run/trajectory.h"
#include "fovea/fovea.h"
#include "drivers/table.h"
#include "fovea/source.h"
#include "geometry/vec.h"
#include "runtime/state.h"

enum { FRAMES_MAX = 4096 };
static const double fraction_max = 0.003, off_max_m = 0.5, turn_max_rad = 0.15;

struct run {
    struct fovea *rt;
    const struct fovea_source_ops *ops;
    struct fovea_source *source;
    struct fovea_camera camera;
    uint32_t frames, closed, false_ones, posed;
    int64_t stamp_ns[FRAMES_MAX];
    double truth[FRAMES_MAX][12];
    double path_m;
};

_Noreturn static void die(const char *what)
{
    fprintf(stderr, "%s\n", what);
    exit(2);
}

static const double *truth_at(const struct run *run, int64_t stamp_ns)
{
    for (uint32_t i = 0; i < run->frames; i++)
        if (run->stamp_ns[i] == stamp_ns) return run->truth[i];
    return NULL;
}

/* Similarity from the map to the truth, over its keyframes. */
static double map_fit(const struct run *run, double *scale)
{
    const struct fv_map *map = &run->rt->odometry.map;
    struct fv_similarity_sums sums = {0};
    for (uint32_t k = 0; k < map->limits.keyframes; k++) {
        const double *truth =
            map->keyframes[k].used ? truth_at(run, map->keyframes[k].stamp_ns) : NULL;
        if (truth == NULL) continue;
        const double origin[3] = {0, 0, 0}, q[3] = {truth[3], truth[7], truth[11]};
        double p[3];
        fv_se3_apply_inverse(&map->keyframes[k].T_cam_world, origin, p);
        fv_similarity_add(&sums, p, q);
    }
    double R[9], t[3], rms = NAN;
    if (!fv_similarity_fit(&sums, scale, R, t, &rms)) *scale = NAN;
    return rms;
}

/* Hold the similarity that a closure was made on against the true poses of its keyframes. */
static bool is_false(const struct run *run)
{
    const struct fv_closure_state *s = run->rt->odometry.closure.state;
    const struct fv_map *map = &run->rt->odometry.map;
    const struct fv_keyframe *k = &map->keyframes[s->keyframe.slot],
                             *c = &map->keyframes[s->candidates[s->candidate].slot];
    const double *at_k = truth_at(run, k->stamp_ns), *at_c = truth_at(run, c->stamp_ns);
    if (at_k == NULL || at_c == NULL) return true;
    struct fv_se3 T_world_k, T_world_c, T_k_world, T_k_c;
    fv_se3_from_rows(at_k, &T_world_k);
    fv_se3_from_rows(at_c, &T_world_c);
    fv_se3_invert(&T_world_k, &T_k_world);
    fv_se3_compose(&T_k_world, &T_world_c, &T_k_c);
    double scale, off[3], rotation[3], R[9], transposed[9];
    (void)map_fit(run, &scale);
    for (int i = 0; i < 3; i++)
        off[i] = T_k_c.t[i] - scale * s->S_keyframe_candidate.t[i];
    for (int r = 0; r < 3; r++)
        for (int q = 0; q < 3; q++)
            transposed[3 * r + q] = T_k_c.R[3 * q + r];
    fv_multiply33(s->S_keyframe_candidate.R, transposed, R);
    fv_so3_log(R, rotation);
    printf(
        "    frame %u: keyframe %llu on %llu, off %.3f m, %.3f rad, scale %.4f, %u of %u found\n",
        run->frames, (unsigned long long)k->number, (unsigned long long)c->number, fv_norm3(off),
        fv_norm3(rotation), s->correction.s, s->found, s->visible);
    return !(fv_norm3(off) < off_max_m && fv_norm3(rotation) < turn_max_rad);
}

static void open_run(struct run *run, const char *uri)
{
    struct fovea_error error;
    const char *address;
    const struct fovea_source_selection all = {.step = 1, .frames = FRAMES_MAX};
    memset(run, 0, sizeof *run);
    if (fv_source_find(uri, &run->ops, &address, &error) ||
        run->ops->open(address, &all, &run->source, &error) || run->ops->start(run->source, &error))
        die(error.text);
    struct fovea_config config;
    fovea_config_default(&config);
    config.rig.cameras[0].camera = run->ops->info(run->source)->rig.cameras[0].camera;
    config.preview.period_frames = 0;
    size_t bytes;
    if (fovea_camera_prepare(&config.rig.cameras[0].camera, &error) ||
        fovea_size(&config, &bytes, &error))
        die(error.text);
    void *memory = aligned_alloc(FOVEA_BLOCK_ALIGNMENT, (bytes + 4095) / 4096 * 4096);
    if (memory == NULL || fovea_init(memory, bytes, &config, &run->rt, &error)) die(error.text);
}

static void one_frame(struct run *run, const struct fovea_frame *frame)
{
    const struct fv_closure_counts *counts = &run->rt->odometry.closure.state->counts;
    struct fovea_inputs inputs = {.frame = frame, .now_ns = frame->stamp_ns, .temperature_c = NAN};
    struct fovea_outputs outputs;
    struct fovea_config config;
    fovea_config_default(&config);
    fovea_grants_fixed(&config, &inputs.grants);
    run->stamp_ns[run->frames] = frame->stamp_ns;
    if (run->ops->truth_pose(run->source, frame, run->truth[run->frames]) != FOVEA_OK)
        die("no truth");
    if (run->frames > 0) {
        const double *a = run->truth[run->frames - 1], *b = run->truth[run->frames];
        const double d[3] = {b[3] - a[3], b[7] - a[7], b[11] - a[11]};
        run->path_m += fv_norm3(d);
    }
    run->frames++;
    (void)fovea_step(run->rt, &inputs, &outputs);
    struct fovea_pose pose;
    fovea_pose_get(run->rt, &pose);
    run->posed += pose.posed;
    uint32_t before = counts->closed + counts->merged;
    (void)fovea_work(run->rt, &inputs.grants, &outputs);
    if (counts->closed + counts->merged > before) {
        run->closed++;
        run->false_ones += is_false(run);
    }
}

struct verdict {
    bool done;
    unsigned closed, wrong; /* closures; false ones among them */
    double fraction;        /* of the path, that the map is off in the end */
};

static void run_seed(unsigned seed, const char *options, struct verdict *verdict)
{
    static struct run run;
    char uri[256];
    (void)snprintf(uri, sizeof uri, "sim:corridor?seed=%u%s%s", seed, options[0] ? "&" : "",
                   options);
    open_run(&run, uri);
    struct fovea_frame frame;
    while (run.frames < FRAMES_MAX && run.ops->dequeue(run.source, INT64_MAX, &frame) == FOVEA_OK) {
        one_frame(&run, &frame);
        run.ops->requeue(run.source, &frame);
    }
    double scale;
    *verdict =
        (struct verdict){true, run.closed, run.false_ones, map_fit(&run, &scale) / run.path_m};
    const struct fv_closure_counts *c = &run.rt->odometry.closure.state->counts;
    printf(
        "seed %u: %u of %u posed, loops %u (false %u), map off %.4f %% of %.1f m; offered %u tried %u sampled %u confirmed %u implausible %u fused %u\n",
        seed, run.posed, run.frames, run.closed, run.false_ones, 100 * verdict->fraction,
        run.path_m, c->offered, c->tried, c->sampled, c->confirmed, c->implausible, c->fused);
    fflush(stdout);
    run.ops->stop(run.source);
    run.ops->close(run.source);
    free(run.rt);
}

enum { SEEDS_MAX = 1000 };
static struct verdict verdicts[SEEDS_MAX + 1];

static void read_record(const char *path)
{
    FILE *file = fopen(path, "r");
    unsigned seed;
    struct verdict verdict = {.done = true};
    while (file != NULL && fscanf(file, "%u %u %u %lf\n", &seed, &verdict.closed, &verdict.wrong,
                                  &verdict.fraction) == 4)
        if (seed <= SEEDS_MAX) verdicts[seed] = verdict;
    if (file != NULL) fclose(file);
}

static void write_record(const char *path, unsigned seed)
{
    FILE *file = fopen(path, "a");
    if (file == NULL) die("the record cannot be written");
    fprintf(file, "%u %u %u %.9f\n", seed, verdicts[seed].closed, verdicts[seed].wrong,
            verdicts[seed].fraction);
    fclose(file);
}

int main(int argc, char **argv)
{
    if (argc < 4 || atoi(argv[1]) > SEEDS_MAX) die("usage: closures SEEDS NEEDED OPTIONS [RECORD]");
    const unsigned seeds = (unsigned)atoi(argv[1]), needed = (unsigned)atoi(argv[2]);
    unsigned found = 0, wrong = 0, far = 0;
    if (argc > 4) read_record(argv[4]);
    for (unsigned seed = 1; seed <= seeds; seed++) {
        struct verdict *verdict = &verdicts[seed];
        if (!verdict->done) {
            run_seed(seed, argv[3], verdict);
            if (argc > 4) write_record(argv[4], seed);
        }
        found += verdict->closed > 0;
        wrong += verdict->wrong;
        far += verdict->closed > 0 && !(verdict->fraction <= fraction_max);
    }
    printf(
        "%u of %u runs closed their loop (%u needed), %u loops false, %u maps off by more than %.1f %%\n",
        found, seeds, needed, wrong, far, 100 * fraction_max);
    return found >= needed && wrong == 0 && far == 0 ? 0 : 1;
}

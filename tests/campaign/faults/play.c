#include "play.h"

#include <dirent.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "app/config/model_file.h"
#include "app/run/loop.h"
#include "common/detector.h"
#include "drivers/table.h"
#include "geometry/se3.h"

enum { TRUTHS_MAX = 4096 };

/* The body, whose z = 0 is the floor of the grid: the camera looks ahead, 0.8 m over it. */
static const double T_body_cam[12] = {0, 0, 1, 0, -1, 0, 0, 0, 0, -1, 0, 0.8};

struct player {
    struct faults_play *play;
    const struct fovea_source_ops *ops;
    struct fovea_source *source;
    struct fovea *rt;
    struct fovea_config config;
    uint32_t truths; /* of the twin */
    double (*truth)[12];
    struct faults_frame *now; /* of this iteration; NULL: nothing was given */
    struct fovea_sample samples[FOVEA_INPUT_SAMPLES_MAX];
};

void faults_die(const char *what)
{
    fprintf(stderr, "faults: %s\n", what);
    exit(2);
}

static int descriptors(void)
{
    int count = 0;
    DIR *folder = opendir("/proc/self/fd");
    if (folder == NULL) faults_die("/proc/self/fd cannot be read");
    while (readdir(folder) != NULL)
        count++;
    closedir(folder);
    return count;
}

static void open_source(const char *uri, uint64_t start, uint64_t frames,
                        const struct fovea_source_ops **ops, struct fovea_source **source)
{
    struct fovea_error error;
    const char *address;
    const struct fovea_source_selection selection = {.start = start, .step = 1, .frames = frames};
    if (fv_source_find(uri, ops, &address, &error) ||
        (*ops)->open(address, &selection, source, &error) || (*ops)->start(*source, &error))
        faults_die(error.text);
}

/* ---- truth of a recording -------------------------------------------------------------------- */

static void take_truths(struct player *player, const char *twin)
{
    const struct fovea_source_ops *ops;
    struct fovea_source *source;
    struct fovea_frame frame;
    player->truth = calloc(TRUTHS_MAX, sizeof *player->truth);
    if (player->truth == NULL) faults_die("no memory");
    open_source(twin, 0, 0, &ops, &source);
    while (player->truths < TRUTHS_MAX && ops->dequeue(source, INT64_MAX, &frame) == FOVEA_OK) {
        if (frame.sequence != player->truths ||
            ops->truth_pose(source, &frame, player->truth[player->truths++]))
            faults_die("a frame without truth");
        ops->requeue(source, &frame);
    }
    ops->stop(source);
    ops->close(source);
}

static void note_truth(const struct player *player, const struct fovea_frame *given,
                       struct faults_frame *frame)
{
    if (player->truth == NULL) {
        frame->has_truth = player->ops->truth_pose != NULL &&
                           player->ops->truth_pose(player->source, given, frame->truth) == FOVEA_OK;
    } else if (given->sequence < player->truths) {
        memcpy(frame->truth, player->truth[given->sequence], sizeof frame->truth);
        frame->has_truth = true;
    }
}

/* ---- the loop -------------------------------------------------------------------------------- */

/* The simulation's wheel odometry is the motion of the camera; the body's is B motion B^-1. */
static void to_body(struct fovea_wheel_odometry_sample *sample)
{
    struct fv_se3 B, back, T;
    fv_se3_from_rows(T_body_cam, &B);
    fv_se3_invert(&B, &back);
    fv_so3_from_quaternion(sample->orientation, T.R);
    memcpy(T.t, sample->position_m, sizeof T.t);
    fv_se3_compose(&B, &T, &T);
    fv_se3_compose(&T, &back, &T);
    memcpy(sample->position_m, T.t, sizeof T.t);
    fv_so3_to_quaternion(T.R, sample->orientation);
}

static void sense(void *context, const struct fovea_frame *given, struct fovea_inputs *inputs)
{
    struct player *player = context;
    struct faults_play *play = player->play;
    player->now = NULL;
    if (given == NULL || play->count == FAULTS_GIVEN_MAX) return;
    player->now = &play->frame[play->count++];
    *player->now = (struct faults_frame){
        .index = given->index, .stamp_ns = given->stamp_ns, .image = inputs->frame != NULL};
    note_truth(player, given, player->now);
    inputs->samples = player->samples;
    const uint32_t wheel_odometry = 1u << FOVEA_SAMPLE_WHEEL_ODOMETRY,
                   kinds = player->ops->info(player->source)->sample_kinds;
    if (player->ops->samples != NULL && (kinds & (play->wheels ? kinds : ~wheel_odometry)) != 0)
        inputs->sample_count =
            player->ops->samples(player->source, given, player->samples, FOVEA_INPUT_SAMPLES_MAX);
    for (uint32_t i = 0; i < inputs->sample_count && !play->alone; i++)
        if (player->samples[i].kind == FOVEA_SAMPLE_WHEEL_ODOMETRY)
            to_body(&player->samples[i].wheel_odometry);
}

static void step_done(void *context, const struct fovea_inputs *inputs,
                      const struct fovea_outputs *outputs, const struct fovea_pose *pose)
{
    struct player *player = context;
    (void)inputs;
    player->play->messages += outputs->message_count;
    if (player->now == NULL || pose == NULL) return;
    player->now->processed = true;
    player->now->pose = *pose;
}

static void work_done(void *context, const struct fovea_inputs *inputs,
                      const struct fovea_grants *grants, const struct fovea_outputs *outputs)
{
    struct player *player = context;
    (void)inputs;
    (void)grants;
    player->play->messages += outputs->message_count;
    for (uint32_t i = 0; i < outputs->message_count; i++)
        player->play->grids += strcmp(outputs->messages[i].channel, "FOVEA_GRID") == 0;
}

/* ---- set-up ---------------------------------------------------------------------------------- */

static void whole_runtime(struct fovea_config *config, const struct fv_model_file *shipped)
{
    config->detect.model = shipped->data;
    config->detect.model_bytes = shipped->bytes;
    config->objects.movable[0] = ~0u;
    config->detect2.model = detector_as_segmenter(&config->detect2.model_bytes);
    if (config->detect2.model == NULL) faults_die("tests/golden/detector.fvm cannot be read");
    config->detect2.period_frames = 3;
    config->grid_job.enabled = true;
    memset(config->grid_job.labels, FOVEA_GRID_FLOOR, sizeof config->grid_job.labels);
    config->grid_job.labels[1] = FOVEA_GRID_OBSTACLE;
    config->grid_job.labels[2] = FOVEA_GRID_MOVABLE;
    struct fv_se3 B, T;
    fv_se3_from_rows(T_body_cam, &B);
    for (uint32_t i = 0; i < config->rig.camera_count; i++) {
        if (i > 0 && !config->rig.cameras[i].has_T_body_cam) continue;
        fv_se3_from_rows(config->rig.cameras[i].T_body_cam, &T);
        fv_se3_compose(&B, &T, &T);
        fv_se3_to_rows(&T, config->rig.cameras[i].T_body_cam);
    }
    fv_se3_from_rows(config->rig.imu.T_body_imu, &T);
    fv_se3_compose(&B, &T, &T);
    fv_se3_to_rows(&T, config->rig.imu.T_body_imu);
}

static void set_up(struct player *player, const struct fv_model_file *shipped)
{
    const struct faults_play *play = player->play;
    struct fovea_config *config = &player->config;
    struct fovea_error error;
    size_t bytes;
    fovea_config_default(config);
    const struct fovea_rig_camera body = config->rig.cameras[0];
    config->rig = player->ops->info(player->source)->rig;
    if (!config->rig.cameras[0].has_T_body_cam) {
        memcpy(config->rig.cameras[0].T_body_cam, body.T_body_cam, sizeof body.T_body_cam);
        config->rig.cameras[0].has_T_body_cam = true;
    }
    if (play->wheels) config->scale.source = FOVEA_SCALE_WHEEL_ODOMETRY;
    config->odometry.localise_only = play->localise_only;
    config->map = play->map;
    config->map_bytes = play->map_bytes;
    config->map_name = "the saved map";
    if (!play->alone) whole_runtime(config, shipped);
    if (fovea_size(config, &bytes, &error)) faults_die(error.text);
    void *memory = aligned_alloc(FOVEA_BLOCK_ALIGNMENT, (bytes + 4095) / 4096 * 4096);
    if (memory == NULL || fovea_init(memory, bytes, config, &player->rt, &error))
        faults_die(error.text);
}

static void save(struct player *player)
{
    struct faults_play *play = player->play;
    const size_t most = fovea_map_bytes_max(&player->config);
    play->saved = malloc(most);
    if (play->saved == NULL) faults_die("no memory");
    play->saved_bytes = fovea_map_save(player->rt, play->saved, most);
}

static void loop(struct player *player)
{
    static struct fv_timings timings;
    static struct fv_loop_shared shared;
    struct faults_play *play = player->play;
    fv_timings_init(&timings);
    atomic_store(&shared.temperature_c, NAN);
    struct fv_loop loop = {.rt = player->rt,
                           .config = &player->config,
                           .ops = player->ops,
                           .source = player->source,
                           .frames_max = 2 * play->frames + 10, /* `duplicate` gives all twice */
                           .hooks = {.context = player,
                                     .sense = sense,
                                     .step_done = step_done,
                                     .work_done = work_done},
                           .timings = &timings,
                           .shared = &shared};
    fv_loop_run(&loop);
    play->heap_calls = loop.heap_calls;
    play->endless = loop.status == FOVEA_OK;
    if (loop.status < 0) faults_die("the source failed");
}

void faults_play(struct faults_play *play)
{
    static struct player player;
    struct fv_model_file shipped = {.data = NULL};
    struct fovea_error error;
    struct fovea_detections detections;
    struct fovea_segmentation mask;
    memset(&player, 0, sizeof player);
    player.play = play;
    const int before = descriptors();
    if (play->twin != NULL && play->twin[0] != '\0') take_truths(&player, play->twin);
    open_source(play->uri, play->start, play->frames, &player.ops, &player.source);
    if (!play->alone && fv_model_file_read("src/detect/shipped.fvm", &shipped, &error))
        faults_die(error.text);
    set_up(&player, &shipped);
    loop(&player);
    fovea_detections_get(player.rt, &detections);
    fovea_segmentation_get(player.rt, 1, &mask);
    play->detections = detections.inferences;
    play->masks = mask.inferences;
    play->hash = fovea_state_hash(player.rt);
    save(&player);
    player.ops->stop(player.source);
    player.ops->close(player.source);
    free(player.rt);
    free(player.truth);
    fv_model_file_free(&shipped);
    play->descriptors = descriptors() - before;
}

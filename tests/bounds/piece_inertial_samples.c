/* Of an inertial sensor's samples in the step, and of the frames that they lead to. */
#include <string.h>

#include "bounds/counter.h"
#include "bounds/full_map.h"
#include "bounds/inertial_case.h"
#include "bounds/pieces.h"
#include "odometry/rolling.h"
#include "runtime/encode_pose.h"

enum { SAMPLES = FOVEA_INPUT_SAMPLES_MAX, STATIONS = FV_INERTIAL_STATIONS_MAX };

struct sampling {
    struct fovea *rt;
    struct fovea_sample samples[SAMPLES];
    int64_t now_ns;
    struct fv_motion_hint hint;
    struct fv_sense_anchor anchor;
    struct fovea_outputs outputs;
    struct fovea_feature placed[FOVEA_FEATURES_MAX];
    struct fv_odometry_input input;
};

/* Samples that follow each other from `first_ms` on. */
static void make(struct sampling *w, int64_t first_ms)
{
    for (int i = 0; i < SAMPLES; i++) {
        w->samples[i] = (struct fovea_sample){.kind = FOVEA_SAMPLE_IMU};
        inertial_case_sample(first_ms + i, &w->samples[i].imu);
    }
    w->now_ns = (first_ms + SAMPLES) * 1000000;
}

/* ---- the gate -------------------------------------------------------------------------------- */

static void judge(void *context)
{
    struct sampling *w = context;
    fv_imu_gate_step(&w->rt->imu, w->samples, SAMPLES, w->now_ns);
}

/* Ever larger on all axes; with every other one missing; all the same; out of order; ahead. */
static void of_gate(struct sampling *w)
{
    enum { WAYS = 5, TIMES = 3 };
    struct fv_imu_gate_state *state = w->rt->imu.state;
    for (int way = 0; way < WAYS; way++) {
        memset(state, 0, sizeof *state);
        for (int time = 0; time < TIMES; time++) {
            make(w, 1000 + time * 2 * SAMPLES);
            for (int i = 0; i < SAMPLES; i++) {
                struct fovea_imu_sample *s = &w->samples[i].imu;
                const double size = 20 + (way == 2 ? 0 : time * SAMPLES + i);
                if (way == 1) s->stamp_ns += i * INT64_C(1000000);
                if (way == 3 && time > 0) s->stamp_ns -= 600 * INT64_C(1000000);
                if (way == 4 && i % 2 == 1) s->stamp_ns += 900 * INT64_C(1000000);
                for (int k = 0; k < 3; k++)
                    s->gyro[k] = s->acceleration[k] = size;
            }
            NOTE(imu_judged, judge, w, SAMPLES);
        }
    }
}

/* ---- samples that passed --------------------------------------------------------------------- */

static void observe(void *context)
{
    struct sampling *w = context;
    fv_inertial_stage_observe(&w->rt->inertial, &w->rt->imu);
}

/* As the gate leaves them. */
static void pass(struct sampling *w, int64_t first_ms, uint32_t notes)
{
    make(w, first_ms);
    w->rt->imu.count = SAMPLES;
    for (int i = 0; i < SAMPLES; i++)
        w->rt->imu.clean[i] = (struct fv_imu_clean){.sample = w->samples[i].imu, .notes = notes};
}

static void begin_clock(struct fv_imu_clock *clock, int64_t reached_ns, double mount_sigma)
{
    fv_imu_clock_init(clock, mount_sigma);
    clock->begun = 1;
    clock->reached_ns = reached_ns;
    clock->attitude[0] = clock->attitude[4] = clock->attitude[8] = 1;
    clock->turn[0] = clock->turn[4] = clock->turn[8] = 1;
}

/* All that wait are as many as may, so that each that comes has the oldest used: by both clocks and
 * by the filter of frames. The last station's samples, and those of the one before, are open. */
static void fill(struct sampling *w, int64_t first_ms)
{
    struct fv_inertial_stage *stage = &w->rt->inertial;
    const int64_t begin_ns = (first_ms - 1) * 1000000;
    memset(&stage->state->live, 0, sizeof stage->state->live);
    stage->clock->moved_ns = 0;
    begin_clock(&stage->clock->found, begin_ns, 0);
    begin_clock(&stage->clock->mounted, begin_ns, 0.1);
    stage->state->live.begun = true;
    stage->state->live.pose_ns = stage->state->live.reached_ns = begin_ns;
    fv_se3_identity(&stage->state->live.T_world_imu);
    fv_preintegration_begin(&stage->state->live.sum, &stage->state->known.biases);
    pass(w, first_ms, 0);
    observe(w);
    MUST(stage->clock->found.sample_count == FV_IMU_CLOCK_SAMPLES_MAX);
    MUST(stage->state->live.ahead_count == FV_INERTIAL_AHEAD_MAX);
}

static void of_samples(struct sampling *w)
{
    const int64_t last_ms = (STATIONS - 1) * INERTIAL_CASE_STATION_MS;
    for (int notes = 0; notes < 2; notes++) {
        inertial_case_fill(w->rt, STATIONS);
        fill(w, last_ms + 1);
        fv_inertial_station_at(&w->rt->inertial.estimator, STATIONS - 2)->closed = false;
        fv_inertial_station_at(&w->rt->inertial.estimator, STATIONS - 2)->sample_count = 0;
        fv_inertial_station_at(&w->rt->inertial.estimator, STATIONS - 1)->sample_count = 0;
        pass(w, last_ms + 1 + SAMPLES, notes == 0 ? 0 : FV_IMU_AFTER_JUMP);
        NOTE(imu_observed, observe, w, SAMPLES);
    }
}

/* ---- frames ---------------------------------------------------------------------------------- */

static void predict(void *context)
{
    struct sampling *w = context;
    double rate[3];
    fv_inertial_stage_predict(&w->rt->inertial, &w->rt->odometry, w->now_ns, &w->hint);
    (void)fv_inertial_stage_rate(&w->rt->inertial, w->now_ns, rate);
}

static void follow(void *context)
{
    struct sampling *w = context;
    fv_inertial_stage_step(&w->rt->inertial, &w->rt->odometry, w->now_ns);
}

/* Eight frames wait for samples. */
static void wait_frames(struct fv_imu_clock *clock, int64_t first_ns, int64_t apart_ns)
{
    clock->frame_count = FV_IMU_CLOCK_FRAMES_MAX - 1;
    for (int64_t i = 0; i < FV_IMU_CLOCK_FRAMES_MAX - 1; i++) {
        struct fv_imu_clock_frame *frame = &clock->waiting[i];
        struct fv_se3 T;
        memset(frame, 0, sizeof *frame);
        frame->stamp_ns = first_ns + i * apart_ns;
        inertial_case_pose(frame->stamp_ns / 1000000, &T);
        memcpy(frame->R, T.R, sizeof frame->R);
        for (int k = 0; k < 3; k++)
            frame->covariance[4 * k] = 10; /* whatever it shows fits */
    }
    clock->first_frame = 0;
}

static void posed(struct sampling *w, bool is)
{
    struct fovea *rt = w->rt;
    struct fovea_pose *pose = &rt->odometry.state->pose;
    struct fv_se3 T;
    inertial_case_pose(w->now_ns / 1000000, &T);
    memset(pose, 0, sizeof *pose);
    fv_se3_to_rows(&T, pose->T_world_cam);
    for (int i = 0; i < 12; i++)
        pose->T_map_world[i] = pose->T_keyframe_cam[i] = i % 5 == 0;
    pose->map_scale = pose->scale = 1;
    pose->posed = is;
    pose->state = is ? FOVEA_TRACKING_OK : FOVEA_TRACKING_LOST;
    for (int i = 0; i < 21; i++)
        pose->covariance[i] = i == 0 || i == 6 || i == 11     ? 1e-4
                              : i == 15 || i == 18 || i == 20 ? 10
                                                              : 0;
    rt->odometry.state->state = pose->state;
    rt->inertial.state->begun = true;
    rt->inertial.state->map = pose->map_id;
    rt->inertial.state->reset_counter = fv_odometry_reset_counter(&rt->odometry);
}

/* Samples and frames have waited, as many as may; the frame is later than all. */
static void wait_all(struct sampling *w)
{
    const int64_t first_ms = (STATIONS - 1) * INERTIAL_CASE_STATION_MS + 1;
    struct fv_inertial_stage *stage = &w->rt->inertial;
    inertial_case_fill(w->rt, STATIONS);
    fill(w, first_ms);
    inertial_case_claim(w->rt);
    w->now_ns = (first_ms + SAMPLES - 2) * 1000000;
    stage->state->live.pose_ns = stage->state->live.reached_ns = w->now_ns - 129 * 1000000;
    stage->state->live.broken = false;
    stage->state->station_ns = 0;
    wait_frames(&stage->clock->found, first_ms * 1000000 + 20000000, 30000000);
    wait_frames(&stage->clock->mounted, first_ms * 1000000 + 20000000, 30000000);
}

/* A station's samples are as many as may, and go to the next one too. */
static void fill_station(struct sampling *w)
{
    const struct fv_inertial *inertial = &w->rt->inertial.estimator;
    const uint32_t newest = inertial->state->count - 1,
                   slot = (inertial->state->first + newest) % FV_INERTIAL_STATIONS_MAX;
    struct fv_inertial_sample *list = inertial->samples + (size_t)slot * FV_INERTIAL_SAMPLES_MAX;
    struct fv_inertial_station *station = fv_inertial_station_at(inertial, newest);
    station->cut = false;
    station->sample_count = FV_INERTIAL_SAMPLES_MAX;
    fv_inertial_station_at(inertial, newest - 1)->closed = false;
    for (int32_t i = 0; i < FV_INERTIAL_SAMPLES_MAX; i++)
        list[i].after_ns = (i + 1) * 700000;
}

static void of_frames(struct sampling *w)
{
    wait_all(w);
    posed(w, true);
    NOTE(motion_predicted, predict, w, 1);
    MUST(w->hint.whole);
    wait_all(w);
    posed(w, true);
    fill_station(w);
    NOTE(inertial_posed, follow, w, 1);
    MUST(w->rt->inertial.clock->found.frames == FV_IMU_CLOCK_FRAMES_MAX);
    MUST(w->rt->inertial.clock->mounted.frames == FV_IMU_CLOCK_FRAMES_MAX);
    MUST(w->rt->inertial.state->station_ns == w->now_ns && w->rt->inertial.state->known.moving);
    wait_all(w);
    posed(w, true);
    w->rt->inertial.state->map = 77; /* another map than that of the pose */
    NOTE(inertial_entered, follow, w, 1);
    MUST(w->rt->inertial.estimator.state->count == 1);
    wait_all(w);
    posed(w, false);
    w->rt->inertial.state->still.standing = true;
    NOTE(inertial_coasted, follow, w, 1);
    MUST(w->rt->inertial.state->known.coasting);
}

static void place(void *context)
{
    struct sampling *w = context;
    const struct fv_rolling rolling = {.readout_s = 0.03, .rate = {3, 2, 1}};
    fv_odometry_place(&w->rt->odometry, &rolling, &w->input, w->placed);
}

/* Features of a rolling shutter, each with a distance of its own. */
static void of_placing(struct sampling *w)
{
    static struct fovea_feature features[FOVEA_FEATURES_MAX];
    static struct fv_inverse_distance distances[FOVEA_FEATURES_MAX];
    struct fv_odometry *o = &w->rt->odometry;
    const uint32_t count = o->map.limits.features;
    full_map_fill(o, FV_MAP_OBSERVERS_MAX);
    for (uint32_t i = 0; i < count; i++) {
        features[i].x_px = (float)(i * 37 % (uint32_t)o->camera.width);
        features[i].y_px = (float)(i * 53 % (uint32_t)o->camera.height);
        distances[i] = (struct fv_inverse_distance){.value = 0.5f, .weight = 1e4f};
    }
    o->state->state = FOVEA_TRACKING_OK;
    o->state->localise.motion.known = true;
    w->input = (struct fv_odometry_input){.stamp_ns = 1,
                                          .count = count,
                                          .features = features,
                                          .distances = distances,
                                          .hint = {.turn = true, .whole = true}};
    w->input.hint.T_now_last.t[0] = 0.1;
    NOTE(feature_placed, place, w, count);
}

/* ---- the pose at the rate of the samples ----------------------------------------------------- */

/* As fovea.c does after a frame. */
static void offer(void *context)
{
    struct sampling *w = context;
    const struct fv_publish *publish = &w->rt->publish;
    const struct fv_rates *rates = fv_publish_rates(publish, FV_PUBLISH_BODY);
    w->anchor.T_odom_body = fv_publish_child_pose(publish, FV_PUBLISH_BODY);
    memcpy(w->anchor.velocity, rates->velocity, sizeof w->anchor.velocity);
    fv_publish_turn(publish, w->rt->inertial.state->known.gravity, w->anchor.gravity);
    fv_sense_offer(w->rt->sense, &w->anchor);
}

static void sense(void *context)
{
    struct sampling *w = context;
    MUST(fovea_sense(w->rt, w->samples, SAMPLES, &w->outputs) == FOVEA_OK);
}

static void encode(void *context)
{
    struct sampling *w = context;
    struct fv_sense_pose pose;
    memset(&pose, 0, sizeof pose);
    fv_se3_identity(&pose.T_odom_body);
    memset(&w->outputs, 0, sizeof w->outputs);
    fv_encode_fast_pose(w->rt, &pose, &w->outputs);
}

/* All samples that are kept are later than the pose that was offered. */
static void of_sensing(struct sampling *w)
{
    const int64_t begin_ms = 5000;
    memset(&w->anchor, 0, sizeof w->anchor);
    w->anchor.posed = true;
    fv_se3_identity(&w->anchor.T_odom_body);
    w->anchor.frame.stamp_ns = begin_ms * 1000000;
    make(w, begin_ms + 1);
    NOTE(sense_offered, offer, w, 1);
    sense(w);
    MUST(w->rt->sense->count == FV_SENSE_KEPT);
    make(w, begin_ms + 1 + SAMPLES);
    const double taken = (double)counter_of(sense, w);
    w->anchor.frame.stamp_ns = (begin_ms + SAMPLES) * 1000000; /* before all that are kept */
    offer(w);
    make(w, begin_ms + 1 + 2 * SAMPLES);
    const double again = (double)counter_of(sense, w);
    piece_note(PIECE_sense_taken, taken / SAMPLES);
    piece_note(PIECE_sense_carried, (again - taken) / FV_SENSE_KEPT);
    NOTE(sense_sent, encode, w, 1);
}

void pieces_of_inertial_samples(struct fovea *rt)
{
    static struct sampling w;
    w.rt = rt;
    full_map_fill(&rt->odometry, FV_MAP_OBSERVERS_MAX);
    of_gate(&w);
    of_samples(&w);
    of_frames(&w);
    of_placing(&w);
    of_sensing(&w);
}

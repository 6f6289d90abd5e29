#include "common/sim_rig.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <stdlib.h>
#include <string.h>

#include "app/run/trajectory.h"
#include "common/kept_source.h"
#include "drivers/table.h"

static void open_source(struct sim_rig *rig, const struct fovea_source_ops *ops,
                        const char *address, int start, int frames)
{
    struct fovea_error error;
    const struct fovea_source_selection selection = {
        .start = (uint64_t)start, .step = 1, .frames = (uint64_t)frames};
    /* Of poses and truth, 6 MB, what a run can fill. */
    const size_t most =
        frames > 0 && frames < SIM_RIG_FRAMES_MAX ? (size_t)frames : SIM_RIG_FRAMES_MAX;
    memset(rig, 0, offsetof(struct sim_rig, pose));
    memset(rig->pose, 0, most * sizeof *rig->pose);
    memset(rig->truth, 0, most * sizeof *rig->truth);
    rig->ops = ops;
    if (frames > SIM_RIG_FRAMES_MAX ||
        ops->open(address, &selection, &rig->source, &error) != FOVEA_OK ||
        ops->start(rig->source, &error) != FOVEA_OK)
        fail_msg("%s", error.text);
    fovea_config_default(&rig->config);
    rig->config.rig.cameras[0].camera = ops->info(rig->source)->rig.cameras[0].camera;
}

void sim_rig_open(struct sim_rig *rig, const char *uri, int start, int frames)
{
    const char *address;
    const struct fovea_source_ops *ops;
    struct fovea_error error;
    if (fv_source_find(uri, &ops, &address, &error) != FOVEA_OK) fail_msg("%s", error.text);
    open_source(rig, ops, address, start, frames);
}

void sim_rig_open_kept(struct sim_rig *rig, const char *uri, int start, int frames)
{
    assert_int_equal(strncmp(uri, "sim:", 4), 0);
    open_source(rig, &kept_sim, uri + 4, start, frames);
}

void sim_rig_build(struct sim_rig *rig)
{
    size_t bytes;
    struct fovea_error error;
    if (fovea_size(&rig->config, &bytes, &error)) fail_msg("%s", error.text);
    void *memory = aligned_alloc(FOVEA_BLOCK_ALIGNMENT, (bytes + 63) / 64 * 64);
    if (fovea_init(memory, bytes, &rig->config, &rig->rt, &error)) fail_msg("%s", error.text);
}

bool sim_rig_next(struct sim_rig *rig)
{
    memset(&rig->inputs, 0, sizeof rig->inputs);
    if (rig->ops->dequeue(rig->source, INT64_MAX, &rig->frame) != FOVEA_OK) return false;
    rig->inputs.frame = &rig->frame;
    rig->inputs.now_ns = rig->frame.stamp_ns;
    fovea_grants_fixed(&rig->config, &rig->inputs.grants);
    assert_int_equal(rig->ops->truth_pose(rig->source, &rig->frame, rig->truth[rig->frames]),
                     FOVEA_OK);
    return true;
}

void sim_rig_take_samples(struct sim_rig *rig)
{
    rig->inputs.samples = rig->samples;
    rig->inputs.sample_count =
        rig->ops->samples(rig->source, &rig->frame, rig->samples, FOVEA_INPUT_SAMPLES_MAX);
}

void sim_rig_process(struct sim_rig *rig)
{
    (void)fovea_step(rig->rt, &rig->inputs, &rig->outputs);
    fovea_pose_get(rig->rt, &rig->pose[rig->frames++]);
    rig->ops->requeue(rig->source, &rig->frame);
    (void)fovea_work(rig->rt, &rig->inputs.grants, &rig->work);
}

void sim_rig_close(struct sim_rig *rig)
{
    rig->ops->stop(rig->source);
    rig->ops->close(rig->source);
    free(rig->rt);
}

double sim_rig_moved(const double a[12], const double b[12])
{
    double sum = 0;
    for (int i = 3; i < 12; i += 4)
        sum += (a[i] - b[i]) * (a[i] - b[i]);
    return __builtin_sqrt(sum);
}

double sim_rig_scale(const struct sim_rig *rig, int from, int to)
{
    double published = 0, real = 0;
    for (int n = from; n + 15 < to; n += 15) {
        assert_true(rig->pose[n].posed && rig->pose[n + 15].posed);
        published += sim_rig_moved(rig->pose[n].T_world_cam, rig->pose[n + 15].T_world_cam);
        real += sim_rig_moved(rig->truth[n], rig->truth[n + 15]);
    }
    return published / real;
}

double sim_rig_path_error(const struct sim_rig *rig)
{
    struct fv_trajectory *trajectory;
    struct fv_trajectory_summary summary;
    struct fovea_error error;
    assert_int_equal(fv_trajectory_open(NULL, &trajectory, &error), FOVEA_OK);
    for (int n = 0; n < rig->frames; n++) {
        struct fv_trajectory_sample sample = {
            .stamp_ns = n, .map = rig->pose[n].map_id, .has_truth = true};
        if (!rig->pose[n].posed) continue;
        memcpy(sample.T_world_cam, rig->pose[n].T_world_cam, sizeof sample.T_world_cam);
        for (int i = 0; i < 3; i++)
            sample.truth_m[i] = rig->truth[n][4 * i + 3];
        while (!fv_trajectory_add(trajectory, &sample))
            fv_trajectory_drain(trajectory);
    }
    fv_trajectory_finish(trajectory, &summary);
    fv_trajectory_close(trajectory);
    assert_int_equal(summary.maps, 1);
    return summary.error_m / summary.truth_length_m;
}

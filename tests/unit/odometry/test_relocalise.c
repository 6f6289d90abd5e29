/* A camera that is carried off and comes back: lost while away, found within 15 frames of its
 * return, where it is. And a map saved on the way, in units beside the frames: another run finds
 * itself in it and leaves it as it is. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
/* cmocka needs the above */
#include <cmocka.h>

#include "drivers/table.h"
#include "fovea/fovea.h"

#include "fovea_map_t.h"

/* sim:kidnap leaves at 14 s, is back at 17 s, and then where it was at 5 s. */
enum {
    RATE = 20,
    BEGIN_S = 3,
    LEAVE = 11 * RATE,
    RETURN = 14 * RATE,
    SAME = 2 * RATE,
    FRAMES = RETURN + 24,
    SAVE = 180
};

struct world {
    const struct fovea_source_ops *ops;
    struct fovea_source *source;
    struct fovea_config config;
    void *memory;
    struct fovea *rt;
};

static void open_world(struct world *world, uint64_t start, const uint8_t *map, size_t map_bytes)
{
    const struct fovea_source_selection selection = {.start = start, .step = 1};
    const char *address;
    struct fovea_error error;
    size_t bytes;
    char uri[96];
    snprintf(uri, sizeof uri, "sim:kidnap?width=480&height=360&seed=3&objects=2&rate=%d&time=%d",
             RATE, BEGIN_S);
    memset(world, 0, sizeof *world);
    assert_int_equal(fv_source_find(uri, &world->ops, &address, &error), FOVEA_OK);
    assert_int_equal(world->ops->open(address, &selection, &world->source, &error), FOVEA_OK);
    assert_int_equal(world->ops->start(world->source, &error), FOVEA_OK);
    fovea_config_default(&world->config);
    world->config.rig.cameras[0].camera = world->ops->info(world->source)->rig.cameras[0].camera;
    world->config.preview.period_frames = 0;
    world->config.map_every = 1;
    world->config.map = map;
    world->config.map_bytes = map_bytes;
    world->config.odometry.localise_only = map != NULL;
    assert_int_equal(fovea_size(&world->config, &bytes, &error), FOVEA_OK);
    world->memory = aligned_alloc(FOVEA_BLOCK_ALIGNMENT, (bytes + 63) / 64 * 64);
    if (fovea_init(world->memory, bytes, &world->config, &world->rt, &error) != FOVEA_OK)
        fail_msg("%s", error.text);
}

static void close_world(struct world *world)
{
    world->ops->stop(world->source);
    world->ops->close(world->source);
    free(world->memory);
}

/* What a viewer knows from the pieces of the map so far. */
static struct {
    bool landmark[FOVEA_ODOMETRY_LANDMARKS_MAX], keyframe[FOVEA_ODOMETRY_KEYFRAMES_MAX];
    uint32_t pieces;
} viewer;

static void view(const struct fovea_outputs *outputs)
{
    for (uint32_t i = 0; i < outputs->message_count; i++) {
        const struct fovea_message *message = &outputs->messages[i];
        fovea_map_t piece;
        if (strcmp(message->channel, "FOVEA_MAP") != 0) continue;
        assert_true(message->bytes < 8192);
        assert_true(fovea_map_t_decode(message->data, 0, (int)message->bytes, &piece) > 0);
        assert_true(piece.landmark_first < piece.landmark_last &&
                    piece.landmark_last <= piece.landmark_slots);
        for (int32_t slot = piece.landmark_first; slot < piece.landmark_last; slot++)
            viewer.landmark[slot] = false;
        for (int32_t slot = piece.keyframe_first; slot < piece.keyframe_last; slot++)
            viewer.keyframe[slot] = false;
        for (int32_t k = 0; k < piece.landmark_count; k++)
            viewer.landmark[piece.landmark_slot[k]] = true;
        for (int32_t k = 0; k < piece.keyframe_count; k++)
            viewer.keyframe[piece.keyframes[k].slot] = true;
        viewer.pieces++;
        fovea_map_t_decode_cleanup(&piece);
    }
}

/* One iteration; bytes of a map that is complete after it, else 0. */
static size_t iterate(struct world *world, uint32_t commands, struct fovea_pose *pose)
{
    static struct fovea_inputs inputs;
    static struct fovea_outputs outputs;
    struct fovea_frame frame;
    assert_int_equal(world->ops->dequeue(world->source, INT64_MAX, &frame), FOVEA_OK);
    memset(&inputs, 0, sizeof inputs);
    inputs.frame = &frame;
    inputs.now_ns = frame.stamp_ns;
    inputs.commands = commands;
    fovea_grants_fixed(&world->config, &inputs.grants);
    assert_int_equal(fovea_step(world->rt, &inputs, &outputs), FOVEA_OK);
    fovea_pose_get(world->rt, pose);
    view(&outputs);
    (void)fovea_work(world->rt, &inputs.grants, &outputs);
    world->ops->requeue(world->source, &frame);
    return outputs.map_bytes;
}

static double apart(const struct fovea_pose *a, const struct fovea_pose *b)
{
    double square = 0;
    for (int i = 0; i < 3; i++)
        square += (a->T_world_cam[4 * i + 3] - b->T_world_cam[4 * i + 3]) *
                  (a->T_world_cam[4 * i + 3] - b->T_world_cam[4 * i + 3]);
    return __builtin_sqrt(square);
}

static struct fovea_pose poses[FRAMES];
static uint8_t *saved;
static size_t saved_bytes;

static void test_carried_off_and_back(void **state)
{
    (void)state;
    struct world world;
    int again = -1, away = 0, saving = 0;
    open_world(&world, 0, NULL, 0);
    const size_t capacity = fovea_map_bytes_max(&world.config);
    saved = malloc(capacity);
    for (int n = 0; n < FRAMES; n++) {
        if (n == SAVE) fovea_map_save_to(world.rt, saved, capacity);
        const size_t bytes = iterate(&world, n == SAVE ? FOVEA_COMMAND_SAVE : 0, &poses[n]);
        if (bytes > 0) saved_bytes = bytes;
        saving += n >= SAVE && saved_bytes == 0;
        away +=
            n >= LEAVE + 5 && n < RETURN && poses[n].posed && poses[n].map_id == poses[SAME].map_id;
        if (again < 0 && n >= RETURN && poses[n].posed && poses[n].map_id == poses[SAME].map_id)
            again = n - RETURN;
    }
    close_world(&world);
    assert_true(poses[SAME].posed && poses[LEAVE - 1].posed);
    assert_int_equal(away, 0);
    for (int n = 1, last = 0; n < FRAMES; n++) { /* another parent frame is another count */
        if (!poses[n].posed) continue;
        assert_true(poses[n].map_id == poses[last].map_id || !poses[last].posed ||
                    poses[n].reset_counter > poses[last].reset_counter);
        last = n;
    }
    assert_in_range(again, 0, 15);
    const double moved = apart(&poses[SAME], &poses[SAME + RATE]);
    const double off = apart(&poses[SAME + again + 5], &poses[RETURN + again + 5]);
    print_message("found again after %d frames, %.4f of a second's way off; saved in %d frames\n",
                  again, off / moved, saving + 1);
    assert_true(off < 0.1 * moved);
    assert_true(saved_bytes > 100000);
    assert_in_range(saving, 0, RATE);
}

static void test_found_in_a_saved_map(void **state)
{
    (void)state;
    struct world world;
    struct fovea_pose pose, first = {0};
    int posed = 0;
    const int from = SAME + 10, frames = 30;
    uint32_t landmarks = 0, keyframes = 0;
    memset(&viewer, 0, sizeof viewer);
    fovea_map_seal(saved, saved_bytes);
    open_world(&world, (uint64_t)from, saved, saved_bytes);
    for (int n = 0; n < frames; n++) {
        (void)iterate(&world, 0, &pose);
        if (n == 0) first = pose;
        if (!pose.posed) continue;
        posed++;
        assert_true(apart(&pose, &poses[from + n]) <
                    0.1 * apart(&poses[SAME], &poses[SAME + RATE]));
    }
    assert_in_range(posed, frames - 3, frames);
    assert_int_equal(pose.keyframes, first.keyframes);
    assert_int_equal(pose.landmarks, first.landmarks);
    assert_int_equal(pose.map_id, poses[SAME].map_id);
    for (int slot = 0; slot < FOVEA_ODOMETRY_LANDMARKS_MAX; slot++)
        landmarks += viewer.landmark[slot];
    for (int slot = 0; slot < FOVEA_ODOMETRY_KEYFRAMES_MAX; slot++)
        keyframes += viewer.keyframe[slot];
    assert_int_equal(viewer.pieces, frames); /* more than once round the pools */
    assert_int_equal(landmarks, pose.landmarks);
    assert_int_equal(keyframes, pose.keyframes);
    /* Saved again, it is the same map but for what is counted per frame. */
    const size_t capacity = fovea_map_bytes_max(&world.config);
    uint8_t *again = malloc(capacity);
    assert_int_equal(fovea_map_save(world.rt, again, capacity), saved_bytes);
    free(again);
    close_world(&world);
    /* A damaged one is refused, with its name. */
    struct fovea_error error;
    struct fovea *rt;
    size_t bytes;
    saved[saved_bytes / 2] ^= 1;
    world.config.map_name = "a.map";
    assert_int_equal(fovea_size(&world.config, &bytes, &error), FOVEA_OK);
    void *memory = aligned_alloc(FOVEA_BLOCK_ALIGNMENT, (bytes + 63) / 64 * 64);
    assert_int_equal(fovea_init(memory, bytes, &world.config, &rt, &error), FOVEA_ERROR_INPUT);
    assert_non_null(strstr(error.text, "a.map: byte "));
    free(memory);
    free(saved);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_carried_off_and_back),
        cmocka_unit_test(test_found_in_a_saved_map),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

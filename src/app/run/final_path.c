#include "app/run/final_path.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "support/aligned.h"
#include "base/ring.h"
#include "geometry/se3.h"

enum {
    RING_BYTES = 1 << 20,
    TURN_BYTES = 1 << 17, /* a whole map that is left behind, and a frame */
    WORK_CALLS_MAX = 1000,
    WORK_UNITS = 100
};

/* A keyframe that has left the map. */
struct left {
    uint32_t map; /* when it left */
    bool hangs;   /* T is relative to the keyframe `on`, else in the map's world */
    uint64_t number, on;
    struct fv_se3 T;
};

/* A posed frame. */
struct hung {
    uint64_t keyframe;
    double scale;
    struct fv_se3 T_keyframe_cam;
    struct fv_trajectory_sample published;
};

struct message {
    bool is_frame;
    union {
        struct left left;
        struct hung frame;
    } of;
};

struct fv_final {
    struct fv_ring ring;
    struct fv_trajectory *out;
    FILE *spool; /* of struct hung */

    /* The loop's. */
    uint64_t lost;
    struct fovea_keyframe before[FOVEA_ODOMETRY_KEYFRAMES_MAX];
    struct fovea_keyframe now[FOVEA_ODOMETRY_KEYFRAMES_MAX];

    /* The watcher's. */
    struct left *lefts;
    size_t left_count, left_capacity;
    int failed; /* errno of a failure */
    _Alignas(64) uint8_t memory[RING_BYTES];
};

enum fovea_status fv_final_open(const char *path, struct fv_final **final,
                                struct fovea_error *error)
{
    struct fv_final *opened = fv_aligned_zeroed(sizeof *opened);
    if (opened == NULL)
        return fovea_error_set(error, FOVEA_ERROR_MEMORY, "no memory for the final trajectory");
    fv_ring_init(&opened->ring, opened->memory, sizeof opened->memory);
    enum fovea_status status = fv_trajectory_open(path, &opened->out, error);
    if (status == FOVEA_OK && (opened->spool = tmpfile()) == NULL)
        status = fovea_error_set(error, FOVEA_ERROR_SYSTEM, "%.200s: no temporary file for it: %s",
                                 path, strerror(errno));
    if (status != FOVEA_OK) {
        fv_final_close(opened);
        return status;
    }
    *final = opened;
    return FOVEA_OK;
}

/* ---- loop thread */

static void send(struct fv_final *final, const struct message *message)
{
    uint8_t *room = fv_ring_reserve(&final->ring, sizeof *message);
    if (room == NULL) {
        final->lost++;
        return;
    }
    memcpy(room, message, sizeof *message);
    fv_ring_commit(&final->ring, sizeof *message);
}

void fv_final_frame(struct fv_final *final, const struct fovea_pose *pose,
                    const struct fv_trajectory_sample *published)
{
    if (final == NULL) return;
    struct message message;
    memset(&message, 0, sizeof message);
    message.is_frame = true;
    message.of.frame.keyframe = pose->reference_keyframe;
    message.of.frame.scale = pose->scale;
    fv_se3_from_rows(pose->T_keyframe_cam, &message.of.frame.T_keyframe_cam);
    message.of.frame.published = *published;
    send(final, &message);
}

/* Of the same map, the keyframe that stays and is nearest in number; NULL: none stays. */
static const struct fovea_keyframe *nearest(const struct fv_final *final, uint32_t count,
                                            const struct fovea_keyframe *gone)
{
    const struct fovea_keyframe *best = NULL;
    uint64_t least = UINT64_MAX;
    for (uint32_t i = 0; i < count; i++) {
        const struct fovea_keyframe *now = &final->now[i], *before = &final->before[i];
        uint64_t apart =
            now->number > gone->number ? now->number - gone->number : gone->number - now->number;
        if (!now->used || !before->used || now->number != before->number ||
            before->map_id != gone->map_id || apart >= least)
            continue;
        best = before; /* both as they were before */
        least = apart;
    }
    return best;
}

static void leave(struct fv_final *final, uint32_t count, const struct fovea_keyframe *gone)
{
    const struct fovea_keyframe *on = nearest(final, count, gone);
    struct message message;
    struct left *left = &message.of.left;
    memset(&message, 0, sizeof message);
    left->map = gone->map_id;
    left->number = gone->number;
    fv_se3_from_rows(gone->T_world_cam, &left->T);
    left->hangs = on != NULL;
    if (on != NULL) {
        struct fv_se3 T_world_on, T_on_world;
        fv_se3_from_rows(on->T_world_cam, &T_world_on);
        fv_se3_invert(&T_world_on, &T_on_world);
        fv_se3_compose(&T_on_world, &left->T, &left->T);
        left->on = on->number;
    }
    send(final, &message);
}

void fv_final_observe(struct fv_final *final, const struct fovea *rt)
{
    if (final == NULL) return;
    uint32_t count = fovea_keyframes_get(rt, final->now, FOVEA_ODOMETRY_KEYFRAMES_MAX);
    for (uint32_t i = 0; i < count; i++) {
        const struct fovea_keyframe *before = &final->before[i], *now = &final->now[i];
        if (before->used && (!now->used || now->number != before->number))
            leave(final, count, before);
    }
    memcpy(final->before, final->now, count * sizeof final->now[0]);
}

bool fv_final_room(struct fv_final *final)
{
    return final == NULL || fv_ring_room(&final->ring) >= TURN_BYTES;
}

/* ---- the other side */

static void take_left(struct fv_final *final, const struct left *left)
{
    if (final->left_count == final->left_capacity) {
        size_t capacity = final->left_capacity == 0 ? 1024 : 2 * final->left_capacity;
        struct left *larger = realloc(final->lefts, capacity * sizeof *larger);
        if (larger == NULL) {
            final->failed = ENOMEM;
            return;
        }
        final->lefts = larger;
        final->left_capacity = capacity;
    }
    final->lefts[final->left_count++] = *left;
}

void fv_final_drain(struct fv_final *final)
{
    size_t bytes;
    const uint8_t *data;
    if (final == NULL) return;
    while ((data = fv_ring_peek(&final->ring, &bytes)) != NULL) {
        struct message message;
        memcpy(&message, data, sizeof message);
        fv_ring_release(&final->ring, sizeof message);
        if (!message.is_frame)
            take_left(final, &message.of.left);
        else if (fwrite(&message.of.frame, sizeof message.of.frame, 1, final->spool) != 1)
            final->failed = errno;
    }
}

/* What was begun for the map is finished; nothing of it is published. */
static void finish_jobs(struct fovea *rt)
{
    struct fovea_outputs outputs;
    const struct fovea_grants grants = {
        .units = {[FOVEA_JOB_MAP] = WORK_UNITS, [FOVEA_JOB_CLOSURE] = WORK_UNITS}};
    for (int call = 0; call < WORK_CALLS_MAX; call++) {
        (void)fovea_work(rt, &grants, &outputs);
        if (outputs.units_done[FOVEA_JOB_MAP] + outputs.units_done[FOVEA_JOB_CLOSURE] == 0) break;
    }
}

static int by_number(const void *a, const void *b)
{
    const struct left *x = a, *y = b;
    return x->number < y->number ? -1 : x->number > y->number;
}

static struct left *find(struct left *sorted, size_t count, uint64_t number)
{
    const struct left key = {.number = number};
    return bsearch(&key, sorted, count, sizeof *sorted, by_number);
}

/* All keyframes in their maps' worlds, sorted. What a keyframe hangs on left later, so the last are
 * placed first. */
static struct left *place(const struct fv_final *final)
{
    struct left *sorted = malloc((final->left_count + 1) * sizeof *sorted);
    if (sorted == NULL || final->left_count == 0) return sorted;
    memcpy(sorted, final->lefts, final->left_count * sizeof *sorted);
    qsort(sorted, final->left_count, sizeof *sorted, by_number);
    for (size_t i = final->left_count; i-- > 0;) {
        const struct left *left = &final->lefts[i];
        struct left *placed = find(sorted, final->left_count, left->number);
        const struct left *on = left->hangs ? find(sorted, final->left_count, left->on) : NULL;
        if (placed == NULL || on == NULL) continue;
        fv_se3_compose(&on->T, &left->T, &placed->T);
        placed->map = on->map; /* maps may have been joined since */
    }
    return sorted;
}

/* The scale of each world: that of the whole map where it is still there, else that known last.
 * Worlds past the last element share it, and are not judged either. */
struct scales {
    uint32_t count;
    uint32_t map[FV_TRAJECTORY_MAPS_MAX];
    double scale[FV_TRAJECTORY_MAPS_MAX];
};

static double *scale_of(struct scales *scales, uint32_t map)
{
    uint32_t i = 0;
    while (i < scales->count && scales->map[i] != map)
        i++;
    if (i == FV_TRAJECTORY_MAPS_MAX) return &scales->scale[i - 1];
    if (i == scales->count) {
        scales->map[scales->count++] = map;
        scales->scale[i] = 1;
    }
    return &scales->scale[i];
}

/* The next frame of the spool in its place; false at the end. Frames without their keyframe are
 * counted. */
static bool next_frame(struct fv_final *final, struct left *sorted, struct hung *frame,
                       struct fv_se3 *T, uint64_t *without)
{
    while (fread(frame, sizeof *frame, 1, final->spool) == 1) {
        const struct left *keyframe = find(sorted, final->left_count, frame->keyframe);
        if (keyframe == NULL) {
            (*without)++;
            continue;
        }
        frame->published.map = keyframe->map;
        fv_se3_compose(&keyframe->T, &frame->T_keyframe_cam, T);
        return true;
    }
    if (ferror(final->spool)) final->failed = EIO;
    return false;
}

static void write_frames(struct fv_final *final, const struct fovea *rt, struct left *sorted)
{
    struct hung frame;
    struct fv_se3 T;
    struct scales scales = {.count = 0};
    uint64_t without = 0;
    if (fflush(final->spool) != 0) final->failed = errno; /* which rewinding would forget */
    rewind(final->spool);
    while (next_frame(final, sorted, &frame, &T, &without))
        *scale_of(&scales, frame.published.map) = frame.scale;
    for (uint32_t i = 0; i < scales.count; i++) {
        const double scale = fovea_map_scale_get(rt, scales.map[i]);
        if (scale > 0) scales.scale[i] = scale;
    }
    rewind(final->spool);
    final->lost += without;
    while (next_frame(final, sorted, &frame, &T, &without)) {
        for (int i = 0; i < 3; i++)
            T.t[i] *= *scale_of(&scales, frame.published.map);
        fv_se3_to_rows(&T, frame.published.T_world_cam);
        if (!fv_trajectory_room(final->out)) fv_trajectory_drain(final->out);
        fv_trajectory_add(final->out, &frame.published);
    }
}

void fv_final_finish(struct fv_final *final, struct fovea *rt,
                     struct fv_trajectory_summary *summary)
{
    *summary = (struct fv_trajectory_summary){.error_m = NAN, .scale = NAN};
    if (final == NULL) return;
    fv_final_drain(final);
    finish_jobs(rt);
    fv_final_observe(final, rt);
    /* Now all that are left leave. */
    for (uint32_t i = 0; i < FOVEA_ODOMETRY_KEYFRAMES_MAX; i++) {
        if (!final->before[i].used) continue;
        leave(final, 0, &final->before[i]);
        fv_final_drain(final);
    }
    fv_final_drain(final);
    struct left *sorted = place(final);
    if (sorted != NULL)
        write_frames(final, rt, sorted);
    else
        final->failed = ENOMEM;
    free(sorted);
    fv_trajectory_finish(final->out, summary);
    summary->lost += final->lost;
    if (summary->failed == 0) summary->failed = final->failed;
}

void fv_final_close(struct fv_final *final)
{
    if (final == NULL) return;
    if (final->spool != NULL) fclose(final->spool);
    fv_trajectory_close(final->out);
    free(final->lefts);
    free(final);
}

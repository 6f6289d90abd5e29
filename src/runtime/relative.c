#include "runtime/relative.h"

#include <string.h>

#include "geometry/vec.h"

enum { RING = FOVEA_RELATIVE_FRAMES_MAX + 1 };

static const double unit_sigma = 0.005; /* of a stretch, relative */

void fv_relative_carve(struct fv_relative *relative, struct fv_arena *persistent)
{
    relative->state = fv_arena_take(persistent, 1, sizeof *relative->state);
}

/* Whether a pose relates to the last one. */
static bool relates(const struct fv_relative_state *s, const struct fovea_pose *pose,
                    uint32_t changes)
{
    return s->stretch > 0 && s->map_id == pose->map_id && s->reset_counter == pose->reset_counter &&
           s->changes == changes && s->metric == (pose->scale_source != FOVEA_SCALE_FREE);
}

/* Take the scale's share out of a covariance, which publish.c has added for the way since the
 * keyframe: it is the same error in all links, and counted once. */
static void take_scale_out(const struct fovea_pose *pose, double covariance[21])
{
    struct fv_se3 T;
    double way[3];
    if (pose->scale_source == FOVEA_SCALE_FREE || pose->state == FOVEA_TRACKING_COASTING) return;
    fv_se3_from_rows(pose->T_keyframe_cam, &T);
    fv_rotate_back3(T.R, T.t, way);
    fv_se3_add_along(way, -pose->scale * pose->scale * pose->scale_sigma * pose->scale_sigma,
                     covariance);
}

void fv_relative_note(const struct fv_relative *relative, const struct fovea_pose *pose,
                      uint32_t changes, int64_t stamp_ns)
{
    struct fv_relative_state *s = relative->state;
    struct fv_relative_frame *frame = &s->ring[s->frames % RING];
    if (s->frames > 0 && s->ring[(s->frames - 1) % RING].stamp_ns == stamp_ns)
        frame = &s->ring[(s->frames - 1) % RING];
    else
        s->frames++;
    memset(frame, 0, sizeof *frame);
    frame->stamp_ns = stamp_ns;
    if (!pose->posed) return;
    const bool gap = s->frames > 1 && s->ring[(s->frames - 2) % RING].stretch == 0;
    if (gap || !relates(s, pose, changes)) s->stretch++;
    s->map_id = pose->map_id;
    s->reset_counter = pose->reset_counter;
    s->changes = changes;
    s->metric = pose->scale_source != FOVEA_SCALE_FREE;
    frame->stretch = s->stretch;
    frame->is_keyframe = pose->keyframe_stamp_ns == stamp_ns;
    fv_se3_from_rows(pose->T_world_cam, &frame->T_world_cam);
    memcpy(frame->covariance, pose->covariance, sizeof frame->covariance);
    take_scale_out(pose, frame->covariance);
    frame->common_sigma = s->metric ? pose->scale_sigma : unit_sigma;
}

/* Add the covariance of a frame, carried to the later one. */
static void add_link(const struct fv_se3 *T_now_world, const struct fv_relative_frame *frame,
                     double covariance[21])
{
    struct fv_se3 T_now_frame;
    double carried[21];
    fv_se3_compose(T_now_world, &frame->T_world_cam, &T_now_frame);
    fv_se3_carry_covariance(&T_now_frame, frame->covariance, carried);
    for (int k = 0; k < 21; k++)
        covariance[k] += carried[k];
}

/* What links have in common along the whole way: the scale's error, or that of the unit of length
 * of the stretch, which differs from place to place. */
static void add_common(const struct fv_se3 *T_before_now, double sigma, double covariance[21])
{
    double way[3];
    fv_rotate_back3(T_before_now->R, T_before_now->t, way);
    fv_se3_add_along(way, sigma * sigma, covariance);
}

bool fv_relative_get(const struct fv_relative *relative, uint32_t frames,
                     struct fovea_relative_pose *out)
{
    const struct fv_relative_state *s = relative->state;
    memset(out, 0, sizeof *out);
    if (frames > FOVEA_RELATIVE_FRAMES_MAX || s->frames <= frames) return false;
    const uint64_t last = s->frames - 1, first = last - frames;
    const struct fv_relative_frame *now = &s->ring[last % RING], *before = &s->ring[first % RING];
    struct fv_se3 T_before_world, T_now_world, T;
    if (now->stretch == 0 || now->stretch != before->stretch) return false;
    out->stamp_ns = now->stamp_ns;
    out->before_stamp_ns = before->stamp_ns;
    fv_se3_invert(&before->T_world_cam, &T_before_world);
    fv_se3_compose(&T_before_world, &now->T_world_cam, &T);
    fv_se3_to_rows(&T, out->T_before_now);
    if (frames == 0) return true;
    memcpy(out->covariance, now->covariance, sizeof out->covariance);
    fv_se3_invert(&now->T_world_cam, &T_now_world);
    for (uint64_t i = first; i < last; i++) {
        const struct fv_relative_frame *frame = &s->ring[i % RING];
        /* The earlier frame hangs on its keyframe; those in between count where they are links. */
        if (frame->stretch == now->stretch && (frame->is_keyframe != 0) == (i != first))
            add_link(&T_now_world, frame, out->covariance);
    }
    add_common(&T, now->common_sigma, out->covariance);
    return true;
}

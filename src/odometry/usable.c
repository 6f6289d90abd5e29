#include "odometry/usable.h"

#include <string.h>

#include "geometry/vec.h"
#include "image/noise.h"
#include "odometry/odometry.h"

enum {
    SAMPLE = 64,     /* landmarks whose motion in the image is looked at */
    DISTRUSTED = 3,  /* pictures behind a patched one */
    PICTURES = 8,    /* before this one, whose features are looked for */
    AGE_MASK = 0xff, /* of what is remembered of a feature: the number of its picture */
};

/* Of a picture's features, those that one of the last pictures had at the same place with the same
 * descriptor. On recordings, also of a camera that stands, 0.006 at most; in the simulation, where
 * camera and world stand, 0.037 with a noise of half a grey level, and more without any. Of a
 * repeated picture all but those that other boxes around what moves leave out or let in: at least
 * 0.69 were found. */
static const double repeated_fraction = 0.5, patched_fraction = 1.0 / 16;
static const double blurred_fraction = 0.65; /* of the usual score */
static const double follow = 0.2;            /* of a usable picture's score and noise */
static const double fall = 0.995;            /* per blurred picture: so lasts the memory */
static const double noisy_times = 2.5;       /* the usual noise */
static const double noise_least = 5;         /* grey levels, which may always be usual */
static const double rise = 1.005;            /* per noisy picture */
static const double predicted_min_px = 1;    /* less motion than this may end at once */
static const double crept_px = 1;            /* since motion ended: it goes on, slowly */
static const double crept_noisy_px = 3;      /* the same, where pictures are noisy */
static const double frozen_fraction = 0.15;  /* of the motion predicted, above which it goes on */
static const double frozen_px = 0.1;         /* noise of a pose, in the image */
static const double across = 0.3; /* of the way: the uncertainty to its sides, as where it turns */

/* ---- the picture itself ---------------------------------------------------------------------- */

static uint64_t mix(uint64_t hash, const void *data, size_t bytes)
{
    const uint8_t *at = data;
    for (; bytes >= 8; bytes -= 8, at += 8) {
        uint64_t word;
        memcpy(&word, at, 8);
        hash = (hash ^ word) * UINT64_C(0x9e3779b97f4a7c15);
        hash ^= hash >> 32;
    }
    return hash;
}

void fv_usable_picture(struct fv_usable_state *s, uint32_t count,
                       const struct fovea_feature *features, const uint8_t *descriptors)
{
    uint32_t again = 0;
    uint64_t sum = 0;
    s->picture = (s->picture + 1) & AGE_MASK;
    for (uint32_t i = 0; i < count; i++) {
        const uint64_t hash =
            mix(mix(1, &descriptors[(size_t)i * FV_MAP_DESCRIPTOR_BYTES], FV_MAP_DESCRIPTOR_BYTES),
                &features[i].x_px, sizeof features[i].x_px + sizeof features[i].y_px);
        uint32_t *place = &s->seen[hash % FV_USABLE_SEEN];
        const uint32_t kept = (uint32_t)(hash >> 32) | AGE_MASK;
        again += (*place | AGE_MASK) == kept && ((s->picture - *place) & AGE_MASK) <= PICTURES;
        *place = (kept ^ AGE_MASK) | s->picture;
        sum += features[i].score;
    }
    s->repeated = count > 0 && again > repeated_fraction * count;
    const bool is_old = again > patched_fraction * count;
    if (is_old && !s->repeated) s->distrust = DISTRUSTED + 1;
    s->patched = is_old || s->distrust > 0;
    s->distrust -= s->distrust > 0;
    const double score = count > 0 ? (double)sum / count : 0;
    s->blurred = score < blurred_fraction * s->sharpness;
    if (s->blurred)
        s->sharpness *= fall;
    else if (s->sharpness > 0)
        s->sharpness += follow * (score - s->sharpness);
    else
        s->sharpness = score;
}

void fv_usable_noise(struct fv_usable_state *s, uint32_t noise)
{
    const double found = (double)noise / FV_NOISE_ONE;
    if (s->noise < noise_least) s->noise = noise_least;
    s->noisy = found > noisy_times * s->noise;
    s->noise = s->noisy ? rise * s->noise : s->noise + follow * (found - s->noise);
}

void fv_usable_forget(struct fv_usable_state *s)
{
    s->sharpness = 0;
    s->blurred = s->frozen = false;
}

/* ---- motion that ends at once ---------------------------------------------------------------- */

/* Mean distance in pixels between where two poses see some of the frame's landmarks. */
static double image_motion_px(const struct fv_odometry *o, const struct fv_map_frame *frame,
                              const struct fv_se3 *A, const struct fv_se3 *B)
{
    double sum = 0;
    uint32_t count = 0;
    for (uint32_t f = 0; f < frame->keyframe->features && count < SAMPLE; f++) {
        double q[3], a[2], b[2];
        if (frame->landmark[f] == FV_MAP_NONE) continue;
        const double *point = o->map.landmarks[frame->landmark[f]].point;
        fv_se3_apply(A, point, q);
        if (!fv_map_project(&o->map, q, a)) continue;
        fv_se3_apply(B, point, q);
        if (!fv_map_project(&o->map, q, b)) continue;
        const double x = a[0] - b[0], y = a[1] - b[1];
        sum += __builtin_sqrt(x * x + y * y);
        count++;
    }
    return count > 0 ? sum / count : 0;
}

void fv_odometry_judge_freeze(struct fv_odometry *o, const struct fv_map_frame *frame,
                              const struct fv_se3 *T_last, const struct fv_se3 *T)
{
    struct fv_usable_state *s = &o->state->usable;
    const struct fv_motion *motion = &o->state->localise.motion;
    const int64_t stamp_ns = frame->keyframe->stamp_ns;
    struct fv_se3 predicted;
    fv_motion_predict_from(motion, T_last, s->judged_ns, stamp_ns, &predicted);
    s->judged_ns = stamp_ns;
    const double expected_px = image_motion_px(o, frame, T_last, &predicted),
                 found_px = image_motion_px(o, frame, T_last, T);
    const bool ended =
        expected_px >= predicted_min_px && found_px < frozen_px + frozen_fraction * expected_px;
    if (!s->frozen) s->frozen_at = *T_last;
    /* The motion model stays that of the frames before, so what froze is still held against it.
     * From one noisy picture to the next a pose jumps by more than what ends a freeze. */
    const bool jumps = s->frozen && s->noisy;
    s->frozen = s->repeated ||
                (((motion->known && ended) || jumps) &&
                 image_motion_px(o, frame, &s->frozen_at, T) < (jumps ? crept_noisy_px : crept_px));
}

void fv_odometry_add_freeze(struct fv_odometry *o, const struct fv_map_frame *frame)
{
    const struct fv_se3 *T = &frame->keyframe->T_cam_world;
    struct fv_se3 ahead, inverse, between;
    double e[6];
    if (!o->state->usable.frozen) return;
    fv_motion_predict(&o->state->localise.motion, T, frame->keyframe->stamp_ns, &ahead);
    fv_se3_invert(&ahead, &inverse);
    fv_se3_compose(T, &inverse, &between); /* the camera there, seen from here */
    fv_copy3(between.t, e);
    fv_so3_log(between.R, e + 3);
    const double way2 = fv_dot3(e, e), turn2 = fv_dot3(e + 3, e + 3);
    for (int row = 0, k = 0; row < 6; row++)
        for (int column = row; column < 6; column++, k++) {
            o->state->pose.covariance[k] += e[row] * e[column];
            if (row == column)
                o->state->pose.covariance[k] += across * across * (row < 3 ? way2 : turn2);
        }
    struct fv_covariance_state *own = &o->state->covariance;
    const double share = 1.0 / 3 + across * across; /* of an axis, in the mean */
    own->own_position = __builtin_sqrt(own->own_position * own->own_position + share * way2);
    own->own_turn = __builtin_sqrt(own->own_turn * own->own_turn + share * turn2);
}

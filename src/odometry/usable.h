/* Pictures that are of no use: blurred, noisy, frozen, or patched. Black ones have no features, and
 * lose the camera.
 *
 * Blurred: the mean score of a picture's features is far below that of the pictures before it.
 * From one picture to the next it changes by a fifth at most on recordings and in simulation, and a
 * blur of 2 px (standard deviation), or 15 px of motion, halves it. Exposure changes it slowly, and
 * is followed.
 *
 * Noisy: the noise (image/noise.h) is over 12.5 grey levels, and two and a half times that of the
 * pictures before it. On recordings it is at most 2.2, in simulation 2.5, and 5 where four times
 * the light comes in; the roughest of 396 photographs has 11.3, so texture alone is not noisy. A
 * camera that is noisy for good is taken as it is, after 95 pictures of a noise of 20 and 315
 * of 60. What is usual belongs to the camera: another map changes nothing of it.
 *
 * Frozen: the camera repeats a picture, perhaps with noise or compressed anew. Noise lets exactly
 * the same features occur once, so that many of them again are an old picture, whatever boxes have
 * hidden of it. Else what tells is that all motion ends from one picture to the next, which mass
 * does not: a car that brakes, however hard, still moves in the next frame. Motion is by time, so
 * the frame behind a gap says nothing of the next. What creeps on is no repeated picture: a pixel
 * of it in all ends the freeze; three where pictures are noisy, since poses then jump by up to 1.8
 * while nothing moves. While the picture stays, the camera may stand or go on, so the way that it
 * would have gone since is added to the covariance.
 *
 * Patched: some of the features are exactly those of one of the last eight pictures, as after a
 * transfer that broke off: what is old says that the camera stands. A picture from before an outage
 * is older, and counts as new. A link that broke off does so again, and what a few old rows leave
 * shows in too few features: three pictures behind a patched one count as patched.
 *
 * Poses of such pictures are `weak`, none becomes a keyframe, and no map begins with a noisy or a
 * patched one. Real-time safe, no addresses in the state. */
#ifndef FOVEA_ODOMETRY_USABLE_H
#define FOVEA_ODOMETRY_USABLE_H

#include <stdbool.h>
#include <stdint.h>

#include "fovea/features.h"
#include "geometry/se3.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { FV_USABLE_SEEN = 8192 }; /* features that are remembered: those of eight pictures */

struct fv_usable_state {
    /* 24 bits of the hash of a feature, each at the rest of it modulo the places, and 8 of the
     * number of its picture. */
    uint32_t seen[FV_USABLE_SEEN];
    uint32_t picture;        /* number of the current picture */
    uint32_t distrust;       /* pictures to come that count as patched, whatever they show */
    double sharpness;        /* mean score that is usual; 0: not known */
    double noise;            /* that is usual, grey levels; 0: not known */
    int64_t judged_ns;       /* stamp of the last frame that was judged, frozen or not */
    struct fv_se3 frozen_at; /* pose where motion ended; of a picture that is frozen */
    bool blurred;            /* the current picture */
    bool noisy;              /* the same */
    bool repeated;           /* most of its features are exactly those of earlier ones */
    bool patched;            /* a part of them are, or were just before */
    bool frozen;             /* since the last posed frame but some */
};

struct fv_odometry;
struct fv_map_frame;

/* A new picture's features and descriptors (32 bytes each). */
void fv_usable_picture(struct fv_usable_state *state, uint32_t count,
                       const struct fovea_feature *features, const uint8_t *descriptors);
/* And its noise, as fv_noise measures it. */
void fv_usable_noise(struct fv_usable_state *state, uint32_t noise);
/* Another map: the sharpness that is usual is found out anew. */
void fv_usable_forget(struct fv_usable_state *state);

/* The frame was posed at T_cam_world, the last one at T_last, both in the map's unit; the motion
 * model is still that of the frames before. Decides whether the picture is frozen. */
void fv_odometry_judge_freeze(struct fv_odometry *odometry, const struct fv_map_frame *frame,
                              const struct fv_se3 *T_last, const struct fv_se3 *T_cam_world);
/* Add to the pose's covariance what a frozen picture leaves open: the way that the camera would
 * have gone since it froze. */
void fv_odometry_add_freeze(struct fv_odometry *odometry, const struct fv_map_frame *frame);

static inline bool fv_usable(const struct fv_usable_state *state)
{
    return !state->blurred && !state->noisy && !state->frozen && !state->patched;
}

#ifdef __cplusplus
}
#endif
#endif

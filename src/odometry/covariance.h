/* Covariance of a frame's pose relative to its reference keyframe (the newest), and whether it is
 * to be relied on.
 *
 * The joint problem of the frame, its landmarks and the keyframes that see them is linearised where
 * it stands: the reference is held, landmarks are eliminated by the Schur complement, and the
 * frame's block of the inverse is what is left (B. Triggs et al., "Bundle adjustment: a modern
 * synthesis", 2000, 9). So the errors that landmarks have in common, because keyframes that they
 * were seen from are off, count as what they are. A sample of 48 landmarks stands for all, and the
 * 7 keyframes that see most of them for the rest; with the jackknife below, a sample taken by
 * leverage was no better than an even one. The unit of length, which is free, is held by the path
 * of these poses to .5 %.
 *
 * That takes the errors of landmarks for independent. They are not: a thing that moves, whose
 * landmarks were created a frame ago, pulls with all of them, and where they have most of the
 * leverage the pose follows. So the covariance that the parts of the image (6 x 4) show is added:
 * the pose moves by something when a part is left out, and what is moved where one part has most of
 * the leverage is much (fv_pose_jackknife). Few parts show it, and by chance often more than there
 * is: on good runs two fifths of it are enough, which have up to four times the errors' variance.
 * From eight times on, where something does pull, all of it counts, and in a metric map always.
 * Where few parts are left, as behind something that hides the others, they do not show every
 * direction, and what they show beyond three times the errors' variance is spread over all
 * (fv_pose_spread). Errors of single landmarks are taken to have the variance that the frame's
 * inliers show a posteriori.
 *
 * A keyframe may have been noisier than the frame: the sensor had more gain, or the link failed
 * for some pictures. Its errors of the sample show its own variance; where that is larger than the
 * frame's, its observations are weighted by it. Likewise the reference keyframe may have hung on
 * few parts of its image, as where something hid the rest, and the frame does not: what the parts
 * showed of the keyframe, when it was the current frame, stands in place of what they show of the
 * frame where it is at least four times as large, which chance is not.
 *
 * Noise over the mean parallax of the visible landmarks tells how far the map may be bent, and with
 * it the unit of length from place to place; its square times .17, over the way from the reference,
 * is added. It fades as parallax grows. In a metric map nothing is: measured distances are errors
 * of the joint problem, and hold each landmark from its first keyframe on.
 *
 * No calibration is exact: .63 % of the way is added on every run, and the same over the depth to
 * turns. On EuRoC errors grow with the way so; simulated cameras, which are exact, have none of it.
 * In a metric map the scale's sigma says that.
 *
 * So is a twentieth of the way where the pictures leave the map in doubt (agreement.h).
 *
 * What another focal length than the calibration's would move the pose by is added, too
 * (covariance_lens.h).
 *
 * So is, along the way from the reference, what the unit of length may be off that of the map
 * behind places where next to nothing had parallax (covariance_unit.h).
 *
 * Not to be relied on, whatever its size: where that bend is half or more, and while the map is
 * young (fewer than ten keyframes) a tenth; where the parts' variance is three times that of the
 * errors or more, unless five keyframes or more agree with the map (agreement.h): then what pulls
 * is a thing that moves or a lens, and is counted above; where the focal length is another by more
 * than 1 %; where the pose hangs on one part alone; and where, the lens aside, it is not known to
 * 10 mrad and to 1 % of the depth: good pictures leave a tenth of that open, and what leaves so
 * much open has seldom shown it all. */
#ifndef FOVEA_ODOMETRY_COVARIANCE_H
#define FOVEA_ODOMETRY_COVARIANCE_H

#include "base/arena.h"
#include "geometry/pose.h"
#include "map/map.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { FV_COVARIANCE_POSES_MAX = 8 };

/* What is known from frames before. */
struct fv_covariance_state {
    double change_sum, change_weight; /* of focal lengths, by 1 / sigma^2, faded */
    double lens[21];                  /* what another focal length added to the last frame's, */
    double focal;                     /* and that change, by the pictures; 0: none */
    double focal_held;                /* the largest that was clear in one picture, fading */
    uint32_t alert_frames;            /* for so many frames a smaller change is a hint */
    float unit_variance;              /* of a keyframe that is made of the last frame (map.h), */
    double unit_half_difference;      /* and of all (covariance_unit.h) */
    /* What independent errors of its pixels alone do to the last frame's position (map's unit) and
     * turn (rad), standard deviations of an axis: of the covariance, what is its own */
    double own_position, own_turn;
};

struct fv_covariance {
    double *joint; /* frame part: normal equations of at most FV_COVARIANCE_POSES_MAX poses */
};

struct fv_odometry;

void fv_covariance_carve(struct fv_covariance *covariance, struct fv_arena *frame);

/* Lengths get another unit: `factor` of the old one's numbers. */
void fv_covariance_rescale(double covariance[21], double factor);
/* A frame begins, of which nothing is known yet. */
void fv_covariance_begin(struct fv_covariance_state *state);

/* Write the covariance to state->pose, lengths in the map's unit. False: it is not to be relied on.
 * Real-time safe. */
bool fv_covariance_write(struct fv_odometry *odometry, const struct fv_map_frame *frame,
                         const struct fv_pose_fit *fit);

#ifdef __cplusplus
}
#endif
#endif

/* Visual odometry: the pose of the first camera, from its images, or from those of two cameras.
 *
 * Features are matched against landmarks of the local map, predicted by a motion model; the pose
 * minimises the robust pixel error of the matches. Keyframes are kept when the image has changed
 * enough; their landmarks and poses are optimised together by a job. The world frame is the camera
 * frame of the first keyframe; without a scale source its unit is such that the median depth at the
 * start is 1.
 *
 * A second camera at a known place measures how far features are (odometry.sensors). The map then
 * begins with the first frame, in metres, and each measured distance adds to localisation and to
 * the optimisation. Without images of the second camera odometry goes on with the first, in the
 * same map.
 *
 * After Klein and Murray (ISMAR 2007) and Mur-Artal, Montiel and Tardos (T-RO 2015). */
#ifndef FOVEA_ODOMETRY_H
#define FOVEA_ODOMETRY_H

#include <stdbool.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

enum fovea_tracking_state {
    FOVEA_TRACKING_STARTING = 0, /* no map yet: waiting for enough parallax between two frames */
    /* pose from at least inliers_good landmarks, with a reliable covariance */
    FOVEA_TRACKING_OK = 1,
    /* pose from at least FOVEA_POSED_INLIERS_MIN landmarks: fewer than inliers_good, or of a young
     * map whose shape is not settled, or of one that does not agree with the pictures: matches made
     * without the map lie off their places in it, as where most of what is seen moves; or of a
     * picture that is blurred, noisy or repeats the last; or of a part of a map that has next to no
     * parallax; or known to no better than 10 mrad or 1 % of the depth of the scene, as where most
     * of it is hidden */
    FOVEA_TRACKING_WEAK = 2,
    FOVEA_TRACKING_LOST = 3, /* no pose */
    /* pose by the inertial sensor alone, for at most 2 s; the covariance grows as it should */
    FOVEA_TRACKING_COASTING = 5
};

/* A frame has a pose only with at least this number of landmarks that agree with it. */
enum { FOVEA_POSED_INLIERS_MIN = 20 };
/* A map is started only from two frames with at least this number of matched features; where the
 * first has fewer than four times as many, with a quarter of them, and at least 50. */
enum { FOVEA_START_MATCHES_MIN = 80 };

enum fovea_scale_source {
    FOVEA_SCALE_FREE = 0,           /* arbitrary: the unit is the median depth at the start */
    FOVEA_SCALE_CAMERA_HEIGHT = 1,  /* metres, from the height of the camera over the floor */
    FOVEA_SCALE_WHEEL_ODOMETRY = 2, /* metres, from wheel odometry */
    /* metres, from the baseline of two cameras; no configured source: odometry.sensors gives it */
    FOVEA_SCALE_STEREO = 3,
    FOVEA_SCALE_INERTIAL = 4 /* metres, from an inertial sensor; likewise */
};

/* What odometry uses of a rig. */
enum fovea_sensors {
    /* all that the rig offers: stereo where its second camera is calibrated and its place on the
     * body is known, else mono; with the inertial sensor where there is one, unless a scale source
     * is configured */
    FOVEA_SENSORS_AUTO = 0,
    FOVEA_SENSORS_MONO = 1,   /* the first camera alone */
    FOVEA_SENSORS_STEREO = 2, /* the first two cameras; refused where the second does not serve */
    /* the same with the inertial sensor; refused where the rig has none */
    FOVEA_SENSORS_MONO_INERTIAL = 3,
    FOVEA_SENSORS_STEREO_INERTIAL = 4
};

struct fovea_scale_config {
    enum fovea_scale_source source; /* default FOVEA_SCALE_FREE */
    /* [0.01, 1000], default 1: of the camera over the floor; used by camera_height */
    double camera_height_m;
    /* default false; true: send the bot_core pose also while the scale is unknown */
    bool allow_unscaled;
};

enum { FOVEA_ODOMETRY_KEYFRAMES_MAX = 256, FOVEA_ODOMETRY_LANDMARKS_MAX = 20000 };

struct fovea_odometry_config {
    bool enabled;               /* default true */
    enum fovea_sensors sensors; /* default FOVEA_SENSORS_AUTO */
    /* [1, 100], default 2: how many times larger the noise of the inertial sensor is at least than
     * the rig says; more where its samples show that it is shaken */
    double imu_noise_factor;
    /* [9.7, 9.9], default 9.80665: how strong gravity is where the robot is, m/s^2 */
    double gravity_m_s2;
    /* [8, 256], default 128: keyframes of the map; memory about 46 kB each at 1000 features */
    uint32_t keyframes;
    /* [1000, 20000], default 16000: landmarks of the map; memory about 120 B each */
    uint32_t landmarks;
    /* [3, 12], default 8: keyframes optimised together; time grows with the square */
    uint32_t window;
    uint32_t inliers_good; /* [20, 200], default 40: fewer inliers make the state `weak` */
    bool closures;         /* default true: find closures and merge maps */
    /* [1, 10000], default 15: a new map is started after this number of lost frames */
    uint32_t lost_frames_reset;
    /* default false; true: the loaded map stays as it is, and no other map is started */
    bool localise_only;
};

/* Result for the last processed frame. */
struct fovea_pose {
    enum fovea_tracking_state state;
    bool posed; /* T_world_cam is valid */
    /* Row-major 3x4; the world is the camera's frame at the start of the map, continuous where
     * closures correct the map, as `odom`; its unit is the metre unless the scale is free. */
    double T_world_cam[12];
    /* p_map = map_scale R p_world + t with [R t] = T_map_world (row-major 3x4): where the map, as
     * corrected by closures, has the point that the continuous world has at p_world. In the axes of
     * that camera; messages have the same in those of the body. Identity and 1 before the first
     * correction; with a scale both are in metres, map_scale is 1, and T_map_world contains what a
     * better estimate changes. */
    double T_map_world[12], map_scale;
    /* Covariance of the pose relative to its reference keyframe: upper triangle by rows of the 6x6
     * matrix over (x y z, rotation x y z) in the camera frame; lengths in the world's unit, angles
     * in rad. From the joint information of the frame, its landmarks and their keyframes, at the
     * noise that the frame shows, plus the corrections of the reference since its own pose was
     * published. In metres it includes the scale's uncertainty, scale_sigma of the way since the
     * keyframe, along it; while the scale is free the unit is held to 1.5 % over the window. */
    double covariance[21];
    /* Landmarks matched, and of them those that agree. While starting, matches are those of
     * features with the oldest image held. */
    uint32_t matches, inliers;
    float quality; /* fraction of the landmarks predicted to be visible that are inliers, [0, 1] */
    /* rises with each reset, and whenever poses get another parent frame: a new map is started
     * after the camera was lost or a map was given up, or the camera is found again in an older map
     */
    uint32_t reset_counter;
    /* of the map that began this world, or goes on in it where reset_counter stays; 0: the first;
     * that of an older map when the camera is found again in one. A map that it was merged into
     * shows in T_map_world alone */
    uint32_t map_id;
    uint32_t keyframes, landmarks;        /* in all maps */
    enum fovea_scale_source scale_source; /* FOVEA_SCALE_FREE until a scale is known */
    double scale;                         /* world's units per unit of the map; 1 when free */
    double scale_sigma; /* one standard deviation of the scale, relative; 0 when free */

    /* The same pose relative to a keyframe, which later optimisation may move: row-major 3x4, unit
     * of the map. */
    uint64_t reference_keyframe; /* its number; valid when posed */
    int64_t keyframe_stamp_ns;   /* of its frame; likewise */
    double T_keyframe_cam[12];
};

enum { FOVEA_RELATIVE_FRAMES_MAX = 128 }; /* how far back a relative pose may be asked for */

/* The motion from an earlier frame to the last one, as both were published: row-major 3x4, in the
 * earlier camera's frame and the published unit, with its covariance: upper triangle by rows,
 * T_true = T exp(error), as that of struct fovea_pose. It holds the drift between the two frames,
 * and in metres the scale's uncertainty; while the scale is free the unit is the path's own. There
 * is none over a frame without a pose: where the camera was found again hangs on no chain. */
struct fovea_relative_pose {
    int64_t before_stamp_ns, stamp_ns;
    double T_before_now[12];
    double covariance[21];
};

/* A keyframe as its map has it now: row-major 3x4 in the map's own world and unit, which no scale
 * touches. */
struct fovea_keyframe {
    bool used;
    uint32_t map_id;
    uint64_t number; /* counts all keyframes of the run */
    double T_world_cam[12];
};

#ifdef __cplusplus
}
#endif
#endif

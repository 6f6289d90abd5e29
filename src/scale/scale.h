/* Metric scale of a monocular map, from the height of the camera over the floor or from wheel
 * odometry.
 *
 * The map keeps the unit that it was started with. What is estimated is one number, metres per unit
 * of the map; runtime/publish.c applies it to the pose that is published. Odometry does not know
 * it.
 *
 * camera_height: a unit of work after each keyframe fits the floor to the landmarks below the
 * camera (geometry/floor.h); the logarithm of the scale is then filtered (Kalman, one state,
 * drifting with every keyframe since the scale of a monocular map does). wheel_odometry: between
 * the last keyframes, the camera's displacement by wheel odometry is divided by that in the map;
 * the mean of these ratios without outliers counts, and their spread gives the uncertainty. Two
 * cameras begin maps in metres, to which nothing is added; in a map that has a unit of its own, as
 * one begun while the second camera was covered, the distances that they measure give the scale
 * after each keyframe, unless another source is configured. A new
 * map starts with the scale unknown; one that was left or loaded with the scale that it had, which
 * new measurements add to.
 *
 * State holds no addresses. Real-time safe: every function is bounded; no heap. */
#ifndef FOVEA_SCALE_SCALE_H
#define FOVEA_SCALE_SCALE_H

#include "base/arena.h"
#include "base/elementary.h"
#include "fovea/odometry.h"
#include "fovea/sensor.h"
#include "geometry/floor.h"
#include "geometry/se3.h"
#include "odometry/odometry.h"
#include "scale/inertial.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { FV_SCALE_POSITIONS_MAX = 512, FV_SCALE_STATIONS_MAX = 32 };

/* Position of the camera by wheel odometry. */
struct fv_scale_position {
    int64_t stamp_ns;
    double at[3]; /* metres */
};

/* A keyframe. Its position by the map is read each time, since optimisation moves it. */
struct fv_scale_station {
    uint32_t slot, generation;
    bool positioned; /* wheel odometry has come so far */
    struct fv_scale_position position;
};

/* Landmarks of the map that are looked at in a unit, when the floor is looked for. */
enum { FV_FLOOR_SLOTS = 400 };

/* Landmarks being gathered that may be floor. */
struct fv_floor_gather {
    struct fv_se3 T_cam_world;
    uint32_t next, met, count, reserved; /* slot; landmarks that may be floor; points kept; zero */
};

struct fv_scale_state {
    bool started; /* the map has given a pose */
    bool known;
    uint32_t source;              /* that it is known from */
    double log_scale, variance;   /* natural logarithm of metres per unit, and its variance */
    double prior, prior_variance; /* the same, as the map brought it; a variance of 0: nothing */
    double map_scale; /* units of the map per unit of the continuous world, at the last step */
    uint32_t map;     /* that all this belongs to */

    /* camera_height */
    struct fv_floor_gather gather;
    uint64_t gathering; /* landmarks are being gathered */
    struct fv_random random;
    uint64_t fitted; /* number of the map's next keyframe when the floor was last fitted */

    /* wheel odometry */
    uint64_t position_count; /* that have come; the last ones are kept, in a ring */
    struct fv_scale_position
        positions[FV_SCALE_POSITIONS_MAX]; /* of the camera, by wheel odometry */
    uint32_t station_count;
    uint64_t station_next; /* number of the first keyframe that is no station yet */
    struct fv_scale_station stations[FV_SCALE_STATIONS_MAX]; /* oldest first */
};

struct fv_scale {
    struct fovea_scale_config config;
    struct fv_se3 T_body_cam;
    double down[3]; /* of the floor, camera frame: body -z, or camera y where T_body_cam turns
                       nothing */
    struct fv_scale_state *state;
    struct fv_floor_point *points; /* FV_FLOOR_POINTS_MAX, of the gather under way */
};

void fv_scale_carve(struct fv_scale *scale, const struct fovea_scale_config *config,
                    const double T_body_cam[12], struct fv_arena *persistent, struct fv_arena *job);
void fv_scale_init(struct fv_scale *scale, uint64_t seed);

/* Wheel odometry among the samples that have come, in order of time; the rest of them is ignored,
 * as are samples not after the last one. */
void fv_scale_observe(struct fv_scale *scale, const struct fovea_sample *samples, uint32_t count);

/* After each frame, when its pose is known. Odometry keeps what is known with its map. `inertial`:
 * what an inertial sensor claims; NULL: nothing. */
void fv_scale_step(struct fv_scale *scale, struct fv_odometry *odometry,
                   const struct fv_inertial_known *inertial);

/* What is known of the scale of the map that the last frame was posed in. */
struct fv_scale_value {
    bool known;
    enum fovea_scale_source source; /* FOVEA_SCALE_FREE while it is not known */
    double metres;                  /* per unit of the map; 1 while it is not known */
    double sigma;                   /* one standard deviation, relative */
};
struct fv_scale_value fv_scale_get(const struct fv_scale *scale);

/* Whether the floor waits to be fitted, and one unit of that: FV_FLOOR_SLOTS landmarks are looked
 * at, and the floor is fitted to what all units found. */
bool fv_scale_waiting(const struct fv_scale *scale, const struct fv_odometry *odometry);
void fv_scale_unit(struct fv_scale *scale, const struct fv_odometry *odometry);

/* How the floor is looked for among the landmarks of the current map. */
struct fv_floor_look {
    double down[3]; /* where it is expected, in the camera's frame: a unit vector */
    struct fv_random *random;
    struct fv_floor_point *points; /* scratch of points_max */
    uint32_t points_max, samples;
    /* Whether a point of the camera's frame, in units of the map, may be floor; NULL: all. */
    bool (*takes)(const void *context, const double point[3]);
    const void *context;
};
/* Gather landmarks that may be floor, as a camera of the map sees them, in units of the map: a
 * piece of FV_FLOOR_SLOTS of the map's from gather->next on. True: that was the last;
 * gather->count points. */
bool fv_scale_gather_floor(const struct fv_odometry *odometry, const struct fv_floor_look *look,
                           struct fv_floor_gather *gather);
/* To begin with: as the last frame sees them. */
struct fv_floor_gather fv_scale_gather_begin(const struct fv_odometry *odometry);
/* Fit the floor (geometry/floor.h) to them; false when none is found. */
bool fv_scale_fit_floor(const struct fv_floor_look *look, uint32_t count, struct fv_floor *floor);
/* Take for sigmas of the points what a fit shows, where that is less than they state, for another
 * fit: two cameras place points better than the way between keyframes says. */
void fv_scale_sharpen_floor(const struct fv_floor_look *look, uint32_t count,
                            const struct fv_floor *floor);

/* ---- between the files of the stage */

/* A unit of looking for the floor in the map as a frame sees it. True: it is complete, and `found`
 * says whether there is a floor. */
bool fv_scale_find_floor(struct fv_scale *scale, const struct fv_odometry *odometry,
                         struct fv_floor *floor, bool *found);
/* Logarithm of metres per unit of the map, and its variance, by the distances that two cameras
 * measured in the current frame; false where they are too few. */
bool fv_scale_compare_distances(const struct fv_odometry *odometry, double *log_scale,
                                double *variance);
/* Hold the keyframes against wheel odometry. */
void fv_scale_walk(struct fv_scale *scale, const struct fv_odometry *odometry);

#ifdef __cplusplus
}
#endif
#endif

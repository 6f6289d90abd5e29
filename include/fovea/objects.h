/* Objects with an id, from the detections of one image after the other.
 *
 * Two modes. `sort`: a Kalman filter of constant velocity for the centre and size of each box; the
 * camera's rotation between two images, known from the odometry, moves the prediction; detections
 * are assigned to predictions at least total cost (overlap and Mahalanobis distance, gated, by
 * class), first the certain detections, then the uncertain ones (also below the model's threshold)
 * to objects that were seen just before. After Bewley et al., "Simple online and realtime
 * tracking", ICIP 2016 (filter and assignment); Zhang et al., "ByteTrack", ECCV 2022 (two stages by
 * score); Aharon et al., "BoT-SORT", 2022 (camera motion, noise in proportion to the box).
 * `centroid`: the nearest centroids are matched up to a distance; an object that is unseen for too
 * long ends.
 *
 * An id is given once per run, also across resets. A full pool gives up its weakest object:
 * a tentative one first, then one that coasts, then the one with the fewest detections; a detection
 * that starts an object never displaces one that was seen in the same image.
 *
 * Time is that of the images (their stamps), so results do not depend on when they were computed.
 */
#ifndef FOVEA_OBJECTS_H
#define FOVEA_OBJECTS_H

#include <stdbool.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

enum { FOVEA_OBJECTS_MAX = 256, FOVEA_OBJECT_CLASSES_MAX = 128, FOVEA_OBJECT_HEIGHT_MAX_M = 100 };

enum fovea_objects_mode {
    FOVEA_OBJECTS_SORT = 0,
    FOVEA_OBJECTS_CENTROID = 1,
    FOVEA_OBJECTS_OFF = 2
};

enum fovea_object_state {
    FOVEA_OBJECT_TENTATIVE = 0, /* seen, but not yet often enough to be confirmed */
    FOVEA_OBJECT_CONFIRMED = 1, /* seen in the image that the list belongs to */
    FOVEA_OBJECT_COASTING = 2,  /* confirmed before, not seen in this image: its box is predicted */
    FOVEA_OBJECT_ENDED = 3      /* given up with this image; listed once, for the last time */
};

/* The frame of an object's position. */
enum fovea_object_located {
    FOVEA_OBJECT_LOCATED_NOT = 0,    /* not known: the numbers are 0 or old */
    FOVEA_OBJECT_LOCATED_CAMERA = 1, /* camera of the image, metres; the pose has no metric scale */
    FOVEA_OBJECT_LOCATED_WORLD = 2   /* `world` of struct fovea_pose, metres; messages: `odom` */
};

struct fovea_objects_config {
    int mode; /* enum fovea_objects_mode, default FOVEA_OBJECTS_SORT */
    /* [1, 256], default 128; memory: 2.2 kB each, with the costs of 300 detections */
    uint32_t count_max;
    /* Of `sort`. */
    /* [1, 100], default 2: detections in a row that confirm an object, */
    uint32_t confirm_hits;
    double score_confirm; /* [0, 1], default 0.5: when their mean score is at least this */
    double score_high;    /* [0, 1], default 0.4: least score of the first stage */
    double score_low;     /* [0, 1], default 0.2: least score of the second stage */
    /* [0, 1], default 0.4: least score of a detection that starts an object */
    double score_new;
    double coast_s; /* [0, 60], default 2: a confirmed object unseen for longer ends */
    /* Of `centroid`. */
    /* [1, 10000], default 60: a detection farther from an object is another one */
    double max_distance_px;
    uint32_t max_disappeared; /* [0, 10000], default 20: an object unseen in more images ends */
    /* objects stand on the floor, which is z = 0 of the body frame: T_body_cam must state the
     * height of the camera over it; default false */
    bool ground;
    /* Height of an object of each class, metres, at most FOVEA_OBJECT_HEIGHT_MAX_M; 0: not known.
     * One standard deviation is taken to be a tenth. */
    float height_m[FOVEA_OBJECT_CLASSES_MAX];
    /* Classes that move on their own, as bits: their boxes are masked out of the map. Default none;
     * the command takes those that its network names and that are known to move (objects.movable:
     * auto). */
    uint32_t movable[FOVEA_OBJECT_CLASSES_MAX / 32];
};

struct fovea_object {
    uint64_t id; /* from 1 */
    int32_t class_id;
    int32_t state; /* enum fovea_object_state */
    float score;   /* of the last detection */
    float x_min_px, y_min_px, x_max_px,
        y_max_px;          /* estimated box, raw image, as of the list's stamp */
    float x_px_s, y_px_s;  /* velocity of its centre, the camera's rotation taken out */
    uint32_t hits, unseen; /* detections in all; images processed since the last one */

    enum fovea_object_located located;
    int64_t first_ns, seen_ns; /* stamps of the first and the last detection */
    /* of its centre by size, of its foot by the floor; velocity in the world only */
    double position_m[3], velocity_m_s[3];
    double covariance_m2[6];             /* of the position, upper triangle by rows */
    double velocity_covariance_m2_s2[6]; /* of the velocity, likewise; in the world only */
};

/* The objects as of the last image that the network processed, in memory of the runtime's block. */
struct fovea_objects {
    uint64_t updates;   /* since fovea_init; nothing below holds while 0 */
    int64_t stamp_ns;   /* of the image */
    uint64_t sequence;  /* its frame's number */
    uint64_t confirmed; /* objects confirmed since fovea_init */
    uint32_t count;
    const struct fovea_object *list; /* by rising id */
};

#ifdef __cplusplus
}
#endif
#endif

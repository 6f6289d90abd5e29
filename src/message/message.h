/* Messages: the runtime's results as LCM bytes, encoded into memory that the caller owns.
 *
 * Types stand in include/lcmtypes/; encoding goes through lcm-gen's `_encode` (its `_publish` calls
 * the heap). An encoder returns the bytes written, or 0 when `capacity` is too small; `*_size_max`
 * says what is always enough, for carving. Values read from clocks go into the statistics message
 * alone. Everything here is real-time safe, except where it says init-only, and needs
 * fv_message_prepare to have run once in the process. */
#ifndef FOVEA_MESSAGE_MESSAGE_H
#define FOVEA_MESSAGE_MESSAGE_H

#include <stddef.h>
#include <stdint.h>

#include "fovea/edges.h"
#include "fovea/fovea.h"
#include "fovea/grid.h"
#include "fovea/network.h"
#include "fovea/segmentation.h"
#include "fovea_stamp_t.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Kinds of message; each has one channel, named <prefix>_<suffix>. */
enum fv_message_kind {
    FV_MESSAGE_POSE = 0,      /* of the body in `odom` */
    FV_MESSAGE_POSE_FAST,     /* of the body between frames, where fovea_sense is called */
    FV_MESSAGE_CAMERA_POSE,   /* of the first camera in `odom` */
    FV_MESSAGE_BOT_CORE_POSE, /* of the body in `odom`, as bot_core.pose_t */
    FV_MESSAGE_FEATURES,
    FV_MESSAGE_STATISTICS,
    FV_MESSAGE_CAMERA_STATUS,
    FV_MESSAGE_IMU_STATUS, /* where the rig has an inertial sensor */
    FV_MESSAGE_PREVIEW,
    FV_MESSAGE_DETECTIONS,
    FV_MESSAGE_DETECTIONS2, /* of the second network */
    FV_MESSAGE_MAP,
    FV_MESSAGE_OBJECTS,
    FV_MESSAGE_TENSORS,   /* of the first network, if it has no decoder */
    FV_MESSAGE_TENSORS2,  /* of the second; likewise below */
    FV_MESSAGE_KEYPOINTS, /* if its decoder gives them */
    FV_MESSAGE_KEYPOINTS2,
    FV_MESSAGE_CLASSES,
    FV_MESSAGE_CLASSES2,
    FV_MESSAGE_SEGMENTATION,
    FV_MESSAGE_SEGMENTATION2,
    FV_MESSAGE_EDGES,
    FV_MESSAGE_CALIBRATION_WARNING,
    FV_MESSAGE_GRID, /* free space, where a network labels pixels */
    FV_MESSAGE_SCAN,
    FV_MESSAGE_GRID_HEIGHTS,     /* where grid.heights asks for it */
    FV_MESSAGE_LOCKSTEP,         /* where lockstep_every asks for it */
    FV_MESSAGE_COMMAND,          /* in */
    FV_MESSAGE_COMMAND_RESULT,   /* of the application */
    FV_MESSAGE_VELOCITY_COMMAND, /* in */
    FV_MESSAGE_PARAMETER,        /* in, and in recordings */
    FV_MESSAGE_PARAMETER_RESULT, /* of the application */
    FV_MESSAGE_RUN,              /* likewise */
    FV_MESSAGE_RECORDER,         /* likewise, where record_folder is set */
    FV_MESSAGE_HEALTH,           /* likewise, where frames come by the clock */
    FV_MESSAGE_SETTINGS,         /* in */
    FV_MESSAGE_SETTINGS_RESULT,  /* of the application */
    FV_MESSAGE_MAP_LOAD,         /* in */
    FV_MESSAGE_MAP_FILES,        /* of the application */
    FV_MESSAGE_SAMPLE, /* of the first sensor kind; this and all that follow: in recordings only */
    FV_MESSAGE_FRAME = FV_MESSAGE_SAMPLE + FOVEA_SAMPLE_KIND_COUNT,
    FV_MESSAGE_RECORDING,
    FV_MESSAGE_RECORDING_END,
    FV_MESSAGE_LOADED_MAP,
    FV_MESSAGE_INPUTS,
    FV_MESSAGE_GRANTS,
    FV_MESSAGE_KIND_COUNT
};

/* LCM's header, channel and message of one packet: what is longer is sent in fragments. */
enum { FV_MESSAGE_PACKET_BYTES = 60000 };

enum {
    FV_MESSAGE_CHANNEL_BYTES = 64,
    FV_MESSAGE_NAME_BYTES_MAX = 24, /* of a frame, stage, job or kernel set, with the zero */
    FV_MESSAGE_LABEL_BYTES_MAX = 64 /* of a class, with the zero; longer labels are cut */
};

/* The message of a sample. */
static inline enum fv_message_kind fv_message_of_sample(enum fovea_sample_kind kind)
{
    return (enum fv_message_kind)((int)FV_MESSAGE_SAMPLE + (int)kind);
}

/* Cut a label, at the start of a letter of UTF-8, to what a message holds. */
void fv_message_label(const char *label, char cut[FV_MESSAGE_LABEL_BYTES_MAX]);

/* Compute lcm-gen's type hashes, which it stores in unguarded statics when first used. Init-only.
 */
void fv_message_prepare(void);

/* "FOVEA" and FV_MESSAGE_FEATURES give "FOVEA_FEATURES"; an empty prefix gives "FEATURES". `name`
 * holds FV_MESSAGE_CHANNEL_BYTES. */
void fv_message_channel(const char *prefix, enum fv_message_kind kind, char *name);

/* The stamp of a frame as messages carry it; NULL: no frame yet (time 0, sequence -1). */
fovea_stamp_t fv_message_stamp(const struct fovea_frame *frame, int64_t utc_offset_ns);

/* A rotation and translation, as messages carry them. */
struct fv_message_transform {
    double position[3], orientation[4]; /* unit quaternion w x y z */
};

/* One of the two pose messages; fields and units as in pose_t. What is about a pose is used only
 * when pose->posed. */
struct fv_message_pose {
    fovea_stamp_t stamp;
    const char *parent_frame, *child_frame; /* at most FV_MESSAGE_NAME_BYTES_MAX with the zero */
    const struct fovea_pose *pose;          /* state, scale and counts */
    bool paused;           /* the frame was not processed: state `paused`, no pose and no counts */
    bool uncalibrated;     /* the camera model is a guess */
    bool scale_configured; /* a source of the scale is configured, or an inertial sensor used */
    struct fv_message_transform T_parent_child;
    double covariance[21]; /* of the child */
    bool moving;           /* the next two are known */
    double velocity[3], angular_rate[3];
    double velocity_sigma, angular_rate_sigma; /* of each axis; 0: not known */
    struct fv_message_transform T_keyframe_child;
    bool biased; /* the next three are known */
    double gyro_bias[3], acceleration_bias[3], bias_covariance[21];
    double gravity[3], gravity_sigma; /* 0: not known */
    uint32_t change_count;            /* how often unit or axes of the parent changed in this map */
    double change_scale;
    struct fv_message_transform change;
    struct fv_message_transform T_map_parent;
    int64_t latency_ns;
};
size_t fv_message_pose_size_max(void);
uint32_t fv_message_pose_encode(const struct fv_message_pose *in, uint8_t *buffer, size_t capacity);

/* The same as bot_core.pose_t, for programs that know it. */
struct fv_message_bot_core_pose {
    int64_t utime; /* microseconds */
    double position[3], velocity[3], orientation[4], rotation_rate[3];
};
size_t fv_message_bot_core_pose_size(void);
uint32_t fv_message_bot_core_pose_encode(const struct fv_message_bot_core_pose *in, uint8_t *buffer,
                                         size_t capacity);

struct fv_message_features {
    fovea_stamp_t stamp;
    uint32_t reset_counter;
    int32_t width, height; /* of the raw image */
    uint32_t asked;        /* features granted */
    uint32_t count;        /* of the frame */
    uint32_t first;        /* the first one of this piece */
    const struct fovea_feature *features;
};
/* Of all pieces of a frame with `count_max` features. */
size_t fv_message_features_size_max(uint32_t count_max);
/* Scratch that encoding a piece needs, 8-byte aligned: the message holds one array per member. */
size_t fv_message_features_scratch_bytes(uint32_t count_max);
/* The piece from `first` on: fv_message_features_piece features. */
uint32_t fv_message_features_piece(const struct fv_message_features *in);
uint32_t fv_message_features_encode(const struct fv_message_features *in, void *scratch,
                                    uint8_t *buffer, size_t capacity);

struct fv_message_statistics {
    fovea_stamp_t stamp;
    const char *kernel_set;
    const struct fovea_stats *stats;
    const struct fovea_inputs
        *inputs; /* of the last step: counters and what the application measured */
    const struct fovea_grants *work_grants; /* of the last work */
    const uint32_t *units_done;             /* [FOVEA_JOB_COUNT] in the last work */
    uint32_t jobs_waiting;                  /* bit per job */
    const size_t *memory_bytes;             /* [FOVEA_MEMORY_PART_COUNT] */
    const char *const
        *stage_names; /* [FOVEA_STAGE_COUNT], at most FV_MESSAGE_NAME_BYTES_MAX with the zero */
    const char *const *job_names; /* [FOVEA_JOB_COUNT], likewise */
};
size_t fv_message_statistics_size_max(void);
uint32_t fv_message_statistics_encode(const struct fv_message_statistics *in, uint8_t *buffer,
                                      size_t capacity);

struct fv_message_camera_status {
    fovea_stamp_t stamp; /* of the last frame */
    int64_t now_ns;
    enum fovea_source_state state;
    int32_t width, height;
    const char *pixel_format; /* fovea_pixel_format_name of the last frame */
    int64_t exposure_ns;
    struct fovea_source_counts counts;
};
size_t fv_message_camera_status_size_max(void);
uint32_t fv_message_camera_status_encode(const struct fv_message_camera_status *in, uint8_t *buffer,
                                         size_t capacity);

struct fv_message_fast_pose {
    fovea_stamp_t stamp; /* of the last sample, else of the frame that it goes on from */
    int64_t since_ns;
    uint32_t reset_counter, map_id, change_count;
    struct fv_message_transform T_odom_body;
    double velocity[3], angular_rate[3];
};
size_t fv_message_fast_pose_size_max(void);
uint32_t fv_message_fast_pose_encode(const struct fv_message_fast_pose *in, uint8_t *buffer,
                                     size_t capacity);

/* `stamp` is that of the last frame. */
size_t fv_message_imu_status_size_max(void);
uint32_t fv_message_imu_status_encode(const struct fovea_imu_status *status, fovea_stamp_t stamp,
                                      int64_t now_ns, uint8_t *buffer, size_t capacity);

struct fv_message_preview {
    fovea_stamp_t stamp; /* of the image shown */
    uint32_t camera;
    int32_t width, height;
    double scale; /* raw-image pixels per preview pixel */
    const uint8_t *jpeg;
    uint32_t jpeg_bytes;
};
size_t fv_message_preview_size_max(size_t jpeg_bytes_max);
uint32_t fv_message_preview_encode(const struct fv_message_preview *in, uint8_t *buffer,
                                   size_t capacity);

enum { FV_MESSAGE_EDGE_BYTES_MAX = 46000, FV_MESSAGE_EDGE_SEGMENTS_MAX = 600 };

/* Rows of a bitmap of edges, at most FV_MESSAGE_EDGE_BYTES_MAX bytes of them. */
struct fv_message_edges {
    fovea_stamp_t stamp;
    const struct fovea_edges_config *config;
    int32_t width, height; /* of the image */
    int32_t first_row, row_count;
    const uint8_t *bits; /* (width + 7) / 8 bytes for each row */
    uint32_t segment_count;
    const float (*segments)[4]; /* x y of one end, x y of the other, in pixels */
};
size_t fv_message_edges_size_max(void);
uint32_t fv_message_edges_encode(const struct fv_message_edges *in, uint8_t *buffer,
                                 size_t capacity);

enum { FV_MESSAGE_CALIBRATION_CELLS_MAX = 24 };

/* How well the calibration of the first camera fits. */
struct fv_message_calibration {
    fovea_stamp_t stamp; /* of the last frame that was measured */
    const struct fovea_calibration *calibration;
    uint64_t frames;
    float rms_px, expected_px;
    int32_t columns, rows; /* of the parts of the image, together at most
                              FV_MESSAGE_CALIBRATION_CELLS_MAX */
    float mean_px[FV_MESSAGE_CALIBRATION_CELLS_MAX][2]; /* row after row */
    int32_t samples[FV_MESSAGE_CALIBRATION_CELLS_MAX];
};
size_t fv_message_calibration_size_max(void);
uint32_t fv_message_calibration_encode(const struct fv_message_calibration *in, uint8_t *buffer,
                                       size_t capacity);

enum { FV_MESSAGE_GRID_CELLS_MAX = 56000, FV_MESSAGE_HEIGHTS_CELLS_MAX = 18000 };

/* Rows of a grid of free space, at most FV_MESSAGE_GRID_CELLS_MAX cells of them. */
struct fv_message_grid {
    fovea_stamp_t stamp; /* of the image whose mask came last */
    uint32_t reset_counter, map_id;
    const struct fovea_grid_place *place;
    const struct fovea_ground *ground;
    int32_t first_row, row_count;
    const int8_t *cells;
};
/* For messages of up to `cells` cells. */
size_t fv_message_grid_size_max(uint32_t cells);
uint32_t fv_message_grid_encode(const struct fv_message_grid *in, uint8_t *buffer, size_t capacity);

/* Rows of its heights, at most FV_MESSAGE_HEIGHTS_CELLS_MAX cells of them. */
struct fv_message_heights {
    fovea_stamp_t stamp;
    uint32_t reset_counter, map_id;
    const struct fovea_grid_place *place;
    double floor_m; /* the height of the origin */
    int32_t first_row, row_count;
    const int16_t *heights_mm;
    const uint8_t *counts;
};
/* For messages of up to `cells` cells. */
size_t fv_message_heights_size_max(uint32_t cells);
uint32_t fv_message_heights_encode(const struct fv_message_heights *in, uint8_t *buffer,
                                   size_t capacity);

/* The nearest obstacle by direction, over a whole turn from the body's x axis to its y axis. */
struct fv_message_scan {
    fovea_stamp_t stamp;
    float range_max_m;
    uint32_t count;
    const float *range_m;
};
size_t fv_message_scan_size_max(uint32_t count);
uint32_t fv_message_scan_encode(const struct fv_message_scan *in, uint8_t *buffer, size_t capacity);

struct fv_message_detections {
    fovea_stamp_t stamp; /* of the image that the network took */
    uint32_t reset_counter;
    const char *model;      /* cut as labels are */
    int32_t width, height;  /* of the raw image */
    int8_t rectified_shape; /* enum fv_rectified_shape; -1: none */
    double rectified[4];    /* fx fy cx cy */
    uint32_t count;
    const struct fovea_detection *detections;
    const char *const *names;          /* of the classes, one per detection */
    const float (*rectified_boxes)[4]; /* x_min y_min x_max y_max per detection */
};
/* For labels of at most `label_bytes` bytes, zero not counted. */
size_t fv_message_detections_size_max(uint32_t count_max, size_t label_bytes);
/* Scratch that encoding needs, 8-byte aligned. */
size_t fv_message_detections_scratch_bytes(uint32_t count_max, size_t label_bytes);
uint32_t fv_message_detections_encode(const struct fv_message_detections *in, void *scratch,
                                      uint8_t *buffer, size_t capacity);

/* The first `count` detections with `point_count` keypoints each, in `points` set after set. */
struct fv_message_keypoints {
    fovea_stamp_t stamp;   /* of the image looked at */
    const char *model;     /* cut as labels are */
    int32_t width, height; /* of the raw image */
    uint32_t count, point_count;
    const struct fovea_detection *detections;
    const char *const *names; /* of the classes, one per detection */
    const struct fovea_keypoint *points;
};
size_t fv_message_keypoints_size_max(uint32_t sets, uint32_t points); /* points of each set */
/* Scratch that encoding needs, 8-byte aligned. */
size_t fv_message_keypoints_scratch_bytes(uint32_t sets, uint32_t points);
uint32_t fv_message_keypoints_encode(const struct fv_message_keypoints *in, void *scratch,
                                     uint8_t *buffer, size_t capacity);

/* Classes of the whole image: of the detections only class and score are read. */
enum { FV_MESSAGE_CLASSES_MAX = 100 };
struct fv_message_classes {
    fovea_stamp_t stamp; /* of the image looked at */
    const char *model;   /* cut as labels are */
    uint32_t count;      /* at most FV_MESSAGE_CLASSES_MAX */
    const struct fovea_detection *detections;
    const char *const *names; /* of the classes, one per detection */
};
size_t fv_message_classes_size_max(uint32_t count_max);
uint32_t fv_message_classes_encode(const struct fv_message_classes *in, uint8_t *buffer,
                                   size_t capacity);

/* A mask, from row `*row` on. Of more than FV_MESSAGE_SEGMENTS_MAX classes those that most pixels
 * have are sent, the first of equal ones; pixels of the others as of no class. */
enum { FV_MESSAGE_SEGMENTS_MAX = 64 };
struct fv_message_segmentation {
    fovea_stamp_t stamp;                               /* of the image looked at */
    const char *model;                                 /* cut as labels are */
    const char *names[FOVEA_SEGMENTATION_CLASSES_MAX]; /* of the list's classes */
    const struct fovea_segmentation *seen;             /* rows of at most 12,000 pixels */
};
size_t fv_message_segmentation_size_max(void);
/* Scratch that encoding needs, 4-byte aligned. */
size_t fv_message_segmentation_scratch_bytes(void);
/* As many rows as one message holds; `*row` moves on by them. */
uint32_t fv_message_segmentation_encode(const struct fv_message_segmentation *in, int32_t *row,
                                        void *scratch, uint8_t *buffer, size_t capacity);

/* Raw outputs of a network, or pieces of them. */
enum { FV_MESSAGE_TENSORS_MAX = 16, FV_MESSAGE_TENSOR_BYTES_MAX = 50000 };
struct fv_message_tensor {
    struct fovea_tensor tensor; /* the whole, of no 64-bit type; its `data` is not read */
    size_t first_byte, size_bytes;
    const uint8_t *data; /* of the piece */
};
struct fv_message_tensors {
    fovea_stamp_t stamp; /* of the image that the network took */
    const char *model;   /* cut as labels are */
    uint32_t count;
    struct fv_message_tensor pieces[FV_MESSAGE_TENSORS_MAX];
};
/* A message with at most FV_MESSAGE_TENSOR_BYTES_MAX bytes of data fits FV_MESSAGE_PACKET_BYTES. */
uint32_t fv_message_tensors_encode(const struct fv_message_tensors *in, uint8_t *buffer,
                                   size_t capacity);

/* A piece of the map: places [first, last) of each pool, and what is in them. */
enum { FV_MESSAGE_MAP_LANDMARKS = 256, FV_MESSAGE_MAP_KEYFRAMES = 8 };
struct fv_message_landmark {
    int32_t slot, map_id;
    float point[3];
};
struct fv_message_keyframe {
    int32_t slot, map_id, parent;
    int64_t number, stamp_ns;
    float position[3], orientation[4]; /* T_own_cam, quaternion w x y z */
};
struct fv_message_map {
    fovea_stamp_t stamp;
    int32_t map_id;
    double own_scale;                /* S_map_own */
    struct fv_message_transform own; /* likewise */
    int32_t landmark_slots, landmark_first, landmark_last;
    int32_t keyframe_slots, keyframe_first, keyframe_last;
    uint32_t landmark_count, keyframe_count;
    struct fv_message_landmark landmarks[FV_MESSAGE_MAP_LANDMARKS];
    struct fv_message_keyframe keyframes[FV_MESSAGE_MAP_KEYFRAMES];
};
size_t fv_message_map_size_max(void);
uint32_t fv_message_map_encode(const struct fv_message_map *in, uint8_t *buffer, size_t capacity);

struct fv_message_objects {
    fovea_stamp_t stamp; /* of the image that the network took */
    uint32_t reset_counter;
    int32_t width, height;   /* of the raw image */
    double T_odom_world[12]; /* row-major 3x4: from the frame that located objects are in */
    uint32_t count;
    const struct fovea_object *objects;
    const char *const *names; /* of the classes, one per object */
};
size_t fv_message_objects_size_max(uint32_t count_max, size_t label_bytes);
/* Scratch that encoding needs, 8-byte aligned. */
size_t fv_message_objects_scratch_bytes(uint32_t count_max, size_t label_bytes);
uint32_t fv_message_objects_encode(const struct fv_message_objects *in, void *scratch,
                                   uint8_t *buffer, size_t capacity);

#ifdef __cplusplus
}
#endif
#endif

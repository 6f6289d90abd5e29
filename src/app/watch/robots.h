/* What is heard of running robots, by prefix: state, rates, times, deadlines. Fed by a receiver's
 * rows; clock readings come from the caller. What a network claims takes no more memory than one
 * struct fv_robots: robots beyond its room are counted. One thread. */
#ifndef FOVEA_APP_WATCH_ROBOTS_H
#define FOVEA_APP_WATCH_ROBOTS_H

#include <stdbool.h>
#include <stdint.h>

#include "app/network/receiver.h"

enum {
    FV_ROBOTS_MAX = 32,
    FV_ROBOT_STAGES_MAX = 24,
    FV_ROBOT_NAME_BYTES = 32,
    FV_ROBOT_FAULT_BYTES = 256,
    FV_ROBOT_ROWS = 5 /* of the receiver's table */
};
#define FV_ROBOT_SILENT_NS INT64_C(3000000000) /* heard last so long ago: it is silent */
#define FV_ROBOT_GONE_NS INT64_C(60000000000)  /* it is forgotten */

struct fv_robot_stage {
    char name[FV_ROBOT_NAME_BYTES];
    double sum_ms;  /* of wall time, in the window that goes on */
    double mean_ms; /* of the last whole window */
};

/* Numbers that are not known are NaN, and -1 for states. */
struct fv_robot {
    char prefix[FV_MESSAGE_CHANNEL_BYTES];
    int64_t heard_ns; /* last; readings of the caller's clock here and below */
    bool from_host;   /* the last message was of this host */

    /* FOVEA_RUN */
    int64_t run_id;    /* 0: not heard */
    uint32_t restarts; /* other run_ids since the first */
    char host[FV_ROBOT_NAME_BYTES], version[FV_ROBOT_NAME_BYTES];
    int64_t process;

    /* POSE */
    int state, scale_state;
    int64_t state_since_ns;
    int32_t inliers, map_id, reset_counter;
    double quality, latency_ms;
    double position[3];

    /* CAMERA_STATUS */
    int camera_state;
    int32_t width, height;

    /* STATISTICS */
    bool counted; /* one has come since the start of this run */
    int64_t processed, late, dropped, damaged, refused;
    int64_t resident_bytes;
    double temperature_c;

    /* HEALTH: the worst of its parts, and which have a fault: "host degraded: 74 degrees; ..." */
    int health;
    char faults[FV_ROBOT_FAULT_BYTES];

    /* Of the last whole window, and the one that goes on. */
    double frames_hz, poses_hz, frame_mean_ms, frame_max_ms, late_hz;
    int64_t window_ns; /* when it began; 0: none has. Counts that fall begin a new one */
    bool window_first; /* the first count of all came in it: the next gives a rate */
    double window_processed, window_late, window_sum_ms, window_max_ms;
    uint32_t window_poses, window_times;
    uint32_t stage_count;
    struct fv_robot_stage stages[FV_ROBOT_STAGES_MAX];
};

struct fv_robots {
    int64_t now_ns;    /* set by the caller before messages are handed over */
    int64_t window_ns; /* length of a window */
    uint32_t count;
    struct fv_robot robots[FV_ROBOTS_MAX]; /* by prefix, in the order of strcmp */
    uint64_t crowded;                      /* messages for which there was no room */
};

void fv_robots_init(struct fv_robots *robots, int64_t window_ns);

/* Rows for the robots whose prefix fits `prefix`, which may be a pattern; their context is
 * `robots`. FOVEA_ERROR_INPUT: it is too long. */
enum fovea_status fv_robots_rows(struct fv_robots *robots, const char *prefix,
                                 struct fv_receiver_channel rows[FV_ROBOT_ROWS],
                                 struct fovea_error *error);

/* End the windows that are over at robots->now_ns, and forget who is gone. */
void fv_robots_tick(struct fv_robots *robots);

/* "tracking", "late", "metric"; "?" for a number without a name. */
const char *fv_robot_state_name(int state);
const char *fv_robot_camera_name(int camera_state);
const char *fv_robot_scale_name(int scale_state);
const char *fv_robot_health_name(int health);

#endif

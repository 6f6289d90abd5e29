/* The inside of struct fovea: what lies in the block, and who owns what. */
#ifndef FOVEA_RUNTIME_STATE_H
#define FOVEA_RUNTIME_STATE_H

#include "base/arena.h"
#include "base/elementary.h"
#include "features/front_end.h"
#include "fovea/fovea.h"
#include "inertial/gate.h"
#include "kernels/kernels.h"
#include "message/message.h"
#include "odometry/odometry.h"
#include "runtime/detection.h"
#include "runtime/boxes.h"
#include "runtime/calibration.h"
#include "runtime/edges.h"
#include "runtime/sense.h"
#include "runtime/frame_id.h"
#include "runtime/free_space.h"
#include "runtime/ground.h"
#include "runtime/lockstep.h"
#include "runtime/preview.h"
#include "runtime/publish.h"
#include "runtime/relative.h"
#include "runtime/objects.h"
#include "scale/inertial.h"
#include "scale/scale.h"
#include "stereo/stereo.h"

/* What the runtime itself remembers from frame to frame. No addresses and no padding: copied and
 * hashed as bytes. */
struct fv_state {
    struct fv_frame_id frame; /* the last processed one */
    uint64_t steps;           /* since fovea_init; the clock of decimation */
    uint64_t frames_in, frames_processed, steps_without_frame;
    uint64_t refused_stamp, refused_format, refused_paused;
    struct fv_random random;
    uint32_t reset_counter;
    uint32_t features;
    uint32_t map_landmark, map_keyframe; /* from where the next piece of the map is sent */
    uint32_t any_frame; /* a frame was processed since the start or the last reset */
    uint32_t paused;
};

/* Clock readings: kept apart from the state, since they must not be hashed. */
struct fv_times {
    int64_t cpu_ns[FOVEA_STAGE_COUNT], wall_ns[FOVEA_STAGE_COUNT];
};

/* Buffers and channels of the messages that go out. */
struct fv_outbox {
    char channel[FV_MESSAGE_KIND_COUNT][FV_MESSAGE_CHANNEL_BYTES];
    uint8_t *buffer[FV_MESSAGE_KIND_COUNT]; /* NULL: a kind that the runtime does not send */
    size_t capacity[FV_MESSAGE_KIND_COUNT];
    void *features_scratch;
};

/* Block being carved: the arenas of its parts, and the memory table that is kept of them. */
struct fv_carving {
    struct fv_arena arenas[FOVEA_MEMORY_PART_COUNT];
    size_t booked[FOVEA_MEMORY_PART_COUNT]; /* bytes that have an owner */
    struct fovea_memory_table *table;       /* NULL: none is kept */
    struct fv_lockstep *lockstep;           /* likewise, who owns which memory */
};

/* Book what was taken since the last call as `owner`'s, part by part. */
void fv_carving_book(struct fv_carving *carving, const char *owner);

enum { FV_JOB_PIECES_MAX = 4 };

struct fovea {
    struct fovea_config config;  /* in force; masks point at the copies below */
    struct fovea_config started; /* that of fovea_init, from which everything is carved */
    struct fv_kernels kernels;
    uint8_t *part_base[FOVEA_MEMORY_PART_COUNT];
    size_t part_bytes[FOVEA_MEMORY_PART_COUNT];
    size_t block_bytes;

    struct fv_state *state;
    struct fv_plane masks[FOVEA_CAMERAS_MAX]; /* by camera; pixels NULL: none */
    struct fv_front_end front_end;            /* of the first camera */
    /* of the second camera, and distances by both; where fv_config_stereo */
    struct fv_front_end second_front_end;
    struct fv_stereo stereo;
    bool stereo_used;
    uint32_t distances;           /* measured in the last frame; follows from it */
    struct fovea_feature *placed; /* of a rolling shutter beside an inertial sensor; else NULL */
    struct fv_imu_gate imu;       /* where the rig has an inertial sensor */
    struct fv_sense *sense;       /* where odometry uses it; not hashed */
    struct fv_odometry odometry;
    struct fv_detection detection, detection2; /* objects use the first */
    struct fv_object_stage objects;
    struct fv_free_space free_space;   /* from the first of the networks that labels pixels */
    struct fv_ground_stage ground;     /* that it lies on */
    struct fv_inertial_stage inertial; /* where fv_config_inertial */
    struct fv_scale scale;
    struct fv_publish publish;
    struct fv_relative relative;
    struct fv_boxes boxes;
    struct fv_preview preview;
    struct fv_edge_stage edges;
    struct fv_calibration calibration;                    /* carved where calibration.check is on */
    void *job_pieces[FOVEA_JOB_COUNT][FV_JOB_PIECES_MAX]; /* what a job carved for itself alone */
    struct fv_outbox outbox;

    /* Of the last step and work, for the statistics message; clocks or copies of inputs, never
     * hashed. */
    struct fv_times times;
    struct fovea_inputs inputs;
    struct fovea_grants work_grants;
    uint32_t units_done[FOVEA_JOB_COUNT];
    struct fv_lockstep lockstep;
};

/* How often the world of the poses became another: by command, or since the camera was lost. */
static inline uint32_t fv_reset_counter(const struct fovea *rt)
{
    return rt->config.odometry.enabled ? fv_odometry_reset_counter(&rt->odometry)
                                       : rt->state->reset_counter;
}

/* Whether the n-th of something is due when every period-th is; never for period 0. */
static inline bool fv_every(uint64_t n, uint32_t period)
{
    return period != 0 && n % period == 0;
}

/* Messages of a step that processed a frame, or of one that had none. `interrupted`: the pose
 * became `lost` without a frame, which is published at once, with the stamp of the last frame. */
void fv_encode(struct fovea *rt, const struct fovea_inputs *inputs, bool processed,
               bool interrupted, struct fovea_outputs *outputs);

#endif

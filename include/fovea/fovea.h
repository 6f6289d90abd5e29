/* The runtime: one block of memory, one loop.
 *
 *     struct fovea_config config;
 *     fovea_config_default(&config);
 *     config.rig.cameras[0].camera = ...;  // the calibration, through fovea_camera_prepare
 *     size_t bytes;
 *     fovea_size(&config, &bytes, &error);
 *     void *memory = aligned_alloc(FOVEA_BLOCK_ALIGNMENT, bytes);
 *     struct fovea *rt;
 *     fovea_init(memory, bytes, &config, &rt, &error);
 *     for (;;) {
 *         wait for a frame;
 *         fovea_step(rt, &inputs, &outputs);   publish outputs;
 *         fovea_work(rt, &grants, &outputs);   publish outputs;
 *         give the frame back;
 *     }
 *
 * The caller owns the block; there is nothing to destroy. After fovea_init no function here calls
 * the heap, takes a lock, logs or makes a system call (other than through the clock of the
 * configuration, if it has one). fovea_step and fovea_work are functions of (state, inputs,
 * grants): same bits in, same bits out, on every processor. The block may be moved or copied only
 * through fovea_copy, since it holds addresses of itself.
 *
 * Unless its comment says otherwise, a function that takes a runtime or a governor belongs to the
 * loop thread and is real-time safe; any other may be called on any thread. */
#ifndef FOVEA_FOVEA_H
#define FOVEA_FOVEA_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "fovea/camera.h"
#include "fovea/detect.h"
#include "fovea/edges.h"
#include "fovea/features.h"
#include "fovea/free_space.h"
#include "fovea/image.h"
#include "fovea/odometry.h"
#include "fovea/preprocess.h"
#include "fovea/rig.h"
#include "fovea/segmentation.h"
#include "fovea/sensor.h"
#include "fovea/source.h"
#include "fovea/status.h"
#include "fovea/objects.h"

#ifdef __cplusplus
extern "C" {
#endif

/* The one place of the version: the Makefile reads it for the soname, pkg-config and man pages. */
#define FOVEA_VERSION "0.2.0"

enum { FOVEA_BLOCK_ALIGNMENT = 64 };

/* ---- configuration --------------------------------------------------------------------------- */

/* Ranges and defaults are repeated here for the reader; docs/configuration.md has the same. */

/* Wall and thread-CPU clock for stage times; called twice per stage. Never influences results. */
typedef void (*fovea_clock_function)(void *context, int64_t *wall_ns, int64_t *cpu_ns);

struct fovea_preview_config {
    /* [0, 1000000], default 10: one preview every n-th frame; 0: none */
    uint32_t period_frames;
    uint32_t quality; /* [1, 100], default 70: JPEG quality in libjpeg's scale */
    /* [0, 7], default 2: pyramid level that is shown, less than features.pyramid_levels */
    uint32_t level;
    /* [1, 4], default 1: how many cameras, from the first, are shown in turn */
    uint32_t cameras;
    /* default false: the borders between the classes of the last mask are drawn into it, that of
     * detect.model or else of detect2.model, whose image may be some frames older */
    bool segmentation;
};

/* Bitmaps of edges, published as edges_t. */
struct fovea_edge_job_config {
    /* [0, 1000000], default 0: edges of every n-th frame, or less often where they take longer than
     * n frames; 0: none */
    uint32_t period_frames;
    struct fovea_edges_config edges;
    /* default false: find the line segments too (fovea/segments.h), at most 600, which stand in the
     * last message of the image */
    bool segments;
    double segment_length_min_px; /* [0, 10000], default 15: shorter ones are left out */
};

/* Who may look at the images. Flags of struct fovea_image_config. */
enum fovea_viewer {
    FOVEA_VIEWER_FEATURES = 1 << 0, /* and so odometry and map */
    FOVEA_VIEWER_NETWORKS = 1 << 1,
    FOVEA_VIEWER_PREVIEW = 1 << 2,
    FOVEA_VIEWER_EDGES = 1 << 3
};
enum { FOVEA_VIEWERS_ALL = 15 };

/* What is done to the images of the first camera before anybody looks at them. Recordings keep
 * them as the camera gave them. */
struct fovea_image_config {
    /* Default: no operations. Run in the step, in time proportional to the pixels.
     * FOVEA_OPERATION_WHITE_BALANCE changes no grey levels: networks of colours that see the result
     * get balanced colours, after the other operations, by the means of a grid of 160 x 120 pixels,
     * in at most two units more of the network's job. It is refused where networks do not see the
     * result. */
    struct fovea_preprocess_config preprocess;
    /* FOVEA_VIEWER_* bits, default FOVEA_VIEWER_FEATURES: who sees the result; the others see the
     * image as it came. Networks keep the colours of an image: only its luma is that of the result.
     */
    uint32_t seen_by;
};

struct fovea_calibration_config {
    bool check; /* default true: watch whether the calibration still fits (fovea_calibration_get) */
};

struct fovea_config {
    /* The cameras, each with its mask, and the inertial sensor. Default: one camera at the
     * origin of the body, whose calibration the caller fills in. Odometry uses the first
     * camera: it must be calibrated, have a T_body_cam (default identity), and give images of
     * its calibration's width x height; and the second, where it has all that too and
     * odometry.sensors allows. Masks are copied by fovea_init. */
    struct fovea_rig rig;
    struct fovea_image_config image;
    struct fovea_features_config features;
    struct fovea_odometry_config odometry;
    struct fovea_detect_config detect;
    /* Of a second network beside the first, which must then have a model too. Both share the units
     * of FOVEA_JOB_DETECT. Objects follow from the first alone. */
    struct fovea_detect_config detect2;
    struct fovea_scale_config scale;
    struct fovea_objects_config objects; /* detected objects, followed over images */
    struct fovea_preview_config preview;
    struct fovea_edge_job_config edge_job;
    struct fovea_calibration_config calibration;
    struct fovea_grid_job_config grid_job;
    uint64_t seed; /* of the random generator in the state, default 1 */

    /* A map to start with, saved with the same camera; NULL: none. Read by fovea_init only. Errors
     * contain the name, for example the file's path. */
    const uint8_t *map;
    size_t map_bytes;
    const char *map_name;

    /* [1, 31] bytes of letters, digits and _ / . -, default "FOVEA": put before channel names. */
    char channel_prefix[32];

    /* Publish every n-th message of a kind; 0: never. */
    uint32_t pose_every;          /* [0, 1000000], default 1 */
    uint32_t features_every;      /* [0, 1000000], default 1 */
    uint32_t statistics_every;    /* [0, 1000000], default 30 */
    uint32_t camera_status_every; /* [0, 1000000], default 1 */
    uint32_t map_every;           /* [0, 1000000], default 5 */
    uint32_t lockstep_every;      /* [0, 1000000], default 0: none; hashes all of the state */

    /* degrees, [0, 170], default 0; above 0: the calibration of the first camera is a guess from
     * its horizontal field of view, which the caller made; poses are marked `uncalibrated`. */
    double camera_fov_deg;

    /* Controls that the cameras have (fovea_source_ops.control), set by the application, before the
     * step that takes it; no result depends on it but by the frames. */
    double camera_exposure_ms; /* [0, 10000], default 0: as the source has it */
    double camera_gain;        /* [-1, 1000000000], default -1: likewise */

    /* Stage clock, or NULL for no stage times. */
    fovea_clock_function clock;
    void *clock_context;
};

void fovea_config_default(struct fovea_config *config);

/* ---- set-up ---------------------------------------------------------------------------------- */

struct fovea; /* the runtime's state, at the start of the block */

/* Bytes that fovea_init will need for this configuration. The number comes from running the same
 * carving code without memory, so the two cannot disagree. Checks the whole configuration.
 * Init-only. FOVEA_ERROR_ARGUMENT: `error` names the member, what was found and the range. */
enum fovea_status fovea_size(const struct fovea_config *config, size_t *bytes,
                             struct fovea_error *error);

/* Build the runtime inside `memory` (FOVEA_BLOCK_ALIGNMENT aligned, at least fovea_size bytes;
 * every byte of it is written), with the best kernels that the processor has, or those of the set
 * that the environment's FOVEA_CPU names (src/README.md). Init-only. On error nothing is usable and
 * `*rt` is untouched. */
enum fovea_status fovea_init(void *memory, size_t bytes, const struct fovea_config *config,
                             struct fovea **rt, struct fovea_error *error);

/* The three parts of the block. */
enum fovea_memory_part {
    FOVEA_MEMORY_PERSISTENT = 0, /* state that lives from frame to frame */
    FOVEA_MEMORY_JOB = 1,        /* data of jobs in progress */
    FOVEA_MEMORY_FRAME = 2,      /* scratch, rewritten by each step */
    FOVEA_MEMORY_PART_COUNT
};

struct fovea_memory_row {
    char owner[24]; /* stage or job */
    enum fovea_memory_part part;
    size_t bytes;
};

enum { FOVEA_MEMORY_ROWS_MAX = 48 };

/* The memory table: how much of the block each stage and job takes. Rows add up to the block,
 * padding included. Any thread. */
struct fovea_memory_table {
    uint32_t count;
    struct fovea_memory_row rows[FOVEA_MEMORY_ROWS_MAX];
};
enum fovea_status fovea_memory(const struct fovea_config *config, struct fovea_memory_table *table,
                               struct fovea_error *error);

/* ---- the loop -------------------------------------------------------------------------------- */

/* The one list of jobs that fovea_work advances, in order of priority:
 *   map      new landmarks, then window optimisation
 *   detect   one or two networks that find objects
 *   closure  closures found, maps merged
 *   preview  JPEG of a pyramid level
 *   edges    bitmaps of edges
 *   calibration  whether the calibration still fits the pictures
 * From a row (constant, name) follow the constant FOVEA_JOB_MAP, the job's name and its stage; the
 * rest stands in the job's own file (src/runtime/jobs.h). */
#define FOVEA_JOBS(ROW)                                                                            \
    ROW(MAP, map)                                                                                  \
    ROW(DETECT, detect)                                                                            \
    ROW(CLOSURE, closure)                                                                          \
    ROW(PREVIEW, preview)                                                                          \
    ROW(EDGES, edges)                                                                              \
    ROW(CALIBRATION, calibration)

enum fovea_job {
#define FOVEA_JOB_CONSTANT(NAME, name) FOVEA_JOB_##NAME,
    FOVEA_JOBS(FOVEA_JOB_CONSTANT)
#undef FOVEA_JOB_CONSTANT
        FOVEA_JOB_COUNT
};

/* What the governor allows: the only way in which time influences results. Recorded with every
 * frame. */
struct fovea_grants {
    uint32_t features; /* most features of this step, up to config.features.count_max */
    /* By job. A unit is bounded work, 0.25 ms and less as a rule on a desktop processor; how many
     * instructions each kind can take stands in docs/bounds.md. */
    uint32_t units[FOVEA_JOB_COUNT];
};

/* Commands, as bits, taken at the start of a step. */
enum fovea_command {
    /* discard everything learnt since fovea_init; the reset counter rises. A save that is under way
     * begins again, where the map is discarded */
    FOVEA_COMMAND_RESET = 1,
    FOVEA_COMMAND_PAUSE = 2, /* frames are counted but not processed until resumed */
    FOVEA_COMMAND_RESUME = 4,
    /* save the map, in units of the map's job, to the buffer of fovea_map_save_to */
    FOVEA_COMMAND_SAVE = 8,
    /* for the application that writes the saved map to a file; a step ignores it */
    FOVEA_COMMAND_OVERWRITE = 16,
    /* for the application that records, which keeps them from steps */
    FOVEA_COMMAND_RECORD = 32,
    FOVEA_COMMAND_RECORD_STOP = 64,
};

enum { FOVEA_INPUT_BOXES_MAX = 64 };

/* Box around an object that may move on its own: raw-image pixels, max exclusive. */
struct fovea_box {
    float x_min_px, y_min_px, x_max_px, y_max_px;
};

/* A map that fovea_map_prepare has read and checked. */
struct fovea_ready_map;

struct fovea_inputs {
    const struct fovea_frame *frame; /* NULL: none this time */
    int64_t now_ns; /* on the frames' clock: this frame's stamp, or when it was due */
    enum fovea_source_state source_state;
    struct fovea_source_counts source_counts;
    uint32_t commands;     /* enum fovea_command bits */
    int64_t utc_offset_ns; /* add to a stamp to get UTC; 0 where not known; copied into messages */
    struct fovea_grants grants;

    /* Samples of sensors that have come since the last step, in the order of their stamps, at most
     * FOVEA_INPUT_SAMPLES_MAX. Owned by the caller; not read after the step. */
    uint32_t sample_count;
    const struct fovea_sample *samples;

    /* Moving objects of an image: features in their boxes never enter the map. The image may be
     * this frame's or an earlier one, whose boxes grow with their age. */
    bool has_boxes; /* false: no new boxes */
    int64_t boxes_stamp_ns;
    uint32_t box_count;
    struct fovea_box boxes[FOVEA_INPUT_BOXES_MAX];

    /* Values in force from this step on; NULL: those that were. Only live parameters are taken
     * (docs/configuration.md marks them): all of them, or none where fovea_parameters_check refuses
     * the values. Owned by the caller; not read after the step. */
    const struct fovea_config *parameters;

    /* A map in place of the one that is there, from this step on, after `commands`; NULL: none. The
     * reset counter rises; the state is `lost` until the camera is found in the map, whose maps get
     * ids and keyframes numbers that this runtime has not used yet. A save that is under way begins
     * again. Prepared for this runtime or another one of the same configuration: one for other
     * sizes is left, one for another camera of the same size is not noticed. Not taken where
     * odometry is off. It takes the time that copying it takes (65 keyframes: .8 ms). Owned by the
     * caller; not read after the step. */
    const struct fovea_ready_map *map;

    /* Measured by the application, never used for results. Every pose message and the statistics
     * message state the latency, the statistics message alone the rest. */
    int64_t latency_ns;  /* from the stamp to the call of fovea_step; 0: unknown */
    float temperature_c; /* of the processor; NaN where unknown */
    uint64_t resident_bytes;
    uint64_t frames_late; /* dropped because the loop was busy */
};

/* One encoded LCM message, in memory of the block, valid until the next fovea_step or fovea_work.
 */
struct fovea_message {
    const char *channel;
    const uint8_t *data;
    uint32_t bytes;
    bool volatile_values; /* holds clock readings, which are left out when replays are compared */
};

enum { FOVEA_MESSAGES_MAX = 16 };

struct fovea_outputs {
    uint32_t message_count;
    struct fovea_message messages[FOVEA_MESSAGES_MAX];
    uint32_t units_done[FOVEA_JOB_COUNT];
    uint32_t jobs_waiting; /* bit per job: has units left to do */
    size_t map_bytes;      /* bytes of the map that this work finished saving; 0: none */
};

/* Process one frame, or note that there is none. FOVEA_OK: processed. FOVEA_AGAIN: nothing to
 * process (no frame, paused, or refused: stamp not after the last one, wrong size or format;
 * counted in the statistics). Never fails on data. `outputs` is overwritten. Loop thread. */
enum fovea_status fovea_step(struct fovea *rt, const struct fovea_inputs *inputs,
                             struct fovea_outputs *outputs);

/* Carry the last frame's pose on by samples of the inertial sensor that have come since, for
 * controllers: with each sample or a few. FOVEA_OK: `outputs` holds one message, the pose at the
 * last of them (fast_pose_t). FOVEA_AGAIN: none, since the last frame has no pose that the sensor
 * can carry on, or samples lacked since. The same samples are inputs of the next step all the same:
 * results of steps do not depend on these calls. `outputs` is overwritten and valid until the next
 * call. Some microseconds, wait-free. One thread at a time, while steps and works may run on the
 * loop's; not while the runtime is copied. */
enum fovea_status fovea_sense(struct fovea *rt, const struct fovea_sample *samples, uint32_t count,
                              struct fovea_outputs *outputs);

/* Advance the jobs by at most the granted units. `outputs` is overwritten. Loop thread.
 * FOVEA_AGAIN: units are left. */
enum fovea_status fovea_work(struct fovea *rt, const struct fovea_grants *grants,
                             struct fovea_outputs *outputs);

/* Whether a step takes these values of the live parameters; no other member of `config` is looked
 * at. Any thread. FOVEA_ERROR_ARGUMENT: `error` names the key, what was found and what was
 * expected. FOVEA_ERROR_UNSUPPORTED: the values are right, but this runtime was built without
 * memory for them, which takes a restart. */
enum fovea_status fovea_parameters_check(const struct fovea *rt, const struct fovea_config *config,
                                         struct fovea_error *error);

/* The configuration as it is in force: that of fovea_init with the live parameters that steps have
 * taken. Valid until the next step. */
const struct fovea_config *fovea_config_get(const struct fovea *rt);

/* Features of the last processed frame, in memory of the block, valid until the next fovea_step. */
const struct fovea_feature *fovea_features_get(const struct fovea *rt, uint32_t *count);

/* Pose of the last processed frame, as published. */
void fovea_pose_get(const struct fovea *rt, struct fovea_pose *pose);

/* Motion since the frame that was processed `frames` before the last one, with its covariance.
 * False, and `relative` zero: more than FOVEA_RELATIVE_FRAMES_MAX, one of both frames has no pose,
 * or their poses do not relate (another map, another unit, a reset in between). Bounded. Loop
 * thread. */
bool fovea_relative_pose_get(const struct fovea *rt, uint32_t frames,
                             struct fovea_relative_pose *relative);

/* Detections of the last completed inference of the network; `inferences` is 0 without one. Valid
 * until the next fovea_work. */
void fovea_detections_get(const struct fovea *rt, struct fovea_detections *detections);

/* The mask of the last completed inference of a network (0 the first, 1 the second) whose decoder
 * gives one; `inferences` is 0 without one. Valid until the next fovea_work. */
void fovea_segmentation_get(const struct fovea *rt, uint32_t network,
                            struct fovea_segmentation *segmentation);

/* The objects as of the last completed inference; `updates` is 0 without one. Valid until the next
 * fovea_work. */
void fovea_objects_get(const struct fovea *rt, struct fovea_objects *objects);

/* Name of a class of the configured model, "" where it has none. Any thread. */
const char *fovea_detect_label(const struct fovea *rt, int32_t class_id);

/* The same of the second network, detect2. */
void fovea_detections2_get(const struct fovea *rt, struct fovea_detections *detections);
const char *fovea_detect2_label(const struct fovea *rt, int32_t class_id);

enum fovea_calibration_state {
    FOVEA_CALIBRATION_OK = 0, /* or not known yet */
    FOVEA_CALIBRATION_DOUBTFUL,
    FOVEA_CALIBRATION_WRONG
};

enum fovea_calibration_cause {
    FOVEA_CALIBRATION_NOTHING = 0,
    FOVEA_CALIBRATION_CHANGED, /* the lens is another than before: knocked, focused anew */
    FOVEA_CALIBRATION_UNFIT /* the motion of the pictures fits another focal length, or a map that
                               was not steady before does */
};

enum { FOVEA_CALIBRATION_REASON_BYTES = 128 };

struct fovea_calibration {
    enum fovea_calibration_state state;
    enum fovea_calibration_cause cause;
    /* Natural logarithm of the focal length that fits over that of the calibration; large values
     * are one step of Newton only, and too large or too small. */
    double focal_difference;
    char reason[FOVEA_CALIBRATION_REASON_BYTES]; /* a sentence; "" while nothing is wrong */
};

/* Whether the calibration of the first camera fits what odometry sees (calibration.check). A
 * verdict stands until the next reset. Loop thread. */
void fovea_calibration_get(const struct fovea *rt, struct fovea_calibration *calibration);

/* What became of the samples of the inertial sensor, as of the last step. Loop thread. */
void fovea_imu_status_get(const struct fovea *rt, struct fovea_imu_status *status);

/* Metres per unit of a map, as its poses in `fovea_keyframe` are: of the map as a whole, where
 * `fovea_pose.scale` is that of the place; 0: not known, or no such map. Bounded. Loop thread. */
double fovea_map_scale_get(const struct fovea *rt, uint32_t map_id);

/* Keyframes of the map by slot, the first `count_max` of odometry.keyframes slots; returns how many
 * were written. A slot whose number has changed holds another keyframe. Bounded. Loop thread. */
uint32_t fovea_keyframes_get(const struct fovea *rt, struct fovea_keyframe *list,
                             uint32_t count_max);

/* ---- the governor ---------------------------------------------------------------------------- */

/* Grants of the fixed schedule, for recorded input at full speed: all features, and for each job a
 * constant number of units. */
void fovea_grants_fixed(const struct fovea_config *config, struct fovea_grants *grants);

/* Grants from measured time, for frames that come by the clock. A plain struct owned by the
 * application, outside the block, since clocks must not touch the state. */
struct fovea_governor {
    int64_t period_ns;
    uint32_t features, features_max, features_min;
    int64_t unit_ns[FOVEA_JOB_COUNT]; /* running estimate of a unit's CPU time */
    int64_t step_ns;                  /* running estimate of a step's CPU time */
    uint32_t short_frames, ample_frames;
};

void fovea_governor_init(struct fovea_governor *governor, const struct fovea_config *config,
                         int64_t period_ns);
/* Grants for the next step and work. Features are lowered when frames stay too slow, and raised
 * when they stay fast. */
void fovea_governor_next(struct fovea_governor *governor, const struct fovea_config *config,
                         struct fovea_grants *grants);
/* Lower `grants->units` to what is left of the period after the step took `step_ns`; minimum kept.
 */
void fovea_governor_work(struct fovea_governor *governor, int64_t step_ns, uint32_t jobs_waiting,
                         struct fovea_grants *grants);
/* Update the estimates from the measured times of a step and its work. */
void fovea_governor_learn(struct fovea_governor *governor, int64_t step_ns, int64_t work_ns,
                          const struct fovea_outputs *work_outputs);

/* ---- saving maps ----------------------------------------------------------------------------- */

/* A saved map holds the grid of free space as well, where there is one with cells that are known
 * and static: a runtime that loads it takes it up once it is posed in that map, in metres.
 *
 * Most bytes that a saved map of this configuration takes. Any thread. */
size_t fovea_map_bytes_max(const struct fovea_config *config);

/* The caller's buffer for FOVEA_COMMAND_SAVE, not to be touched until outputs.map_bytes is not 0;
 * NULL: do not save. It is outside the state: runs with and without a buffer are equal. A buffer
 * that is too small gets what fits, and outputs.map_bytes is larger than `bytes`. Loop thread,
 * real-time safe. */
void fovea_map_save_to(struct fovea *rt, uint8_t *buffer, size_t bytes);

/* Write the checksum that turns saved bytes into a map file; fewer bytes than a checksum stay
 * unchanged. Any thread; not for the loop, since it reads all bytes. */
void fovea_map_seal(uint8_t *data, size_t bytes);

/* Save at once, while no loop runs. Returns the bytes of the sealed file, 0 when the buffer is too
 * small or odometry is off. */
size_t fovea_map_save(struct fovea *rt, uint8_t *buffer, size_t bytes);

/* ---- loading maps while the loop runs -------------------------------------------------------- */

/* Bytes that fovea_map_prepare needs for a runtime of this configuration: as many as its map takes
 * in the block, and a byte for each cell of its grid. Any thread. */
size_t fovea_map_prepared_bytes(const struct fovea_config *config);

/* Read and check a map file into memory of the caller's (FOVEA_BLOCK_ALIGNMENT aligned, at least
 * fovea_map_prepared_bytes; every byte of it is written), for fovea_inputs.map of steps of this
 * runtime, whose state is neither read nor changed. `data` is not read afterwards. Any thread,
 * beside the loop; some milliseconds. FOVEA_ERROR_MEMORY: the memory is too small or misaligned.
 * FOVEA_ERROR_UNSUPPORTED: odometry is off. FOVEA_ERROR_INPUT: the file is damaged, from another
 * camera, empty, or needs more than this runtime has room for; `error` begins with `name` and says
 * which byte. On error `*ready` is untouched. */
enum fovea_status fovea_map_prepare(const struct fovea *rt, void *memory, size_t bytes,
                                    const uint8_t *data, size_t data_bytes, const char *name,
                                    const struct fovea_ready_map **ready,
                                    struct fovea_error *error);

/* ---- inspection ------------------------------------------------------------------------------ */

enum fovea_stage {
    FOVEA_STAGE_PYRAMID = 0,
    FOVEA_STAGE_FEATURES = 1,
    FOVEA_STAGE_STEREO = 2, /* the second camera's images and features, and distances by both */
    FOVEA_STAGE_ODOMETRY = 3,
    FOVEA_STAGE_ENCODE = 4,
    FOVEA_STAGE_JOBS = 5, /* then one stage per job, in the order of the jobs */
    FOVEA_STAGE_COUNT = FOVEA_STAGE_JOBS + FOVEA_JOB_COUNT
};
const char *fovea_stage_name(enum fovea_stage stage);
const char *fovea_job_name(enum fovea_job job);
/* The configuration key that gives the job work: with the value off, empty or 0 it has none. */
const char *fovea_job_key(enum fovea_job job);

struct fovea_stats {
    uint64_t frames_in, frames_processed, frames_refused, steps_without_frame;
    uint64_t refused_stamp, refused_format, refused_paused;
    uint32_t reset_counter;
    uint32_t features;              /* of the last frame */
    uint32_t distances;             /* of them, those whose distance two cameras measured */
    uint32_t closures, maps_merged; /* since the last reset */
    int64_t stage_cpu_ns[FOVEA_STAGE_COUNT],
        stage_wall_ns[FOVEA_STAGE_COUNT]; /* of the last step and work */
};
void fovea_stats_get(const struct fovea *rt, struct fovea_stats *stats);

/* 64-bit hash of everything in the state that may influence later results; no defence against an
 * adversary. Equal histories give equal hashes on all processors of the same word size and byte
 * order. Bounded time; not for every frame. Loop thread. */
uint64_t fovea_state_hash(const struct fovea *rt);

/* Copy a runtime into another block of at least the same size, which may then be stepped on its
 * own. FOVEA_ERROR_MEMORY: the block is too small or misaligned, and `*copy` is untouched. Loop
 * thread. */
enum fovea_status fovea_copy(const struct fovea *rt, void *memory, size_t bytes,
                             struct fovea **copy);

/* The same as bytes, for a runtime in another block, process or machine of the same word size and
 * byte order: built by the same version and fovea_init with the same configuration. Parameters in
 * force are not in it: the next step's inputs say them. fovea_state_save writes
 * fovea_state_bytes, in the time that copying them takes. Loop thread, between steps.
 *
 * fovea_state_load takes them as they are: bytes that fovea_state_save did not write may make later
 * steps read and write anywhere. FOVEA_ERROR_INPUT: they are of another version or configuration,
 * and nothing was changed. */
size_t fovea_state_bytes(const struct fovea *rt);
void fovea_state_save(const struct fovea *rt, void *data);
enum fovea_status fovea_state_load(struct fovea *rt, const void *data, size_t bytes,
                                   struct fovea_error *error);

/* Name of the kernel set that was picked ("c", "sse4", "avx2", "avxvnni", "avx512", "neon",
 * "dotprod", "i8mm"). Any thread. */
const char *fovea_cpu_name(const struct fovea *rt);

#ifdef __cplusplus
}
#endif
#endif

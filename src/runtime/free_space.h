/* Free space in the loop: the grid of fovea/grid.h from the masks of a network and the poses that
 * they were seen from.
 *
 * fv_free_space_note remembers the pose of a frame that the network takes, and the points of
 * surfaces that it showed; when its mask is complete, fv_free_space_begin takes it,
 * fv_free_space_lay says where the floor is, and units update the grid, send it, the scan, and
 * heights. Until the update is done the network must keep the mask (fv_free_space_reads). A loss of
 * the pose, and a change of the frame or the unit of poses, make every cell unknown at once, which
 * is sent, and while there is no pose in metres again every second of the frames' time: a packet
 * may be lost. */
#ifndef FOVEA_RUNTIME_FREE_SPACE_H
#define FOVEA_RUNTIME_FREE_SPACE_H

#include "fovea/fovea.h"
#include "geometry/ground.h"
#include "grid/recall.h"
#include "map/archive.h"
#include "runtime/frame_id.h"
#include "runtime/publish.h"

enum fv_free_space_phase {
    FV_FREE_SPACE_IDLE = 0,
    FV_FREE_SPACE_WAITING, /* for the floor that its mask is laid on */
    FV_FREE_SPACE_UPDATING,
    FV_FREE_SPACE_RECALLING,
    FV_FREE_SPACE_SCANNING,
    FV_FREE_SPACE_SENDING_GRID,
    FV_FREE_SPACE_SENDING_SCAN,
    FV_FREE_SPACE_SENDING_HEIGHTS
};

/* Whether it was sent that nothing is known, and nothing else since; with the frame's time, or
 * not. */
enum fv_free_space_emptied {
    FV_FREE_SPACE_FILLED = 0,
    FV_FREE_SPACE_EMPTIED,
    FV_FREE_SPACE_EMPTIED_TIMED
};

/* Where a frame was seen from. */
struct fv_free_space_pose {
    double T_odom_cam[12], position_m[2], yaw_rad, floor_m;
    struct fv_sim3 S_own_odom; /* to the map's own frame and unit */
    uint32_t usable;           /* posed, in metres */
    uint32_t points;           /* that the frame showed */
    uint32_t map_id;           /* of the map that S_own_odom leads to */
    uint32_t unused;
};

struct fv_free_space_world {
    uint32_t reset_counter, map_id;
    uint32_t changes; /* of the unit and the axes of `odom` */
    uint32_t unused;
};

/* No addresses and no padding: copied and hashed as bytes. */
struct fv_free_space_state {
    struct fv_frame_id noted_frame, frame; /* that the network took; of the last update */
    struct fv_free_space_pose noted, pose;
    uint64_t inferences;              /* of the network, as of the last mask taken */
    struct fv_free_space_world world; /* that the cells are in */
    struct fovea_ground ground;       /* of the last update; without its mount */
    int64_t emptied_ns;               /* of the frame when last it was sent that nothing is known */
    uint32_t emptied;                 /* enum fv_free_space_emptied */
    uint32_t phase;                   /* enum fv_free_space_phase */
    int32_t sent;                     /* rows */
    uint32_t unused;
};

/* The grid of a loaded map, or as a loss ended it, and the save under way (kept_grid.c). No
 * addresses and no padding. */
struct fv_kept_grid_state {
    struct fv_archive_grid loaded; /* its cells are those of the recall; side 0: none */
    int64_t corner[2], row;        /* of the grid as it is saved; the next row */
    struct fv_free_space_world world;
    uint32_t save;
    uint32_t own; /* what is kept is the grid that a loss ended, not that of a file */
};

struct fv_free_space {
    bool enabled;
    struct fv_grid grid;
    struct fv_grid_recall recall;
    struct fv_free_space_state *state;
    struct fv_kept_grid_state *kept;
    /* of the noted frame, then of the update: no frame is noted while one is under way; NULL: not
     * wanted */
    struct fovea_grid_point *points;
    uint32_t points_max;
    float *ranges;       /* of the scan */
    int8_t *cells;       /* rows of one message */
    int16_t *heights_mm; /* likewise; NULL: not sent */
    uint8_t *height_counts;
};

/* Rows of one message. */
static inline uint32_t fv_free_space_rows(const struct fovea_grid_config *config)
{
    const uint32_t most = FV_MESSAGE_GRID_CELLS_MAX / config->side_cells;
    return most < config->side_cells ? most : config->side_cells;
}

/* Rows of one message of heights. */
static inline uint32_t fv_free_space_height_rows(const struct fovea_grid_config *config)
{
    const uint32_t most = FV_MESSAGE_HEIGHTS_CELLS_MAX / config->side_cells;
    return most < config->side_cells ? most : config->side_cells;
}

/* Lengths of the last pose are metres. */
bool fv_free_space_metric(const struct fv_publish *publish);
struct fv_free_space_world fv_free_space_world_of(const struct fv_publish *publish);

/* Nothing where the configuration has it off. `features`: the most that a frame has. Init-only. */
void fv_free_space_carve(struct fv_free_space *stage, const struct fovea_grid_job_config *config,
                         uint32_t features, struct fv_arena *persistent, struct fv_arena *job,
                         struct fv_arena *frame);

/* All that follows is real-time safe, and does nothing where it is off. */

/* Nothing is known any more, and a grid that says so is sent. */
void fv_free_space_reset(struct fv_free_space *stage);
/* After a pose, or its loss, is published. */
void fv_free_space_follow(struct fv_free_space *stage, const struct fv_publish *publish);
/* The network takes this frame. Bounded by its features. */
void fv_free_space_note(struct fv_free_space *stage, const struct fv_publish *publish,
                        const struct fv_odometry *odometry, const struct fv_frame_id *frame);
/* Whether there is a grid, and its cells are in `odom` as the last pose is, and in metres. */
bool fv_free_space_vouched(const struct fv_free_space *stage, const struct fv_publish *publish);
bool fv_free_space_same(struct fv_free_space_world a, struct fv_free_space_world b);

/* The grid still needs the network's mask: it is being read, or is new. `inferences`: those that
 * the network has completed. */
bool fv_free_space_reads(const struct fv_free_space *stage, uint64_t inferences);
bool fv_free_space_waiting(const struct fv_free_space *stage);
/* Take a complete mask of the frame that was noted; one that was taken before is left. */
void fv_free_space_begin(struct fv_free_space *stage, const struct fovea_segmentation *seen);
/* It was taken, and waits for the floor, for which the pose that it was seen from is looked at. */
const struct fv_free_space_pose *fv_free_space_taken(const struct fv_free_space *stage);
/* The floor over the body's position at that pose; NULL: not known (the body leans), which is
 * the height of the body's z = 0, level, give or take 0.1 rad and 0.1 m. */
void fv_free_space_lay(struct fv_free_space *stage, const struct fv_ground_plane *floor,
                       const struct fovea_segmentation *seen, const struct fovea_camera *camera,
                       const uint8_t labels[256]);
/* Do a unit of an update that has its floor. True: a message is ready, and fv_free_space_encode
 * encodes it. `seen`, `camera` and `labels` are those that it began with; they are read only while
 * fv_free_space_reads. */
bool fv_free_space_unit(struct fv_free_space *stage, const struct fovea_segmentation *seen,
                        const struct fovea_camera *camera, const uint8_t labels[256]);
/* The kind of the message that is ready. */
enum fv_message_kind fv_free_space_kind(const struct fv_free_space *stage);
uint32_t fv_free_space_encode(struct fv_free_space *stage, uint8_t *buffer, size_t capacity);

#endif

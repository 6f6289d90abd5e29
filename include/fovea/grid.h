/* Free space: an occupancy grid of the floor around a robot, from masks of what a camera sees and
 * the poses that it saw it from; and the nearest obstacle in each direction.
 *
 * Along rays over the floor, from below the camera outwards, each point is looked up in the mask:
 * floor is evidence for free, the first obstacle is evidence for occupied, and what lies behind it
 * is not known. Floor that is followed by a class that lies beyond it (the sky over a quay, what a
 * network calls other) ends there: a drop-off, which is evidence for occupied too. Cells hold
 * log-odds with the increments and limits of OctoMap (Hornung et al.,
 * Autonomous Robots 2013), and forget with time. The grid is square, level, fixed to the odometry
 * frame, and follows the robot cell by cell; what it leaves is forgotten.
 *
 * Points of surfaces that the same frame showed, landmarks or distances of two cameras, add what a
 * mask missed. A point that stands 5 cm to 1 m above the floor by 3 standard deviations, the
 * floor's possible slope included, and whose distance is known to half a cell, is evidence for
 * occupied, as much as an obstacle of the mask; it counts for the cell a third of a cell behind it,
 * where what it is a surface of lies. A point below the floor by as much shows that there is no
 * floor where the line of sight passes it: that cell counts as occupied (stairs; but so does floor
 * that mirrors). One point may be a wrong match: a cell counts only where another point of the same
 * frame stands in it or in one of the eight beside it. Where the mask has something movable or
 * ignored a point says nothing: the first is in the mask, the second may be the robot. Points are
 * never evidence for free. Those on the floor add nothing to what the mask shows around them, and
 * do not show that nothing stands beside them in their cell; and between a point and the camera
 * sight is free at the height of the ray, not down at the floor.
 *
 * The floor is a plane that the view states, with its covariance. An obstacle that hangs above the
 * floor, or whose foot is outside of the image, appears where its visible lower edge meets the
 * floor. Cells of the robot's own radius are free, unless an obstacle is seen there.
 *
 * Floor ends where a ray that has shown floor comes to what lies beyond it, and two pixels of the
 * mask further still shows that or an obstacle: one pixel alone, at the border of the picture or
 * amid floor, is the network's own roughness and says nothing, no more than a ray that begins
 * beyond. What the mask says of such an end is taken to be wrong by one of its pixels, one standard
 * deviation, which counts with the floor's as below: far ends count in parts, and floor that
 * reaches the horizon has none.
 *
 * A pixel at distance r from the foot of the camera, which is H above the plane there, lies wrong
 * by
 *
 *     sigma_r = r / H sigma_z,  sigma_z^2 = [dx dy 1] C [dx dy 1]'
 *
 * where C is the covariance of the plane (slopes, height) and (dx, dy) the pixel's place from the
 * body: r sigma_height / H, and with a tilt r^2 sigma_tilt / H. All pixels of a ray err together,
 * and so do all views by one plane: more of them add no certainty. Hence floor is evidence for free
 * only where it would still be seen as floor sigma_r further out: from the first obstacle, or the
 * end of what is seen, cells within sigma_r say nothing (sigma_r below half a cell counts as none).
 * An obstacle's evidence is the part of it that is in its cell, resolution_m / (sqrt(2 pi)
 * sigma_r), at most 1, in eighths: none beyond 6.4 cells. Where floor ends sigma_r^2 has the square
 * of what a pixel of the mask spans on the floor added.
 *
 * Works on memory of the caller:
 *
 *     fovea_grid_size(&config, &bytes, &error);
 *     fovea_grid_init(&grid, &config, memory, bytes, &error);
 *     fovea_grid_update(grid, &view);         with each mask
 *     fovea_grid_forget(grid);                when the pose is lost or begins anew
 *     fovea_grid_cells(grid, cells, &place);
 *     fovea_grid_scan(grid, ranges_m);
 *     fovea_scan_nearest(&scan, &sectors, nearest_m);
 *
 * The same bits on every processor. Real-time safe but for size and init. Not for two threads at a
 * time. */
#ifndef FOVEA_GRID_H
#define FOVEA_GRID_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "fovea/camera.h"
#include "fovea/segmentation.h"
#include "fovea/status.h"

#ifdef __cplusplus
extern "C" {
#endif

struct fovea_grid;

enum { FOVEA_GRID_UNKNOWN = -1, FOVEA_GRID_HEIGHT_UNKNOWN = -32768 };
enum { FOVEA_GRID_POINTS_MAX = 8192 }; /* of one view */

/* Probabilities below and above which a cell counts as known to be free or occupied. */
#define FOVEA_GRID_FREE_BELOW 0.35
#define FOVEA_GRID_OCCUPIED_ABOVE 0.65

/* What a class of the network is to the robot. */
enum fovea_grid_label {
    FOVEA_GRID_IGNORED = 0, /* nothing is known there or behind it: the robot itself */
    FOVEA_GRID_FLOOR = 1,
    FOVEA_GRID_OBSTACLE = 2, /* also the inside of a pit */
    FOVEA_GRID_MOVABLE = 3,  /* an obstacle that is forgotten sooner */
    FOVEA_GRID_BEYOND = 4    /* never floor: where it follows floor, that ends. Sky, other */
};

struct fovea_grid_config {
    double resolution_m; /* [0.02, 1], default 0.1: side of a cell */
    uint32_t side_cells; /* [16, 512], default 192: cells along each side */
    /* [0.5, 100], default 5, at most half the side: farthest floor that is believed */
    double range_m;
    uint32_t rays;         /* [16, 1440], default 360: directions, evenly over a turn */
    double robot_radius_m; /* [0, 10], default 0.2 */
    double half_life_s;    /* [0.1, 10000], default 60: log-odds of a cell halve in this time */
    double movable_half_life_s; /* [0.1, 10000], default 2: where something movable was seen */
    /* [0, 1], default 0.9: floor of which the network is less sure, where it says how sure it is,
     * is no evidence; what lies behind it may be */
    double floor_confidence;
    bool heights;         /* default false: keep fovea_grid_heights */
    double heights_max_m; /* [0.1, 10], default 1.5: surfaces above it are left out */
};

/* A point of a surface that the camera saw in the frame of the mask: a landmark, or a feature whose
 * distance two cameras measured. */
struct fovea_grid_point {
    float position_m[3];     /* in the odometry frame */
    float along_m, across_m; /* one standard deviation: along the line of sight, and across it */
};

/* A mask, and where it was seen from. Frames are right-handed, z of the odometry frame is up. */
struct fovea_grid_view {
    int64_t stamp_ns; /* must not fall from update to update */
    const struct fovea_segmentation *seen;
    const uint8_t *labels; /* [256]: enum fovea_grid_label of each class */
    const struct fovea_camera *camera;
    double T_odom_cam[12]; /* three rows of [R t], metres; z of the camera is forward, y down */
    double position_m[2];  /* of the body in the odometry frame: the grid's centre */
    double yaw_rad;        /* of the body, for the scan */
    double floor_m;        /* height of the floor in the odometry frame, at position_m */
    double floor_slope[2]; /* its rise along x and y of the odometry frame, m/m; 0: level */
    /* Of both slopes and floor_m: upper triangle by rows; zeros: it is exact. */
    double floor_covariance[6];
    const struct fovea_grid_point *points; /* what else that frame showed; NULL: nothing */
    uint32_t point_count;                  /* at most FOVEA_GRID_POINTS_MAX */
};

/* Where the cells are. */
struct fovea_grid_place {
    int64_t stamp_ns; /* of the last update; 0: none since init or forget */
    uint32_t width, height;
    double resolution_m;
    double origin_m[2]; /* outer corner of cell (0, 0) in the odometry frame */
};

void fovea_grid_config_default(struct fovea_grid_config *config);

/* Bytes of the block. Init-only. FOVEA_ERROR_ARGUMENT: `error` names the member. */
enum fovea_status fovea_grid_size(const struct fovea_grid_config *config, size_t *bytes,
                                  struct fovea_error *error);
/* Make a grid in `memory`, which is at a multiple of 64. Init-only. */
enum fovea_status fovea_grid_init(struct fovea_grid **grid, const struct fovea_grid_config *config,
                                  void *memory, size_t bytes, struct fovea_error *error);

/* Take what a mask shows; some 0.3 ms with the defaults, and in proportion to the cells and to the
 * rays' steps; some 0.1 ms for 1,000 points. FOVEA_ERROR_ARGUMENT: there is no mask yet, the pose
 * holds no numbers, no rotation or is beyond 1e6 m, the camera is not at least 1 cm above the
 * floor, a slope is beyond 1, a variance negative, the stamp is negative or falls, there are too
 * many points; nothing is taken. A point that holds no numbers says nothing. */
enum fovea_status fovea_grid_update(struct fovea_grid *grid, const struct fovea_grid_view *view);

/* Every cell becomes unknown. */
void fovea_grid_forget(struct fovea_grid *grid);

/* Fill width x height cells, row by row from the origin, x first: 0 (free) to 100 (occupied)
 * percent, or FOVEA_GRID_UNKNOWN, as ROS's OccupancyGrid. */
void fovea_grid_cells(const struct fovea_grid *grid, int8_t *cells, struct fovea_grid_place *place);

/* Fill width x height cells in the same order, each with the height of the highest surface below
 * heights_max_m that points of views showed in it, in millimetres over the floor as it was then, or
 * FOVEA_GRID_HEIGHT_UNKNOWN; and with how many points say so, up to 15. `counts` may be NULL.
 * False: the configuration has them off, and nothing is filled.
 *
 * A point counts whose distance is known to half a cell, whose height is known to 5 cm (one
 * standard deviation, with 0.5 % of its distance for the floor's slope), and where the mask has
 * floor or an obstacle. A height is known once two points agree on it within 5 cm, and is their
 * mean; a higher surface takes its place once two points agree on that. Counts halve in the cell's
 * half-life, and below one the height is forgotten; floor that a mask shows in the cell takes half
 * a point from a height of more than 5 cm. What leaves the grid, and everything at
 * fovea_grid_forget, is unknown. Heights are where points are: a plain wall or floor has none. */
bool fovea_grid_heights(const struct fovea_grid *grid, int16_t *heights_mm, uint8_t *counts,
                        struct fovea_grid_place *place);

/* Fill `rays` ranges from the body of the last update: ray i points at an angle of 2 pi i / rays
 * from the body's x axis to its y axis. Metres to the nearest cell known to be occupied; infinity:
 * known to be free as far as range_m; NaN: neither. */
void fovea_grid_scan(struct fovea_grid *grid, float *ranges_m);

/* A scan: ray i points at an angle of first_rad + i step_rad from the body's x axis to its y axis.
 * Of fovea_grid_scan these are 0 and 2 pi / rays; SCAN (scan_t) has them as angle_first and
 * angle_step, with range_m and count. */
struct fovea_scan {
    double first_rad, step_rad; /* [-100, 100], [-2 pi, 2 pi] */
    uint32_t count;             /* of rays, at most 65536 */
    const float *ranges_m;      /* as fovea_grid_scan has them */
};

/* Sectors around the body. The middle of sector k is at first_rad + k step_rad: a negative step
 * goes clockwise, seen from above. They are as wide as the step, and reach at most once around:
 * {0, -2 pi / 72, 72} are those of MAVLink's OBSTACLE_DISTANCE. */
struct fovea_scan_sectors {
    double first_rad, step_rad; /* [-100, 100]; [0.001, 2 pi], or negative */
    uint32_t count;
};

/* Fill `nearest_m` with the nearest obstacle of each sector. Infinity: there is none as far as the
 * scan reaches; NaN: not known, as where any of its rays is not known (NaN or negative) and none
 * shows an obstacle, or no ray is in it. FOVEA_ERROR_ARGUMENT: a number is beyond its limits, and
 * nothing is filled. */
enum fovea_status fovea_scan_nearest(const struct fovea_scan *scan,
                                     const struct fovea_scan_sectors *sectors, float *nearest_m);

#ifdef __cplusplus
}
#endif
#endif

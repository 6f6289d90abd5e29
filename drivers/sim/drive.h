/* A robot that drives through a hall (`sim:drive`): what stands in its way, a path through it, the
 * robot's motion and what moves about. The motion is a table of ticks, computed ahead along the
 * path, or from velocity commands as they come. Everything follows from the seed and the commands.
 *
 * The body's frame is the robot's: x forward, y left, z up, on the floor below its middle. */
#ifndef FOVEA_DRIVERS_SIM_DRIVE_H
#define FOVEA_DRIVERS_SIM_DRIVE_H

#include <stdbool.h>
#include <stdint.h>

#include "base/elementary.h"

struct fv_sim_options;
struct fv_sim_world;

#define FV_SIM_DRIVE_CAMERA_M 0.8  /* of the camera over the floor */
#define FV_SIM_DRIVE_RADIUS_M 0.2  /* of the robot, seen from above */
#define FV_SIM_DRIVE_WAY_M 0.7     /* width of the way that every world leaves from start to goal */
#define FV_SIM_DRIVE_SPEED_M_S 0.5 /* on the path; commands may ask for up to twice as much */
#define FV_SIM_DRIVE_GOAL_M 0.3    /* so near to it the goal is reached */
#define FV_SIM_DRIVE_YIELD_M 0.9   /* what moves gives way when the robot is so near */

enum {
    FV_SIM_DRIVE_BLOCKS_MAX = 64,
    FV_SIM_DRIVE_MOVERS_MAX = 8,
    FV_SIM_DRIVE_PATH_MAX = 1024,
    FV_SIM_DRIVE_STANDS = 64,
    FV_SIM_DRIVE_SECONDS_MAX = 1200
};

/* What stands on the floor, or the edge of a pit in it, seen from above: a rectangle, or a disc. */
struct fv_sim_block {
    double center[2], half[2], cosine, sine;
    double radius; /* of a disc; 0: a rectangle */
};

/* What moves goes to and fro on a straight lane. */
struct fv_sim_mover {
    double from[2], way[2]; /* a unit vector */
    double length, speed, radius;
};

struct fv_sim_drive_tick {
    double position[2], yaw, speed, turning;   /* of the robot; m/s, rad/s */
    double along[FV_SIM_DRIVE_MOVERS_MAX];     /* on the lane, m */
    double pace[FV_SIM_DRIVE_MOVERS_MAX];      /* m/s */
    int8_t direction[FV_SIM_DRIVE_MOVERS_MAX]; /* that it wants to go in: 1 or -1 */
};

struct fv_sim_drive {
    double half[2]; /* of the hall, round the origin */
    double pit[4];  /* low x, high x, low y, high y; all 0: none */
    double start[2], goal[2];
    struct fv_sim_block block[FV_SIM_DRIVE_BLOCKS_MAX];
    int32_t block_count;
    struct fv_sim_mover mover[FV_SIM_DRIVE_MOVERS_MAX];
    int32_t mover_count;
    double path[FV_SIM_DRIVE_PATH_MAX][2]; /* that the robot takes without commands */
    int32_t path_count;
    double shortest_m; /* way from start to goal that stays clear by half of FV_SIM_DRIVE_WAY_M */
    /* The motion: ticks from `begin_s` on, `tick_s` apart. */
    double begin_s, tick_s;
    struct fv_sim_drive_tick *tick;
    int64_t tick_count, tick_room;
    bool jumps;       /* it stands from tick to tick, and then elsewhere */
    bool touches;     /* as of the last tick */
    int64_t contacts; /* times that the robot came to touch something */
    int64_t reached;  /* the first tick at the goal; -1: not yet */
};

/* Distance of a point to a block; negative: inside. */
double fv_sim_block_distance(const struct fv_sim_block *block, double x, double y);
/* Gap between a disc of `radius_m` about a point and the nearest block or wall; negative: it
 * overlaps. */
double fv_sim_drive_gap(const struct fv_sim_drive *drive, const double point[2], double radius_m);

/* The hall (drive_place.c). */
void fv_sim_place_drive(struct fv_sim_world *world);
/* Lanes of the moving objects, and the table of ticks (drive_path.c, drive_motion.c). false: out of
 * memory. */
bool fv_sim_drive_create(struct fv_sim_world *world, const struct fv_sim_options *options);
void fv_sim_drive_free(struct fv_sim_drive *drive);

/* ---- paths (drive_path.c) -------------------------------------------------------------------- */

struct fv_sim_drive_search;

/* A search in the drive's hall, with its blocks so far; NULL: out of memory. */
struct fv_sim_drive_search *fv_sim_drive_search_open(const struct fv_sim_drive *drive);
void fv_sim_drive_search_close(struct fv_sim_drive_search *search);
void fv_sim_drive_search_add(struct fv_sim_drive_search *search, const struct fv_sim_block *block);
/* Whether there is a way from start to goal that stays clear, by half of FV_SIM_DRIVE_WAY_M, of all
 * blocks and of `more` (NULL: nothing more). */
bool fv_sim_drive_has_way(struct fv_sim_drive_search *search, const struct fv_sim_block *more);
/* Fill in path and shortest way; there is one. */
void fv_sim_drive_plan(struct fv_sim_drive_search *search, struct fv_sim_drive *drive);

/* ---- motion (drive_motion.c) ----------------------------------------------------------------- */

/* Begin anew, driven by fv_sim_drive_step: at `begin_s`, with room for `ticks` of 1 / `tick_hz`.
 * false: out of memory. */
bool fv_sim_drive_begin(struct fv_sim_drive *drive, double begin_s, double tick_hz, int64_t ticks);
/* A tick more, with the velocities that the robot is asked for. */
void fv_sim_drive_step(struct fv_sim_drive *drive, double speed_m_s, double turning_rad_s);
void fv_sim_drive_robot(const struct fv_sim_drive *drive, double time_s, double position[2],
                        double *yaw);
/* Where a moving object's foot is, which way its lane leads, and how far it has come on it. */
void fv_sim_drive_mover(const struct fv_sim_drive *drive, int32_t number, double time_s,
                        double position[2], double *heading, double *along);
void fv_sim_drive_camera(double T_body_cam[12]);
void fv_sim_drive_body(const struct fv_sim_drive *drive, double time_s, double T_world_body[12]);
/* Seconds that the path takes, with a second of standing at either end. */
double fv_sim_drive_seconds(const struct fv_sim_drive *drive);

#endif

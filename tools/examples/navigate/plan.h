/* A planner on the grid of free space, small enough to read: D* Lite from the goal over cells that
 * are widened by the robot's radius (map.h, ways.h, dstar_lite.h), and a pursuit of the way it
 * finds (steer.c). What is occupied is never entered; what is not known may be planned through at a
 * price, but is entered only when it has been seen to be free, or slowly where it cannot be seen
 * from anywhere nearer. What was seen occupied only once or twice closes no way that passes beside
 * it: the robot goes there to see it from near and, where it stands too near, from farther off, and
 * gives the way up where it stays too narrow. Where the robot was asked to drive and stood,
 * something is that the grid does not show. Either is kept in mind for a while as an obstacle
 * ahead; the robot backs off and plans anew. */
#ifndef FOVEA_EXAMPLES_NAVIGATE_PLAN_H
#define FOVEA_EXAMPLES_NAVIGATE_PLAN_H

#include <stdbool.h>
#include <stdint.h>

#include "dstar_lite.h"

enum {
    NAVIGATE_SIDE_MAX = DSTAR_SIDE - 1,
    NAVIGATE_CELLS_MAX = NAVIGATE_SIDE_MAX * NAVIGATE_SIDE_MAX,
    NAVIGATE_TOUCHES_MAX = 16
};

/* In ascending order of danger. Suspected: an obstacle was seen once or twice, from afar, and may
 * be in a cell beside this one; or something seems to come to what was free. */
enum navigate_kind { NAVIGATE_FREE, NAVIGATE_UNKNOWN, NAVIGATE_SUSPECTED, NAVIGATE_OCCUPIED };

struct navigate_robot {
    double radius_m, speed_m_s, turning_rad_s; /* disc; limits that it is asked for */
};

/* Where the robot stood against its command, or before a way that was too narrow. */
struct navigate_touch {
    double position[2], yaw, until_s;
};

struct navigate_motion {
    double speed_m_s, turning_rad_s;
    bool arrived;
};

struct navigate {
    struct navigate_robot robot;
    double goal[2]; /* in the grid's frame */
    int32_t width, height;
    double cell_m, origin[2];
    uint8_t kind[NAVIGATE_CELLS_MAX]; /* of each cell: enum navigate_kind */
    float gap[NAVIGATE_CELLS_MAX];    /* m to the nearest cell that is suspected or occupied */
    float hold[NAVIGATE_CELLS_MAX];   /* m to the nearest cell that is occupied */
    struct dstar ways;                /* the search over these cells */
    int32_t corner[2];                /* where the search has the grid's first cell */
    bool begun;                       /* the next grid may go on where the last was */
    /* When each cell was last free, where the search has it. */
    double free_s[DSTAR_SIDE * DSTAR_SIDE];
    /* What it was asked for at the last step, and what came of it: the way that it should have gone
     * since it was at `stood`. */
    struct navigate_motion asked;
    double now_s, step_s, stood[2], due_m;
    double stands_s; /* it has stood so long, before unknown cells or a narrow way */
    struct navigate_touch touch[NAVIGATE_TOUCHES_MAX]; /* a ring, by their number */
    int64_t touches, given_up;        /* in all; of these, ways given up as too narrow */
    double narrow[2], narrow_until_s; /* where it last found a way too narrow */
    double backs_from[2], backs_m, backs_until_s; /* driving back */
};

void navigate_init(struct navigate *n, const struct navigate_robot *robot, const double goal[2]);
/* Take a grid, as fovea.grid_t has it. A side longer than NAVIGATE_SIDE_MAX: false. */
bool navigate_plan(struct navigate *n, const int8_t *cells, int32_t width, int32_t height,
                   double cell_m, const double origin[2]);
/* What to do at a place, by the last plan. `time_s`: of the pose, on any clock that goes forward.
 */
struct navigate_motion navigate_steer(struct navigate *n, const double position[2], double yaw,
                                      double time_s);
/* The grid's frame is another from now on: what is kept in mind lies nowhere in it. */
void navigate_forget(struct navigate *n);

#endif

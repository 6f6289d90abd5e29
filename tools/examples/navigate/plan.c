#include "plan.h"

#include <string.h>

#include "map.h"
#include "ways.h"

void navigate_init(struct navigate *n, const struct navigate_robot *robot, const double goal[2])
{
    memset(n, 0, sizeof *n);
    n->robot = *robot;
    memcpy(n->goal, goal, sizeof n->goal);
}

bool navigate_plan(struct navigate *n, const int8_t *cells, int32_t width, int32_t height,
                   double cell_m, const double origin[2])
{
    if (width < 1 || height < 1 || width > NAVIGATE_SIDE_MAX || height > NAVIGATE_SIDE_MAX)
        return false;
    navigate_ways_move(n, width, height, cell_m, origin);
    navigate_map(n, cells);
    navigate_ways_change(n);
    return true;
}

void navigate_forget(struct navigate *n)
{
    n->touches = 0;
    n->backs_until_s = n->narrow_until_s = n->now_s;
    n->due_m = 0;
    n->begun = false;
}

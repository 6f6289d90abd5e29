/* Of turns that a gyro measured: held in a frame, and in the window. */
#include "map/window_turns.c"

#include "bounds/counter.h"
#include "bounds/full_map.h"
#include "bounds/pieces.h"
#include "odometry/turn.h"

struct turning {
    struct fv_odometry *o;
    struct fv_window *window;
    uint32_t in_window;
    struct fv_pose_fit fit;
    struct fv_se3 last, T;
};

static const double none[3] = {0, 0, 0}, little[3] = {1e-3, -2e-3, 1e-3};

static struct fv_turn a_turn(void)
{
    struct fv_turn turn;
    fv_turn_begin(&turn, none);
    for (int i = 0; i < 3; i++)
        turn.by_bias[4 * i] = -0.05;
    turn.variance = 1e-6;
    return turn;
}

static void hold(void *context)
{
    struct turning *t = context;
    fv_odometry_hold_turn(t->o, &t->last, &t->fit, true, &t->T);
    fv_odometry_reduce_own(t->o);
    fv_odometry_follow_turn(t->o);
}

static void of_frames(struct turning *t)
{
    struct fv_motion_hint *hint = &t->o->state->localise.hint;
    for (int i = 0; i < 6; i++)
        t->fit.information[7 * i] = 1e6;
    hint->turn = hint->measured = true;
    hint->turned = a_turn();
    fv_so3_exp(little, hint->turned.R);
    fv_se3_identity(&t->last);
    t->T = t->last;
    t->o->state->turn.variance = 1e-6;
    t->o->state->turn.rated = true;
    t->o->state->state = FOVEA_TRACKING_OK;
    t->o->state->pose.posed = true;
    t->o->map.keyframes[t->o->state->newest].stamp_ns =
        t->o->map.keyframes[fv_map_current(&t->o->map)].stamp_ns;
    fv_turns_keyframe(t->o->turns, 0);
    NOTE(turn_held, hold, t, 1);
    MUST(t->o->state->turn.held[0] != 0 && t->o->turns->count > 0);
}

static void take(void *context)
{
    struct turning *t = context;
    t->window->gyro->count = 0;
    fv_window_take_turns(t->window, &t->o->map, t->in_window);
}

static void add(void *context)
{
    struct turning *t = context;
    (void)fv_window_add_turns(t->window);
}

static uint64_t number_before(const struct fv_map *map, uint64_t number)
{
    uint64_t best = 0;
    for (uint32_t k = 0; k < map->limits.keyframes; k++)
        if (map->keyframes[k].number < number && map->keyframes[k].number > best)
            best = map->keyframes[k].number;
    return best;
}

/* Keyframes of the window that others lie between, as many as turns are kept. */
static void of_window(struct turning *t)
{
    struct fv_turns *turns = t->o->turns;
    struct fv_window_state *s = t->window->state;
    const struct fv_gyro_known known = {
        {0, 0, 0}, 1, {{0}, 0, 0}, 0}; /* whatever poses show fits */
    const struct fv_turn turn = a_turn();
    t->in_window = t->o->config.window;
    MUST(fv_window_start(t->window, &t->o->map, t->o->state->newest));
    MUST(s->pose_count >= t->in_window);
    fv_turns_forget(turns);
    for (uint64_t number = 0; number <= FV_TURNS_MAX; number++) {
        fv_turns_follow(turns, &turn, &known);
        fv_turns_keyframe(turns, 1000 + number);
    }
    for (uint32_t i = 0; i < t->in_window; i++) { /* the newest first, as they are picked */
        t->o->map.keyframes[s->poses[i].slot].number = 1000 + FV_TURNS_MAX - i;
        s->poses[i].T_cam_world.R[0] = 1;
    }
    turns->links[turns->first].from = number_before(&t->o->map, 1000);
    NOTE(turns_taken, take, t, 1);
    MUST(t->window->gyro->count == t->in_window);
    s->step_pending = true;
    NOTE(turns_added, add, t, 1);
}

void pieces_of_turns(struct fovea *rt)
{
    static struct turning t;
    t.o = &rt->odometry;
    t.window = &rt->odometry.window;
    full_map_fill(t.o, FV_MAP_OBSERVERS_MAX);
    of_frames(&t);
    of_window(&t);
}

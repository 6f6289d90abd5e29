/* The focal length that the newest keyframes fit, with their poses and landmarks freed. */
#include <string.h>

#include "geometry/linear.h"
#include "odometry/lens.h"
#include "odometry/odometry.h"

enum {
    SIZE = FV_LENS_SIZE,
    SEEN_MIN = 3,       /* keyframes of the window that see a landmark */
    POINTS_MIN = 60,    /* landmarks */
    UNIT_POINTS = 20,   /* landmarks of a unit that are used, */
    UNIT_SLOTS = 1500,  /* and that are looked at, */
    SLOT_STEP = 2,      /* of every second slot: the others would say the same */
    APART_KEYFRAMES = 3 /* from one window to the next; after twice as many the map's job is not
                           waited for any more */
};

static const double outlier2 = 9; /* weighted px^2: from here on errors count less (Huber) */
static const double held = 1e12;  /* information on the oldest pose, which stays */
static const double free_gauge = 1 + 1e-6; /* factor of poses: the unit of length is free */

void fv_lens_window_carve(struct fv_lens_window *w, struct fv_arena *job)
{
    w->state = fv_arena_take(job, 1, sizeof *w->state);
    w->matrix = fv_arena_take(job, (size_t)SIZE * SIZE, sizeof *w->matrix);
    w->vector = fv_arena_take(job, SIZE, sizeof *w->vector);
}

bool fv_lens_window_due(const struct fv_odometry *o, uint64_t newest)
{
    const uint64_t number = o->map.keyframes[o->state->newest].number;
    if (o->map.state->keyframe_count < FV_LENS_KEYFRAMES || number < newest + APART_KEYFRAMES)
        return false;
    return !fv_odometry_job_waiting(o) || number >= newest + 2 * APART_KEYFRAMES;
}

/* The newest keyframe of the map that is older than number `below`; FV_MAP_NONE: none. */
static int32_t newest_below(const struct fv_map *map, uint64_t below)
{
    int32_t best = FV_MAP_NONE;
    for (uint32_t k = 0; k < map->limits.keyframes; k++) {
        const struct fv_keyframe *keyframe = &map->keyframes[k];
        if (keyframe->used && keyframe->map_id == map->state->map_id && keyframe->number < below &&
            (best == FV_MAP_NONE || keyframe->number > map->keyframes[best].number))
            best = (int32_t)k;
    }
    return best;
}

uint64_t fv_lens_window_begin(struct fv_lens_window *w, const struct fv_odometry *o)
{
    struct fv_lens_window_state *s = w->state;
    const struct fv_map *map = &o->map;
    uint64_t below = UINT64_MAX;
    memset(s, 0, sizeof *s);
    for (int i = 0; i < FV_LENS_KEYFRAMES; i++) {
        const int32_t slot = newest_below(map, below);
        if (slot == FV_MAP_NONE) return map->keyframes[o->state->newest].number;
        const struct fv_keyframe *keyframe = &map->keyframes[slot];
        below = keyframe->number;
        if (i == 0) s->newest = below;
        s->slots[i] = (uint32_t)slot;
        s->generations[i] = keyframe->generation;
        s->T_cam_world[i] = keyframe->T_cam_world;
    }
    memset(w->matrix, 0, (size_t)SIZE * SIZE * sizeof *w->matrix);
    memset(w->vector, 0, SIZE * sizeof *w->vector);
    s->phase = FV_LENS_ADDING;
    return s->newest;
}

static bool same_pose(const struct fv_se3 *a, const struct fv_se3 *b)
{
    bool same = true;
    for (int i = 0; i < 9; i++)
        same &= a->R[i] == b->R[i];
    for (int i = 0; i < 3; i++)
        same &= a->t[i] == b->t[i];
    return same;
}

/* Keyframes are where they were when the window began. */
static bool stands(const struct fv_lens_window_state *s, const struct fv_map *map)
{
    for (int i = 0; i < FV_LENS_KEYFRAMES; i++)
        if (!fv_map_holds(map, s->slots[i], s->generations[i]) ||
            !same_pose(&map->keyframes[s->slots[i]].T_cam_world, &s->T_cam_world[i]))
            return false;
    return true;
}

/* A landmark: its columns of the normal equations, of poses and focal length, before and after it
 * is eliminated. */
struct seen {
    uint32_t count;            /* keyframes */
    int at[FV_LENS_KEYFRAMES]; /* of the window */
    struct fv_lens_error errors[FV_LENS_KEYFRAMES];
    double block[6], gradient[3]; /* of the point: xx xy xz yy yz zz */
    int columns;                  /* 6 count + 1, the focal length last */
    int column[SIZE];             /* of the whole system, rising with none twice */
    double cross[3][SIZE];
};

static bool gather(const struct fv_lens_window_state *s, const struct fv_map *map,
                   const struct fv_landmark *l, struct seen *seen)
{
    seen->count = 0;
    if (!l->used || l->observer_count < SEEN_MIN) return false;
    for (int i = 0; i < FV_LENS_KEYFRAMES; i++)
        for (uint32_t k = 0; k < l->observer_count; k++) {
            if (l->observers[k].keyframe != s->slots[i]) continue;
            const struct fv_map_frame frame = fv_map_frame_at(map, s->slots[i]);
            struct fv_lens_error *e = &seen->errors[seen->count];
            if (!fv_lens_error(map, &s->T_cam_world[i], l->point,
                               &frame.points[l->observers[k].feature], e))
                return false;
            const double e2 = e->weight * (e->error[0] * e->error[0] + e->error[1] * e->error[1]);
            if (e2 > outlier2) e->weight *= __builtin_sqrt(outlier2 / e2);
            seen->at[seen->count++] = i;
            break;
        }
    return seen->count >= SEEN_MIN;
}

/* Products with the point's derivatives. */
static void cross_make(struct seen *seen)
{
    const int last = (int)(6 * seen->count);
    memset(seen->block, 0, sizeof seen->block);
    memset(seen->gradient, 0, sizeof seen->gradient);
    seen->columns = last + 1;
    seen->column[last] = SIZE - 1;
    for (int c = 0; c < 3; c++)
        seen->cross[c][last] = 0;
    for (uint32_t k = 0; k < seen->count; k++) {
        const struct fv_lens_error *e = &seen->errors[k];
        for (int a = 0; a < 6; a++) {
            seen->column[6 * k + (uint32_t)a] = 6 * seen->at[k] + a;
            for (int c = 0; c < 3; c++)
                seen->cross[c][6 * k + (uint32_t)a] =
                    e->weight * (e->by[0][a] * e->by[0][7 + c] + e->by[1][a] * e->by[1][7 + c]);
        }
        for (int r = 0; r < 2; r++) {
            const double *p = e->by[r] + 7;
            for (int c = 0, m = 0; c < 3; c++) {
                seen->cross[c][last] += e->weight * e->by[r][6] * p[c];
                seen->gradient[c] -= e->weight * e->error[r] * p[c];
                for (int d = c; d < 3; d++, m++)
                    seen->block[m] += e->weight * p[c] * p[d];
            }
        }
    }
}

/* What poses and focal length have without the point. */
static void direct_add(struct fv_lens_window *w, const struct seen *seen)
{
    for (uint32_t k = 0; k < seen->count; k++) {
        const struct fv_lens_error *e = &seen->errors[k];
        for (int r = 0; r < 2; r++) {
            for (int a = 0; a < 7; a++) {
                const int row = a < 6 ? 6 * seen->at[k] + a : SIZE - 1;
                const double weighted = e->weight * e->by[r][a];
                w->vector[row] -= weighted * e->error[r];
                for (int b = 0; b <= a; b++)
                    w->matrix[row * SIZE + (b < 6 ? 6 * seen->at[k] + b : SIZE - 1)] +=
                        weighted * e->by[r][b];
            }
            w->state->cost += e->weight * e->error[r] * e->error[r];
        }
    }
}

static void landmark_add(struct fv_lens_window *w, struct seen *seen)
{
    double inverse[6];
    cross_make(seen);
    if (!fv_invert_symmetric3(seen->block, inverse)) return;
    const double M[3][3] = {{inverse[0], inverse[1], inverse[2]},
                            {inverse[1], inverse[3], inverse[4]},
                            {inverse[2], inverse[4], inverse[5]}};
    direct_add(w, seen);
    for (int a = 0; a < seen->columns; a++) {
        double t[3];
        for (int c = 0; c < 3; c++)
            t[c] = seen->cross[0][a] * M[0][c] + seen->cross[1][a] * M[1][c] +
                   seen->cross[2][a] * M[2][c];
        double *row = w->matrix + (size_t)seen->column[a] * SIZE;
        w->vector[seen->column[a]] -=
            t[0] * seen->gradient[0] + t[1] * seen->gradient[1] + t[2] * seen->gradient[2];
        for (int b = 0; b <= a; b++)
            row[seen->column[b]] -=
                t[0] * seen->cross[0][b] + t[1] * seen->cross[1][b] + t[2] * seen->cross[2][b];
    }
    w->state->points++;
    w->state->observations += seen->count;
}

static void add_unit(struct fv_lens_window *w, const struct fv_map *map)
{
    struct fv_lens_window_state *s = w->state;
    struct seen seen;
    const uint32_t top = map->state->landmark_top;
    for (uint32_t looked = 0, used = 0; s->next < top && looked < UNIT_SLOTS && used < UNIT_POINTS;
         looked++) {
        const struct fv_landmark *landmark = &map->landmarks[s->next];
        s->next += SLOT_STEP;
        if (!gather(s, map, landmark, &seen)) continue;
        landmark_add(w, &seen);
        used++;
    }
    if (s->next >= top) s->phase = FV_LENS_SOLVING;
}

static bool solve(struct fv_lens_window *w, struct fv_lens_mismatch *found)
{
    const struct fv_lens_window_state *s = w->state;
    double step[SIZE], last[SIZE] = {0};
    const double freedom = 2.0 * s->observations - 3.0 * s->points - 6 * (FV_LENS_KEYFRAMES - 1);
    if (s->points < POINTS_MIN || freedom < POINTS_MIN) return false;
    for (int a = 0; a < SIZE - 1; a++)
        w->matrix[a * SIZE + a] = w->matrix[a * SIZE + a] * free_gauge + (a >= SIZE - 7 ? held : 0);
    last[SIZE - 1] = 1;
    memcpy(step, w->vector, sizeof step);
    if (!fv_ldlt_factor(w->matrix, SIZE)) return false;
    fv_ldlt_back(w->matrix, SIZE, step);
    fv_ldlt_back(w->matrix, SIZE, last);
    *found =
        (struct fv_lens_mismatch){.mismatch = step[SIZE - 1],
                                  .sigma = __builtin_sqrt(last[SIZE - 1] * (s->cost / freedom)),
                                  .newest = s->newest};
    return true;
}

bool fv_lens_window_unit(struct fv_lens_window *w, const struct fv_odometry *o,
                         struct fv_lens_mismatch *found)
{
    struct fv_lens_window_state *s = w->state;
    if (!stands(s, &o->map)) {
        fv_lens_window_begin(w, o);
        return false;
    }
    if (s->phase == FV_LENS_ADDING) {
        add_unit(w, &o->map);
        return false;
    }
    s->phase = FV_LENS_IDLE;
    return solve(w, found);
}

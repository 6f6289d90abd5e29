/* Closures: what a relation between two keyframes means for the map, whether that may be, and what
 * gravity says of it. */
#include "geometry/vec.h"
#include "map/closure.h"

enum { BELIEF_KEYFRAMES = 6 /* keyframes for which a confirmation waits for the next */ };

static const double scale_log_max = 0.7; /* within one map: drift does not double lengths */
static const double turn_max_rad = 0.6;
static const double drift_fraction_max = 0.1; /* of the path since the candidate */
static const double drift_slack = 0.3;        /* of the median depth */
/* Of what a relation tilts one keyframe against another by more than gravity is known to: maps
 * bend, and it is itself no surer. */
static const double tilt_slack_rad = 0.02, tilt_sigmas_max = 4;
/* Of two maps whose metres are known, beside what is not known of them, since they drift: logarithm
 * of a factor. */
static const double metres_log_max = 0.2, metres_sigmas_max = 3;

/* ---- drift ----------------------------------------------------------------------------------- */

static void centre_of(const struct fv_keyframe *keyframe, double centre[3])
{
    const double origin[3] = {0, 0, 0};
    fv_se3_apply_inverse(&keyframe->T_cam_world, origin, centre);
}

void fv_closure_correction(const struct fv_map *map, struct fv_closure_state *s)
{
    struct fv_sim3 T, wanted; /* S_keyframe_newworld */
    fv_sim3_from_se3(&map->keyframes[s->candidates[s->candidate].slot].T_cam_world, 1, &T);
    fv_sim3_compose(&s->S_keyframe_candidate, &T, &wanted);
    fv_sim3_from_se3(&map->keyframes[s->keyframe.slot].T_cam_world, 1, &T);
    fv_sim3_invert(&wanted, &wanted);
    fv_sim3_compose(&wanted, &T, &s->correction);
}

/* How far the keyframes came since the candidate was made, from parent to parent. */
static double path_since(const struct fv_map *map, uint32_t keyframe, uint64_t number)
{
    double length = 0;
    uint32_t at = keyframe;
    for (uint32_t n = 0; n < map->limits.keyframes && map->keyframes[at].number > number; n++) {
        int32_t parent = map->keyframes[at].parent;
        if (parent == FV_MAP_NONE || !map->keyframes[parent].used) break;
        double here[3], there[3], between[3];
        centre_of(&map->keyframes[at], here);
        centre_of(&map->keyframes[parent], there);
        fv_subtract3(here, there, between);
        length += fv_norm3(between);
        at = (uint32_t)parent;
    }
    return length;
}

/* Shift, rotation and scale (as a logarithm) of a similarity at a position. */
static void effect(const struct fv_sim3 *S, const double position[3], double *shift, double *turn,
                   double *scale)
{
    double moved[3], between[3], rotation[3];
    fv_sim3_apply(S, position, moved);
    fv_subtract3(moved, position, between);
    fv_so3_log(S->R, rotation);
    *shift = fv_norm3(between);
    *turn = fv_norm3(rotation);
    *scale = fv_abs(fv_log(S->s));
}

bool fv_closure_plausible(const struct fv_map *map, uint32_t keyframe, uint32_t candidate,
                          const struct fv_sim3 *correction)
{
    const struct fv_keyframe *k = &map->keyframes[keyframe], *c = &map->keyframes[candidate];
    double centre[3], shift, turn, scale;
    if (k->map_id != c->map_id) return correction->s > 0.02 && correction->s < 50;
    centre_of(k, centre);
    effect(correction, centre, &shift, &turn, &scale);
    return turn < turn_max_rad && scale < scale_log_max &&
           shift <
               drift_fraction_max * path_since(map, keyframe, c->number) + drift_slack * k->depth;
}

bool fv_closure_same(const struct fv_map *map, const struct fv_closure_state *s)
{
    const struct fv_closure_belief *belief = &s->belief;
    const struct fv_keyframe *k = &map->keyframes[s->keyframe.slot];
    if (belief->confirmations == 0 || !fv_closure_holds(map, belief->candidate) ||
        k->number > belief->number + BELIEF_KEYFRAMES ||
        map->keyframes[belief->candidate.slot].map_id !=
            map->keyframes[s->candidates[s->candidate].slot].map_id)
        return false;
    struct fv_sim3 inverse, off;
    double centre[3], shift, turn, scale;
    fv_sim3_invert(&belief->correction, &inverse);
    fv_sim3_compose(&inverse, &s->correction, &off);
    centre_of(k, centre);
    effect(&off, centre, &shift, &turn, &scale);
    return shift < 0.1 * k->depth && turn < 0.05 && scale < 0.1;
}

/* ---- gravity --------------------------------------------------------------------------------- */

/* Gravity in the axes of a keyframe's camera, as its map has it. */
static bool gravity_at(const struct fv_map *map, uint32_t slot, struct fv_map_gravity *gravity)
{
    const struct fv_keyframe *k = &map->keyframes[slot];
    struct fv_map_gravity known;
    if (!fv_map_upright(map, k->map_id, &known)) return false;
    fv_rotate3(k->T_cam_world.R, known.down, gravity->down);
    gravity->sigma = known.sigma;
    return true;
}

bool fv_closure_upright(const struct fv_closure_state *s, const struct fv_map *map)
{
    struct fv_map_gravity own, others;
    return gravity_at(map, s->keyframe.slot, &own) &&
           gravity_at(map, s->candidates[s->candidate].slot, &others);
}

/* Whether the lengths of two maps agree, where both say how long they are. */
static bool metres_agree(const struct fv_map *map, const struct fv_closure_state *s)
{
    const uint32_t own = map->keyframes[s->keyframe.slot].map_id,
                   others = map->keyframes[s->candidates[s->candidate].slot].map_id;
    double at_a, at_b;
    const double a = fv_map_scale_of(map, own, &at_a), b = fv_map_scale_of(map, others, &at_b);
    return own == others || !(a > 0) || !(b > 0) ||
           fv_abs(fv_log(s->S_keyframe_candidate.s * a / b)) <
               metres_log_max + metres_sigmas_max * __builtin_sqrt(at_a + at_b);
}

bool fv_closure_level(struct fv_closure *closure, const struct fv_map *map, bool rigid)
{
    struct fv_closure_state *s = closure->state;
    struct fv_map_gravity own, others;
    double turned[3], across[3];
    if (!gravity_at(map, s->keyframe.slot, &own) ||
        !gravity_at(map, s->candidates[s->candidate].slot, &others))
        return true;
    s->level = s->S_keyframe_candidate;
    fv_rotate3(s->level.R, others.down, turned);
    fv_cross3(turned, own.down, across);
    const double sigma = __builtin_sqrt(own.sigma * own.sigma + others.sigma * others.sigma);
    if (!metres_agree(map, s) || fv_dot3(turned, own.down) < 0 ||
        fv_norm3(across) > tilt_slack_rad + tilt_sigmas_max * sigma)
        return false;
    s->levelled = true;
    return fv_sim3_level(closure->correspondences, s->correspondence_count, 3, rigid, own.down,
                         others.down, &s->level);
}

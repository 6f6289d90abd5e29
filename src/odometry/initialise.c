/* The first map: which views to use, and whether their motion can be trusted. */
#include "odometry/initialise.h"

#include <string.h>

#include "geometry/vec.h"
#include "odometry/odometry.h"

enum {
    MATCHES_WANTED = 150, /* fewer, and a later one takes its place for the next frame */
    DISTANCE_MAX = 64,    /* Hamming */
    TRACKS_MAX = 800,     /* more bring nothing but time */
    TRACKS_TRIED = 200,   /* of them, on which motions are compared */
    SAMPLING_FRAMES = 3,  /* between samplings, while the last guess does not serve */
    SPREAD_STEP =
        7919, /* prime, above the number of features: steps of it visit every match once */
    WAITING_FRAMES_MAX = 60 /* then the view has changed too much to hope */
};

/* Where a view has few features: the share of them that must be matched, in place of MATCHES_WANTED
 * and of FOVEA_START_MATCHES_MIN */
static const double wanted_of_features = 0.3, start_of_features = 0.25;
static const double ratio_max = 0.8;
static const double direction_sigma_max_rad =
    0.05; /* of the baseline; more, and the first map may be bent */
static const double points_fraction_min = 0.6; /* of the tracks, that must fit in all views */
static const double parallax_fraction_min =
    0.3; /* of the points: of fewer, a thing that moves may be the cause */
static const double turn_cost_min =
    1.5; /* times the cost: less, and the camera may only have turned */
/* of fv_initialise_fit_clarity, chosen on odd seeds of sim:road: less, and the bundle is bent
 * between two motions */
static const double clarity_min = 0.88;
static const double rival_cost_min =
    1.15; /* times the best one's: less, and it is too early to choose */

void fv_initialiser_carve(struct fv_initialiser *in, struct fv_map *map, double focal_px,
                          uint32_t features_max, struct fv_arena *persistent,
                          struct fv_arena *frame)
{
    in->map = map;
    in->focal_px = focal_px;
    in->state = fv_arena_take(persistent, 1, sizeof *in->state);
    in->guessed_depth = fv_arena_take(persistent, features_max, sizeof *in->guessed_depth);
    in->pairs = fv_arena_take_raw(frame, features_max, sizeof *in->pairs);
    in->tracks = fv_arena_take_raw(frame, features_max, sizeof *in->tracks);
    in->depths = fv_arena_take_raw(frame, features_max, sizeof *in->depths);
    in->inlier = fv_arena_take_raw(frame, features_max, sizeof *in->inlier);
}

/* ---- waiting views --------------------------------------------------------------------------- */

static void drop_first(struct fv_initialise_state *s)
{
    const uint32_t slot = s->slots[0];
    s->count--;
    for (uint32_t i = 0; i < s->count; i++) {
        s->slots[i] = s->slots[i + 1];
        s->frames[i] = s->frames[i + 1];
        s->matched[i] = s->matched[i + 1];
    }
    s->slots[s->count] = slot;
}

/* Every second one goes, the first stays. */
static void thin_out(struct fv_initialise_state *s)
{
    for (uint32_t i = 1; 2 * i < s->count; i++) {
        const uint32_t slot = s->slots[i];
        s->slots[i] = s->slots[2 * i];
        s->slots[2 * i] = slot;
        s->frames[i] = s->frames[2 * i];
        s->matched[i] = s->matched[2 * i];
    }
    s->count = (s->count + 1) / 2;
    s->stride *= 2;
}

/* ---- matching -------------------------------------------------------------------------------- */

/* Matches of one view's features in another: nearest, clearly nearer than the second, one to one.
 * nearest[k] and second[k] are rewritten to the features of match k; returns their number. */
static uint32_t match_views(struct fv_map *map, struct fv_matches *matches,
                            const struct fv_kernels *kernels, uint32_t from, uint32_t to)
{
    const struct fv_map_frame a = fv_map_frame_at(map, from), b = fv_map_frame_at(map, to);
    uint32_t count_a = a.keyframe->features, count_b = b.keyframe->features, count = 0;
    kernels->hamming_two_u8(matches->nearest, matches->second, a.descriptors, (int32_t)count_a,
                            b.descriptors, (int32_t)count_b);
    for (uint32_t i = 0; i < count_b; i++)
        matches->distance[i] = UINT16_MAX;
    for (uint32_t i = 0; i < count_a; i++) {
        uint32_t distance = matches->nearest[i] >> FV_MATCH_INDEX_BITS,
                 feature = matches->nearest[i] & 0xffff;
        if (matches->nearest[i] != FV_MATCH_NONE && distance < matches->distance[feature])
            matches->distance[feature] = (uint16_t)distance;
    }
    for (uint32_t i = 0; i < count_a; i++) {
        uint32_t distance = matches->nearest[i] >> FV_MATCH_INDEX_BITS,
                 feature = matches->nearest[i] & 0xffff;
        if (matches->nearest[i] == FV_MATCH_NONE || distance > DISTANCE_MAX ||
            distance != matches->distance[feature] ||
            distance > ratio_max * (matches->second[i] >> FV_MATCH_INDEX_BITS))
            continue;
        matches->distance[feature] =
            0; /* taken: an equal one later is left out, unless it is a perfect match */
        matches->nearest[count] = i;
        matches->second[count++] = feature;
    }
    return count;
}

/* Matches to pairs of bearings and tracks of the first and the last view, in an order that spreads
 * any number of the first ones evenly over all of them. */
static uint32_t take_pairs(struct fv_odometry *o, uint32_t count,
                           const struct fv_initialise_bundle *b)
{
    const uint32_t last = b->view_count - 1, limit = TRACKS_MAX < o->window.limits.landmarks
                                                         ? TRACKS_MAX
                                                         : o->window.limits.landmarks;
    const uint32_t taken = count < limit ? count : limit;
    const struct fv_map_frame from = fv_map_frame_at(&o->map, b->slots[0]),
                              to = fv_map_frame_at(&o->map, b->slots[last]);
    for (uint32_t n = 0; n < taken; n++) {
        const uint32_t k = n * SPREAD_STEP % count, i = o->matches.nearest[k],
                       feature = o->matches.second[k];
        for (int axis = 0; axis < 3; axis++) {
            o->initialiser.pairs[n].x1[axis] = (double)from.keypoints[i].bearing[axis];
            o->initialiser.pairs[n].x2[axis] = (double)to.keypoints[feature].bearing[axis];
        }
        for (int v = 0; v < FV_INITIALISE_VIEWS_MAX; v++)
            o->initialiser.tracks[n].feature[v] = FV_MAP_NONE;
        o->initialiser.tracks[n].feature[0] = (int32_t)i;
        o->initialiser.tracks[n].feature[last] = (int32_t)feature;
    }
    return taken;
}

/* Links of a view's features to those of the first view: nearest[] and second[] hold the matches.
 */
static void note_matches(struct fv_map *map, struct fv_matches *matches,
                         struct fv_initialiser *initialiser, uint32_t held, uint32_t count)
{
    struct fv_initialise_state *s = initialiser->state;
    const struct fv_map_frame frame = fv_map_frame_at(map, s->slots[held]);
    for (uint32_t f = 0; f < frame.keyframe->features; f++)
        frame.landmark[f] = FV_MAP_NONE;
    for (uint32_t k = 0; k < count; k++)
        frame.landmark[matches->second[k]] = (int16_t)matches->nearest[k];
    s->matched[held] = s->frames[0];
}

/* When the first view has changed, those in between are matched with it anew, one in a frame. */
static void match_stale(struct fv_odometry *o, const struct fv_kernels *kernels)
{
    const struct fv_initialise_state *s = o->initialiser.state;
    for (uint32_t i = s->count; i-- > 1;)
        if (s->matched[i] != s->frames[0]) {
            note_matches(&o->map, &o->matches, &o->initialiser, i,
                         match_views(&o->map, &o->matches, kernels, s->slots[0], s->slots[i]));
            return;
        }
}

/* Find the tracks in the views in between. */
static void extend_tracks(struct fv_map *map, struct fv_initialiser *initialiser, uint32_t tracks,
                          const struct fv_initialise_bundle *b)
{
    const struct fv_map_frame first = fv_map_frame_at(map, b->slots[0]);
    for (uint32_t f = 0; f < first.keyframe->features; f++)
        first.landmark[f] = FV_MAP_NONE;
    for (uint32_t n = 0; n < tracks; n++)
        first.landmark[initialiser->tracks[n].feature[0]] = (int16_t)n;
    for (uint32_t v = 1; v + 1 < b->view_count; v++) {
        const struct fv_map_frame frame = fv_map_frame_at(map, b->slots[v]);
        for (uint32_t f = 0; f < frame.keyframe->features; f++) {
            const int32_t track =
                frame.landmark[f] == FV_MAP_NONE ? FV_MAP_NONE : first.landmark[frame.landmark[f]];
            if (track != FV_MAP_NONE) initialiser->tracks[track].feature[v] = (int32_t)f;
        }
    }
}

/* ---- waiting for more ------------------------------------------------------------------------ */

/* Hold the current view, which has `matches` with the first, unless it follows the last one too
 * closely. */
static void hold(struct fv_odometry *o, uint32_t matches, uint64_t first)
{
    struct fv_initialise_state *s = o->initialiser.state;
    if (s->count == 0) {
        s->stride = 1;
        for (uint32_t i = 0; i < FV_MAP_WAITING_MAX; i++)
            s->slots[i] = fv_map_waiting(&o->map, i);
    }
    if (s->count > 0 && o->state->frame_number - s->frames[s->count - 1] < s->stride) return;
    if (s->count == FV_MAP_WAITING_MAX) thin_out(s);
    const uint32_t held = s->count++;
    s->frames[held] = o->state->frame_number;
    s->matched[held] = 0;
    fv_map_copy_frame(&o->map, fv_map_current(&o->map), s->slots[held]);
    o->map.keyframes[s->slots[held]].T_cam_world =
        s->guess; /* as long as the first view stays the same */
    if (held > 0 && s->frames[0] == first)
        note_matches(&o->map, &o->matches, &o->initialiser, held, matches);
}

/* ---- choosing -------------------------------------------------------------------------------- */

/* The first view held, some of those in between that are matched with it, and the current one. */
static void choose_views(const struct fv_odometry *o, struct fv_initialise_bundle *b)
{
    const struct fv_initialise_state *s = o->initialiser.state;
    const double span = (double)(o->state->frame_number - s->frames[0]);
    uint32_t ready[FV_MAP_WAITING_MAX], between = 0;
    for (uint32_t i = 1; i < s->count; i++)
        if (s->matched[i] == s->frames[0]) ready[between++] = i;
    const uint32_t middle = between < FV_INITIALISE_MIDDLE_MAX ? between : FV_INITIALISE_MIDDLE_MAX;
    b->view_count = middle + 2;
    b->slots[0] = s->slots[0];
    b->fraction[0] = 0;
    for (uint32_t m = 0; m < middle; m++) {
        const uint32_t at = ready[(2 * m + 1) * between / (2 * middle)];
        b->slots[m + 1] = s->slots[at];
        b->fraction[m + 1] = (double)(s->frames[at] - s->frames[0]) / span;
    }
    b->slots[middle + 1] = fv_map_current(&o->map);
    b->fraction[middle + 1] = 1;
}

/* Whether a bundle of this number of tracks is good enough for the first map. */
static bool serves(const struct fv_initialise_bundle *b, uint32_t tracks,
                   uint32_t parallax_points_min)
{
    return b->points >= points_fraction_min * tracks && b->parallax_points >= parallax_points_min &&
           b->parallax_points >= parallax_fraction_min * b->points &&
           b->direction_sigma <= direction_sigma_max_rad;
}

/* Keep the better of two bundles in `best`, and the cost of the best one that ended at another
 * motion in `rival`. */
static void compare(struct fv_initialiser *initialiser, uint64_t frame_number, uint32_t tried,
                    uint32_t tracks, const struct fv_initialise_bundle *candidate,
                    struct fv_initialise_bundle *best, double *rival)
{
    const bool same = best->cost < 1e300 && fv_initialise_same(best, candidate);
    if (candidate->cost < best->cost) {
        if (!same) *rival = best->cost;
        *best = *candidate;
        fv_initialise_note_guess(initialiser, frame_number, tried, tracks, best);
    } else if (!same && candidate->cost < *rival) {
        *rival = candidate->cost;
    }
}

/* Bundle the last guess, on some of the tracks, and when that serves, or has not served for some
 * frames, every motion that two views allow as well. True when one is clearly the best. */
static bool choose(struct fv_odometry *o, uint32_t tracks, struct fv_initialise_bundle *best)
{
    struct fv_initialise_state *s = o->initialiser.state;
    struct fv_se3 motions[FV_INITIALISE_MOTIONS_MAX];
    struct fv_initialise_bundle candidate = *best;
    const uint32_t tried = tracks < TRACKS_TRIED ? tracks : TRACKS_TRIED,
                   parallax_points_min = FV_INITIALISE_POINTS_MIN * tried / tracks / 2;
    double rival = 1e300;
    best->cost = 1e300;
    extend_tracks(&o->map, &o->initialiser, tracks, best);
    if (fv_initialise_guess_again(&o->initialiser, tried, &candidate)) {
        fv_initialise_adjust(&o->initialiser, tried, FV_INITIALISE_FAIR, &candidate);
        compare(&o->initialiser, o->state->frame_number, tried, tracks, &candidate, best, &rival);
    }
    if (!(best->cost < 1e300 && serves(best, tried, parallax_points_min)) &&
        o->state->frame_number - s->sampled < SAMPLING_FRAMES)
        return false;
    s->sampled = o->state->frame_number;
    const uint32_t count =
        fv_initialise_motions(&o->initialiser, &o->state->random, tracks, motions);
    /* A rough guess may lead past what moves into the wrong minimum, a sure one cannot go far: both
     * are tried. */
    static const enum fv_initialise_trust trusts[] = {FV_INITIALISE_ROUGH, FV_INITIALISE_SURE};
    for (uint32_t k = 0; k < 2 * count; k++) {
        if (!fv_initialise_guess_motion(&o->initialiser, tried, &motions[k / 2], &candidate))
            continue;
        fv_initialise_adjust(&o->initialiser, tried, trusts[k % 2], &candidate);
        compare(&o->initialiser, o->state->frame_number, tried, tracks, &candidate, best, &rival);
    }
    candidate = *best;
    if (best->cost < 1e300 && fv_initialise_guess_reversed(&o->initialiser, tried, &candidate)) {
        fv_initialise_adjust(&o->initialiser, tried, FV_INITIALISE_ROUGH, &candidate);
        compare(&o->initialiser, o->state->frame_number, tried, tracks, &candidate, best, &rival);
    }
    return best->cost < 1e300 && rival >= rival_cost_min * best->cost &&
           serves(best, tried, parallax_points_min);
}

/* The chosen motion, adjusted on all tracks, must hold as well, and explain them far better than
 * turning alone. */
static bool confirm(struct fv_initialiser *initialiser, uint32_t tracks,
                    struct fv_initialise_bundle *b)
{
    const double turn_cost = fv_initialise_turn_cost(initialiser, tracks, b);
    if (!fv_initialise_guess_again(initialiser, tracks, b)) return false;
    fv_initialise_adjust(initialiser, tracks, FV_INITIALISE_FINE, b);
    return serves(b, tracks, FV_INITIALISE_POINTS_MIN) && turn_cost >= turn_cost_min * b->cost &&
           fv_initialise_fit_clarity(initialiser, tracks, b) >= clarity_min;
}

/* ---- the map --------------------------------------------------------------------------------- */

/* What makes the median depth of the points that will be landmarks 1. */
static double unit_scale(const struct fv_initialiser *in, uint32_t tracks)
{
    double low = 1e-4, high = 1e3;
    for (int step = 0; step < 30; step++) {
        double middle = __builtin_sqrt(low * high);
        uint32_t below = 0, all = 0;
        for (uint32_t i = 0; i < tracks; i++) {
            if (!in->inlier[i]) continue;
            all++;
            below += in->depths[i].value < middle * in->pairs[i].x1[2];
        }
        *(2 * below > all ? &high : &low) = middle;
    }
    return __builtin_sqrt(low * high);
}

static void add_track(struct fv_odometry *o, const struct fv_initialise_bundle *b,
                      const uint32_t *keyframes, uint32_t track, double scale)
{
    const uint32_t last = b->view_count - 1;
    const struct fv_map_frame current = fv_map_frame_at(&o->map, fv_map_current(&o->map));
    double point[3];
    for (int k = 0; k < 3; k++)
        point[k] = scale / o->initialiser.depths[track].value * o->initialiser.pairs[track].x1[k];
    int32_t landmark = fv_map_add_landmark(&o->map, point, o->state->frame_number);
    if (landmark == FV_MAP_NONE) return;
    for (uint32_t v = 0; v <= last; v++)
        if (o->initialiser.tracks[track].feature[v] != FV_MAP_NONE)
            (void)fv_map_link(&o->map, (uint32_t)landmark, keyframes[v],
                              (uint32_t)o->initialiser.tracks[track].feature[v]);
    fv_map_refresh_landmark(&o->map, (uint32_t)landmark);
    const uint32_t feature = (uint32_t)o->initialiser.tracks[track].feature[last];
    current.landmark[feature] = (int16_t)landmark;
    const struct fv_recent recent = {(uint32_t)landmark, o->map.landmarks[landmark].generation,
                                     current.points[feature].level};
    o->localiser.recent[o->state->localise.recent_count++] = recent;
}

/* The first views tell how the camera moves: the next frame is looked for there. */
static void note_motion(struct fv_odometry *o, uint32_t before)
{
    const struct fv_keyframe *last = &o->map.keyframes[o->state->newest],
                             *earlier = &o->map.keyframes[before];
    fv_motion_note(&o->state->localise.motion, &earlier->T_cam_world, earlier->stamp_ns,
                   &last->T_cam_world, last->stamp_ns);
}

static void make_first_map(struct fv_odometry *o, uint32_t tracks,
                           const struct fv_initialise_bundle *b)
{
    struct fv_odometry_state *s = o->state;
    uint32_t keyframes[FV_INITIALISE_VIEWS_MAX];
    for (uint32_t i = 0; i < tracks; i++)
        o->initialiser.inlier[i] = fv_initialise_point_serves(&o->initialiser, b, i);
    const double scale = unit_scale(&o->initialiser, tracks);
    if (o->map.state->keyframe_count > 0) fv_map_begin_another(&o->map);
    fv_map_make_room(&o->map, tracks, s->frame_number);
    s->first_keyframe = o->map.state->keyframe_number;
    fv_agreement_begin(&s->agreement);
    fv_usable_forget(&s->usable);
    for (uint32_t v = 0; v < b->view_count; v++) {
        struct fv_se3 *T = &o->map.keyframes[b->slots[v]].T_cam_world;
        *T = b->T_view_first[v];
        for (int i = 0; i < 3; i++)
            T->t[i] *= scale;
        keyframes[v] = fv_map_add_keyframe(&o->map, b->slots[v]);
        o->map.keyframes[keyframes[v]].depth = 1;
        o->map.keyframes[keyframes[v]].parent = v > 0 ? (int32_t)keyframes[v - 1] : FV_MAP_NONE;
    }
    s->newest = keyframes[b->view_count - 1];
    note_motion(o, (uint32_t)o->map.keyframes[s->newest].parent);
    o->map.keyframes[fv_map_current(&o->map)].parent = (int32_t)s->newest;
    s->localise.recent_count = 0;
    for (uint32_t i = 0; i < tracks; i++)
        if (o->initialiser.inlier[i]) add_track(o, b, keyframes, i, scale);
    s->keyframe_frame = s->frame_number;
    s->keyframe_matches = s->localise.recent_count;
    s->job_wanted = true;
    fv_odometry_queue(o, s->newest);
}

/* The matches that a view needs: `matches`, or this share of its features where that is less, but
 * at least the points of a first map. */
static uint32_t matches_of(const struct fv_map *map, uint32_t view, uint32_t matches, double share)
{
    const double few = share * (double)fv_map_frame_at(map, view).keyframe->features;
    if (few < FV_INITIALISE_POINTS_MIN) return FV_INITIALISE_POINTS_MIN;
    return few < matches ? (uint32_t)few : matches;
}

/* Matches of the first view that serves; those that do not are dropped, at most half of them in one
 * frame. */
static uint32_t match_first(struct fv_odometry *o, const struct fv_kernels *kernels)
{
    struct fv_initialise_state *s = o->initialiser.state;
    for (int attempt = 0; attempt < 2 && s->count > 0; attempt++) {
        uint32_t count =
            match_views(&o->map, &o->matches, kernels, s->slots[0], fv_map_current(&o->map));
        if (count >= matches_of(&o->map, s->slots[0], FOVEA_START_MATCHES_MIN, start_of_features))
            return count;
        for (uint32_t drop = (s->count + 1) / 2; drop > 0; drop--)
            drop_first(s);
    }
    s->count = 0;
    return 0;
}

bool fv_odometry_initialise(struct fv_odometry *o, const struct fv_kernels *kernels)
{
    struct fv_initialise_state *s = o->initialiser.state;
    if (s->count > 0) match_stale(o, kernels);
    const uint32_t matches = s->count > 0 ? match_first(o, kernels) : 0;
    const uint64_t first = s->frames[0];
    if (s->count >= 2) {
        struct fv_initialise_bundle bundle;
        memset(&bundle, 0, sizeof bundle);
        choose_views(o, &bundle);
        const uint32_t tracks = take_pairs(o, matches, &bundle);
        if (tracks > 0 && choose(o, tracks, &bundle) && confirm(&o->initialiser, tracks, &bundle)) {
            fv_window_abort(&o->window);
            make_first_map(o, tracks, &bundle);
            s->count = 0;
            o->state->pose.matches = tracks;
            o->state->pose.inliers = o->state->localise.recent_count;
            return true;
        }
    }
    if (s->count > 1 &&
        (matches < matches_of(&o->map, s->slots[0], MATCHES_WANTED, wanted_of_features) ||
         o->state->frame_number - s->frames[0] > WAITING_FRAMES_MAX))
        drop_first(s);
    hold(o, matches, first);
    o->state->pose.matches = matches;
    return false;
}

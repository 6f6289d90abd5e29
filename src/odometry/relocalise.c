#include "odometry/relocalise.h"

#include <string.h>

#include "geometry/vec.h"
#include "odometry/odometry.h"

enum { SHARED_SAME_PLACE = 20 }; /* landmarks shared, by which two candidates are one place */

static const double least_score =
    0.12 * FV_PLACE_ONE; /* below, frames have no more in common than two arbitrary ones */
static const double inlier_fraction_min = 0.5; /* of the matches of the guided search */
/* Inliers of the landmarks that the pose should see, and of the frame's features: one of the two
 * must be reached. In simulation, at a wrong place that has one thing in common with the right one
 * (a bookcase of the same make) 0.05 to 0.29 and up to 0.08 are found, seldom both; at the right
 * one 0.2 and more of both, where the map is bent too. */
static const double found_fraction_min = 0.25, view_fraction_min = 0.125;

void fv_relocaliser_carve(struct fv_relocaliser *r, uint32_t keyframes, struct fv_arena *persistent,
                          struct fv_arena *frame)
{
    fv_place_carve(&r->place, keyframes, persistent);
    r->index = fv_arena_take(persistent, 1, sizeof *r->index);
    r->words = fv_arena_take_raw(frame, 1, sizeof *r->words);
    r->scores = fv_arena_take_raw(frame, keyframes, sizeof *r->scores);
    r->gathered = fv_arena_take_raw(frame, FV_RELOCALISE_LANDMARKS, FV_MAP_DESCRIPTOR_BYTES);
}

void fv_relocaliser_reset(struct fv_relocaliser *r)
{
    fv_place_clear(&r->place);
    memset(r->index, 0, sizeof *r->index);
}

/* ---- the index ------------------------------------------------------------------------------- */

/* A keyframe without an entry; FV_MAP_NONE: all have one. */
static int32_t unindexed(const struct fv_map *map, const struct fv_place *place)
{
    for (uint32_t k = 0; k < map->limits.keyframes; k++)
        if (map->keyframes[k].used && !fv_place_holds(place, k, map->keyframes[k].generation))
            return (int32_t)k;
    return FV_MAP_NONE;
}

bool fv_odometry_index_waiting(const struct fv_odometry *o)
{
    return unindexed(&o->map, &o->relocaliser.place) != FV_MAP_NONE;
}

void fv_odometry_index_unit(struct fv_odometry *o, const struct fv_kernels *kernels)
{
    struct fv_index_state *index = o->relocaliser.index;
    if (!index->busy || !fv_map_holds(&o->map, index->slot, index->generation)) {
        const int32_t slot = unindexed(&o->map, &o->relocaliser.place);
        index->busy = slot != FV_MAP_NONE;
        if (!index->busy) return;
        index->slot = (uint32_t)slot;
        index->generation = o->map.keyframes[slot].generation;
        index->next = 0;
        fv_place_words_begin(&index->words);
    }
    const struct fv_map_frame frame = fv_map_frame_at(&o->map, index->slot);
    const uint32_t left = frame.keyframe->features - index->next,
                   some = left < FV_PLACE_UNIT ? left : FV_PLACE_UNIT;
    fv_place_words_add(&index->words, kernels,
                       frame.descriptors + (size_t)index->next * FV_MAP_DESCRIPTOR_BYTES, some);
    index->next += some;
    if (index->next < frame.keyframe->features) return;
    fv_place_insert(&o->relocaliser.place, index->slot, index->generation, &index->words);
    index->busy = false;
    if (o->config.closures && !o->config.localise_only &&
        o->map.keyframes[index->slot].map_id == o->map.state->map_id)
        fv_closure_offer(&o->closure, &o->map, &o->relocaliser.place, &index->words, index->slot);
}

/* ---- one candidate --------------------------------------------------------------------------- */

/* Landmarks that a keyframe sees, into o->localiser.local from `count` on; returns the new count.
 */
static uint32_t gather_keyframe(struct fv_map *map, struct fv_localiser *localiser,
                                struct fv_relocaliser *relocaliser, uint32_t slot, uint32_t mark,
                                uint32_t count)
{
    const struct fv_map_frame frame = fv_map_frame_at(map, slot);
    for (uint32_t f = 0; f < frame.keyframe->features && count < FV_RELOCALISE_LANDMARKS; f++) {
        if (frame.landmark[f] == FV_MAP_NONE || map->landmarks[frame.landmark[f]].mark == mark)
            continue;
        struct fv_landmark *l = &map->landmarks[frame.landmark[f]];
        l->mark = mark;
        memcpy(relocaliser->gathered + (size_t)count * FV_MAP_DESCRIPTOR_BYTES,
               fv_map_descriptor(map, l), FV_MAP_DESCRIPTOR_BYTES);
        localiser->local[count++] = (uint32_t)frame.landmark[f];
    }
    return count;
}

/* Match the frame's descriptors with those of the landmarks around a keyframe; each landmark is
 * given to the nearest. */
static uint32_t match_keyframe(struct fv_odometry *o, const struct fv_kernels *kernels,
                               const struct fv_map_frame *frame, uint32_t slot)
{
    struct fv_neighbour neighbours[FV_RELOCALISE_NEIGHBOURS];
    const uint32_t mark = ++o->map.state->mark;
    uint32_t near = fv_map_neighbours(&o->map, slot, 1, neighbours, FV_RELOCALISE_NEIGHBOURS);
    uint32_t count = gather_keyframe(&o->map, &o->localiser, &o->relocaliser, slot, mark, 0),
             matches = 0;
    for (uint32_t i = 0; i < near; i++)
        count = gather_keyframe(&o->map, &o->localiser, &o->relocaliser, neighbours[i].slot, mark,
                                count);
    kernels->hamming_two_u8(o->matches.nearest, o->matches.second, frame->descriptors,
                            (int32_t)frame->keyframe->features, o->relocaliser.gathered,
                            (int32_t)count);
    fv_matches_clear(&o->matches, frame);
    for (uint32_t f = 0; f < frame->keyframe->features; f++) {
        const uint32_t distance = o->matches.nearest[f] >> FV_MATCH_INDEX_BITS;
        if (o->matches.nearest[f] == FV_MATCH_NONE || distance > FV_PLACE_DISTANCE_MAX ||
            distance > FV_PLACE_RATIO_MAX * (o->matches.second[f] >> FV_MATCH_INDEX_BITS))
            continue;
        frame->landmark[f] = (int16_t)o->localiser.local[o->matches.nearest[f] & 0xffff];
        matches++;
    }
    return matches;
}

/* Inliers that make a place: one feature in twenty, within bounds. */
static uint32_t inliers_wanted(uint32_t features)
{
    const uint32_t wanted = features / 20;
    return wanted < FV_RELOCALISED_INLIERS_MIN   ? FV_RELOCALISED_INLIERS_MIN
           : wanted > FV_RELOCALISED_INLIERS_MAX ? FV_RELOCALISED_INLIERS_MAX
                                                 : wanted;
}

bool fv_odometry_try_keyframe(struct fv_odometry *o, const struct fv_kernels *kernels,
                              uint32_t slot, struct fv_se3 *T, struct fv_pose_fit *fit)
{
    const struct fv_map_frame frame = fv_map_frame_at(&o->map, fv_map_current(&o->map));
    if (match_keyframe(o, kernels, &frame, slot) < FV_PLACE_MATCHES_MIN) return false;
    const uint32_t observations = fv_localiser_collect(&o->localiser, &o->map, &frame);
    const struct fv_sampling sampling = {4.0 / o->focal_px, 0.99, FV_PLACE_SAMPLES_MAX};
    if (fv_pose_sample(o->localiser.observations, observations, &sampling, &o->state->random, T) <
        FV_PLACE_SAMPLED_MIN)
        return false;
    for (uint32_t i = 0; i < observations; i++)
        if (!o->localiser.observations[i].inlier)
            frame.landmark[o->localiser.observed_feature[i]] = FV_MAP_NONE;
    if (fv_localiser_refine(&o->localiser, &o->map, &frame, 3, 5, T, fit) < FV_PLACE_SAMPLED_MIN)
        return false;
    const uint32_t visible = fit->inliers + fv_odometry_match_local(o, kernels, &frame, T, 2);
    const uint32_t matches = fv_localiser_collect(&o->localiser, &o->map, &frame);
    if (fv_localiser_refine(&o->localiser, &o->map, &frame, 3, 5, T, fit) <
        inliers_wanted(frame.keyframe->features))
        return false;
    return fit->inliers > inlier_fraction_min * matches &&
           (fit->inliers > found_fraction_min * visible ||
            fit->inliers > view_fraction_min * frame.keyframe->features);
}

/* ---- all candidates -------------------------------------------------------------------------- */

/* The frame hangs on this keyframe from now on, in its map; where that is published in another
 * frame, poses before and after have no common frame. */
static void enter(struct fv_odometry *o, uint32_t slot)
{
    struct fv_odometry_state *s = o->state;
    const uint32_t odom_id = o->map.state->odom_id, map_id = o->map.keyframes[slot].map_id;
    if (map_id != o->map.state->map_id) fv_agreement_forget(&s->agreement);
    /* What is kept was found right, but for the young map that follows one given up. */
    if (map_id != o->map.state->map_id || map_id == s->agreement.drop_map)
        s->agreement.suspect = false;
    s->newest = slot;
    s->keyframe_frame = s->frame_number;
    s->keyframe_matches = o->map.keyframes[slot].landmarks;
    o->map.keyframes[fv_map_current(&o->map)].parent = (int32_t)slot;
    fv_map_enter(&o->map, map_id);
    s->reset_counter += o->map.state->odom_id != odom_id;
}

/* What another camera saw, which is known by metres from the first, is looked for in metres. */
static bool serves(const struct fv_odometry *o, const struct fv_map_frame *frame, uint32_t slot)
{
    return fv_norm3(frame->keyframe->seen_from) == 0 ||
           fv_map_metric_of(&o->map, o->map.keyframes[slot].map_id);
}

bool fv_odometry_relocalise(struct fv_odometry *o, const struct fv_kernels *kernels,
                            struct fv_se3 *T, struct fv_pose_fit *fit)
{
    struct fv_relocaliser *r = &o->relocaliser;
    const struct fv_map_frame frame = fv_map_frame_at(&o->map, fv_map_current(&o->map));
    struct fv_place_set among = {{0}};
    for (uint32_t k = 0; k < o->map.limits.keyframes; k++)
        if (o->map.keyframes[k].used && !fv_odometry_given_up(o, k) &&
            fv_place_holds(&r->place, k, o->map.keyframes[k].generation) && serves(o, &frame, k))
            fv_place_set_add(&among, k);
    fv_place_words_begin(r->words);
    fv_place_words_add(r->words, kernels, frame.descriptors, frame.keyframe->features);
    fv_place_scores(&r->place, r->words, &among, r->scores);
    for (int attempt = 0; attempt < FV_RELOCALISE_TRIES; attempt++) {
        struct fv_place_candidate best;
        struct fv_neighbour same[FV_PLACE_NEIGHBOURS_MAX];
        if (fv_place_best(r->scores, o->map.limits.keyframes, (uint32_t)least_score, &best, 1) == 0)
            break;
        if (fv_odometry_try_keyframe(o, kernels, best.slot, T, fit)) {
            enter(o, best.slot);
            return true;
        }
        r->scores[best.slot] = 0; /* and its neighbours: the next try is another place */
        const uint32_t count =
            fv_map_neighbours(&o->map, best.slot, SHARED_SAME_PLACE, same, FV_PLACE_NEIGHBOURS_MAX);
        for (uint32_t i = 0; i < count; i++)
            r->scores[same[i].slot] = 0;
    }
    fv_matches_clear(&o->matches, &frame);
    return false;
}

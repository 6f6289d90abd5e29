/* Of closures: matches, similarities, and the confirmation. */
#include "map/closure.c"

#include "bounds/counter.h"
#include "bounds/full_map.h"
#include "bounds/limits.h"
#include "bounds/pieces.h"

LIMIT(SAMPLE_TESTS_PER_UNIT, CLOSURE_TESTS);
LIMIT(SAMPLE_SOLVED_TESTS, CLOSURE_TESTS_OF_SAMPLE);
LIMIT(REFINEMENTS, CLOSURE_REFINEMENTS);
LIMIT(QUERIES_PER_UNIT, CLOSURE_QUERIES);

struct closing {
    struct fovea *rt;
    struct fv_closure *closure;
    struct fv_map *map;
    struct fv_sim3 S;
    struct fv_sim3_certainty certainty;
};

static void gather(void *context)
{
    struct closing *c = context;
    (void)gather_features(c->map, c->closure->state->keyframe.slot, c->closure->query_feature,
                          c->closure->queries);
}

static void match(void *context)
{
    struct closing *c = context;
    c->rt->kernels.hamming_two_u8(c->closure->nearest, c->closure->second, c->closure->queries,
                                  QUERIES_PER_UNIT, c->closure->trains,
                                  (int32_t)c->map->limits.features);
}

static void correspond(void *context)
{
    struct closing *c = context;
    make_correspondences(c->closure, c->map);
}

static void judge_inliers(void *context)
{
    struct closing *c = context;
    struct fv_closure_state *s = c->closure->state;
    s->search.done = s->search.bound = FV_PLACE_SAMPLES_MAX;
    fv_sim3_identity(&s->search.best);
    sample_unit(c->closure);
}

static void refine_all(void *context)
{
    struct closing *c = context;
    (void)fv_sim3_refine(c->closure->correspondences, c->closure->state->correspondence_count,
                         1e300, 3, false, &c->S);
}

static void level_all(void *context)
{
    static const double down[3] = {0, 1, 0};
    struct closing *c = context;
    (void)fv_sim3_level(c->closure->correspondences, c->closure->state->correspondence_count, 3,
                        false, down, down, &c->S);
}

static void group(void *context)
{
    struct closing *c = context;
    gather_group(c->closure, c->map);
}

static void plausible(void *context)
{
    struct closing *c = context;
    const struct fv_closure_state *s = c->closure->state;
    (void)fv_closure_plausible(c->map, s->keyframe.slot, s->candidates[0].slot, &c->S);
    (void)fv_closure_same(c->map, s);
    fv_sim3_judge(c->closure->correspondences, s->correspondence_count, &c->S, &c->certainty);
}

static void offer(void *context)
{
    struct closing *c = context;
    c->closure->state->phase = FV_CLOSURE_IDLE;
    fv_closure_offer(c->closure, c->map, &c->rt->odometry.relocaliser.place,
                     c->rt->odometry.relocaliser.words, c->closure->state->keyframe.slot);
}

/* After pieces_of_relocalise, whose words it takes. */
void pieces_of_closure(struct fovea *rt)
{
    struct fv_odometry *o = &rt->odometry;
    struct closing c = {.rt = rt, .closure = &o->closure, .map = &o->map};
    struct fv_closure_state *s = o->closure.state;
    const uint32_t features = o->map.limits.features;
    full_map_fill(o, FV_MAP_OBSERVERS_MAX);
    s->keyframe = handle_of(&o->map, o->state->newest);
    s->candidates[0] = handle_of(&o->map, 0);
    s->candidate_count = 1;
    s->candidate = 0;
    for (uint32_t k = 0; k < o->map.limits.keyframes; k++)
        fv_place_insert(&o->relocaliser.place, k, o->map.keyframes[k].generation,
                        o->relocaliser.words);
    NOTE(closure_offered, offer, &c, 1);
    s->candidates[0] = handle_of(&o->map, 0);
    s->candidate_count = 1;
    s->candidate = 0;
    NOTE(features_gathered, gather, &c, 1);
    NOTE(closure_matched, match, &c, 1);
    s->query_count = s->train_count = features;
    for (uint32_t f = 0; f < features; f++) {
        o->closure.query_feature[f] = o->closure.train_feature[f] = (uint16_t)f;
        o->closure.nearest[f] = f;
        o->closure.second[f] = 200u << FV_MATCH_INDEX_BITS;
    }
    NOTE(correspondences_made, correspond, &c, 1);
    NOTE(similarity_judged, judge_inliers, &c, 1);
    fv_sim3_identity(&c.S);
    for (uint32_t i = 0; i < s->correspondence_count; i++)
        o->closure.correspondences[i].inlier = true;
    NOTE(similarity_refined, refine_all, &c, 1);
    NOTE(group_gathered, group, &c, 1);
    fv_sim3_identity(&c.S);
    s->correction = c.S;
    for (uint32_t i = 0; i < s->correspondence_count; i++)
        o->closure.correspondences[i].inlier = true;
    NOTE(closure_judged, plausible, &c, 1);
    NOTE(similarity_levelled, level_all, &c, 1);
}

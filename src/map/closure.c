#include "map/closure.h"

#include <string.h>

#include "geometry/vec.h"
#include "geometry/chi_square.h"

enum {
    RECENT_KEYFRAMES = 8, /* too near in time to be a closure */
    SHARED_KNOWN = 5,     /* landmarks shared, from which on two keyframes know of each other */
    QUERIES_PER_UNIT = 64,
    SAMPLE_TESTS_PER_UNIT = 1500, /* correspondences tested, all samples together */
    SAMPLE_SOLVED_TESTS =
        50, /* this number of tests takes as long as the closed form of a sample */
    REFINEMENTS = 2,
    CORRESPONDENCES_MIN = 25, /* that agree after the guided search */
    FOUND_MIN = 40,           /* landmarks of the group found in the keyframe */
    FOUND_BEFORE_MIN = 30,    /* in one before it */
    ASKED_BEFORE_MAX = 4
};

static const double least_score = 0.1 * FV_PLACE_ONE;
static const double score_fraction =
    0.6; /* of the worst neighbour's score, that a candidate must reach */
static const double found_fraction_min = 0.3; /* of the group's visible landmarks */
/* A relation less certain corrects nothing: a wall seen from afar is as tilted in the map as its
 * few degrees allow. */
static const double turn_sigma_max_rad = 0.02;
/* Between maps in metres, a scale further from 1 than that is another place. Beside pixels it has
 * the drift over the keyframes that placed the landmarks: up to 1.1 % where .3 % of the way is. */
static const double scale_sigmas_max = 3, scale_sigma_least = 0.01;
static const double distance_sigma_least = 0.01;

/* ---- memory ---------------------------------------------------------------------------------- */

void fv_closure_carve(struct fv_closure *closure, const struct fv_map_limits *limits,
                      struct fv_arena *persistent, struct fv_arena *job)
{
    const struct fv_pose_graph_limits graph = {
        limits->keyframes, limits->keyframes * FV_CLOSURE_HELD_BY_KEYFRAME + FV_MAP_EDGES_MAX + 1,
        12, 200};
    closure->state = fv_arena_take(persistent, 1, sizeof *closure->state);
    fv_pose_graph_carve(&closure->graph, &graph, job);
    closure->query_feature = fv_arena_take(job, limits->features, sizeof *closure->query_feature);
    closure->train_feature = fv_arena_take(job, limits->features, sizeof *closure->train_feature);
    closure->queries = fv_arena_take(job, limits->features, FV_MAP_DESCRIPTOR_BYTES);
    closure->trains = fv_arena_take(job, limits->features, FV_MAP_DESCRIPTOR_BYTES);
    closure->nearest = fv_arena_take(job, limits->features, sizeof *closure->nearest);
    closure->second = fv_arena_take(job, limits->features, sizeof *closure->second);
    closure->best_of_train = fv_arena_take(job, limits->features, sizeof *closure->best_of_train);
    closure->correspondences =
        fv_arena_take(job, limits->features, sizeof *closure->correspondences);
    closure->group = fv_arena_take(job, FV_CLOSURE_GROUP_MAX, sizeof *closure->group);
    closure->node_of = fv_arena_take(job, limits->keyframes, sizeof *closure->node_of);
    closure->nodes = fv_arena_take(job, limits->keyframes, sizeof *closure->nodes);
    closure->corrections = fv_arena_take(job, limits->keyframes + 1, sizeof *closure->corrections);
    closure->corrected = fv_arena_take(job, limits->keyframes + 1, sizeof *closure->corrected);
    closure->scores = fv_arena_take(job, limits->keyframes, sizeof *closure->scores);
}

void fv_closure_reset(struct fv_closure *closure, uint64_t seed)
{
    memset(closure->state, 0, sizeof *closure->state);
    fv_random_seed(&closure->state->random, seed);
}

bool fv_closure_holds(const struct fv_map *map, struct fv_map_handle handle)
{
    return fv_map_holds(map, handle.slot, handle.generation);
}

static struct fv_map_handle handle_of(const struct fv_map *map, uint32_t slot)
{
    return (struct fv_map_handle){slot, map->keyframes[slot].generation};
}

bool fv_closure_waiting(const struct fv_closure *closure)
{
    return closure->state->phase != FV_CLOSURE_IDLE;
}

/* ---- candidates ------------------------------------------------------------------------------ */

/* Score below which a keyframe is less like the offered one than its own neighbours are. */
static uint32_t least_score_of(struct fv_closure *closure, const struct fv_map *map,
                               const struct fv_place *place, const struct fv_place_words *words,
                               uint32_t slot)
{
    struct fv_neighbour near[FV_CLOSURE_NEIGHBOURS];
    struct fv_place_set among = {{0}};
    uint32_t count = fv_map_neighbours(map, slot, 30, near, FV_CLOSURE_NEIGHBOURS),
             least = FV_PLACE_ONE;
    for (uint32_t i = 0; i < count; i++)
        if (fv_place_holds(place, near[i].slot, near[i].generation))
            fv_place_set_add(&among, near[i].slot);
    fv_place_scores(place, words, &among, closure->scores);
    for (uint32_t i = 0; i < count; i++)
        if (closure->scores[near[i].slot] > 0 && closure->scores[near[i].slot] < least)
            least = closure->scores[near[i].slot];
    least = (uint32_t)(score_fraction * least);
    return least > (uint32_t)least_score ? least : (uint32_t)least_score;
}

static void pick_candidates(struct fv_closure *closure, const struct fv_map *map, uint32_t least)
{
    struct fv_closure_state *s = closure->state;
    s->candidate_count = 0;
    while (s->candidate_count < FV_CLOSURE_CANDIDATES_MAX) {
        struct fv_place_candidate best;
        struct fv_neighbour same[FV_PLACE_NEIGHBOURS_MAX];
        if (fv_place_best(closure->scores, map->limits.keyframes, least, &best, 1) == 0) return;
        s->candidates[s->candidate_count++] = handle_of(map, best.slot);
        closure->scores[best.slot] = 0;
        uint32_t count =
            fv_map_neighbours(map, best.slot, SHARED_KNOWN, same, FV_PLACE_NEIGHBOURS_MAX);
        for (uint32_t i = 0; i < count; i++)
            closure->scores[same[i].slot] = 0;
    }
}

void fv_closure_offer(struct fv_closure *closure, const struct fv_map *map,
                      const struct fv_place *place, const struct fv_place_words *words,
                      uint32_t slot)
{
    struct fv_closure_state *s = closure->state;
    if (s->phase != FV_CLOSURE_IDLE) return;
    uint16_t shared[FV_MAP_KEYFRAMES_MAX];
    struct fv_place_set among = {{0}};
    const struct fv_keyframe *keyframe = &map->keyframes[slot];
    uint32_t least = least_score_of(closure, map, place, words, slot);
    fv_map_count_shared(map, slot, shared);
    for (uint32_t k = 0; k < map->limits.keyframes; k++) {
        const struct fv_keyframe *other = &map->keyframes[k];
        bool near = other->number + RECENT_KEYFRAMES > keyframe->number &&
                    keyframe->number + RECENT_KEYFRAMES > other->number;
        if (!other->used || k == slot || shared[k] >= SHARED_KNOWN ||
            (near && other->map_id == keyframe->map_id) ||
            !fv_place_holds(place, k, other->generation))
            continue;
        fv_place_set_add(&among, k);
    }
    fv_place_scores(place, words, &among, closure->scores);
    s->counts.offered++;
    s->keyframe = handle_of(map, slot);
    pick_candidates(closure, map, least);
    s->candidate = s->next = 0;
    if (s->candidate_count > 0) s->phase = FV_CLOSURE_MATCH;
}

/* ---- matches without prediction -------------------------------------------------------------- */

/* Features of a keyframe that have landmarks, with their descriptors. */
static uint32_t gather_features(const struct fv_map *map, uint32_t slot, uint16_t *features,
                                uint8_t *descriptors)
{
    struct fv_map_frame frame = fv_map_frame_at(map, slot);
    uint32_t count = 0;
    for (uint32_t f = 0; f < frame.keyframe->features; f++) {
        if (frame.landmark[f] == FV_MAP_NONE) continue;
        features[count] = (uint16_t)f;
        memcpy(descriptors + (size_t)count++ * FV_MAP_DESCRIPTOR_BYTES,
               frame.descriptors + (size_t)f * FV_MAP_DESCRIPTOR_BYTES, FV_MAP_DESCRIPTOR_BYTES);
    }
    return count;
}

double fv_closure_distance_sigma(const struct fv_landmark *l, const double A[6], double weight)
{
    double pixels2 = 0; /* per rad, squared, twice */
    for (int k = 0; k < 6; k++)
        pixels2 += A[k] * A[k];
    const double parallax =
        (double)l->spread * (double)l->spread * l->observer_count * weight * 0.5 * pixels2;
    const double variance =
        distance_sigma_least * distance_sigma_least + (parallax > 1 ? 1 / parallax : 1);
    return __builtin_sqrt(variance);
}

static void side(const struct fv_map *map, const struct fv_map_frame *frame, uint32_t feature,
                 double point[3], double *sigma, double bearing[3], double A[6], double *weight)
{
    const struct fv_landmark *l = &map->landmarks[frame->landmark[feature]];
    struct fv_keypoint p;
    fv_se3_apply(&frame->keyframe->T_cam_world, l->point, point);
    if (!fv_map_keypoint(map, &frame->points[feature], &p)) memset(&p, 0, sizeof p);
    for (int k = 0; k < 3; k++)
        bearing[k] = (double)p.bearing[k];
    for (int k = 0; k < 6; k++)
        A[k] = (double)p.A[k];
    *weight = (double)p.weight;
    *sigma = fv_closure_distance_sigma(l, A, *weight);
}

void fv_closure_side_a(const struct fv_map *map, const struct fv_map_frame *frame, uint32_t feature,
                       struct fv_correspondence *m)
{
    side(map, frame, feature, m->point_a, &m->sigma_a, m->bearing_a, m->A_a, &m->weight_a);
}

void fv_closure_side_b(const struct fv_map *map, const struct fv_map_frame *frame, uint32_t feature,
                       struct fv_correspondence *m)
{
    side(map, frame, feature, m->point_b, &m->sigma_b, m->bearing_b, m->A_b, &m->weight_b);
}

/* Correspondences of the matches that are near, clearly nearer than the second, and one to one. */
static void make_correspondences(struct fv_closure *closure, const struct fv_map *map)
{
    struct fv_closure_state *s = closure->state;
    struct fv_map_frame a = fv_map_frame_at(map, s->keyframe.slot),
                        b = fv_map_frame_at(map, s->candidates[s->candidate].slot);
    for (uint32_t t = 0; t < s->train_count; t++)
        closure->best_of_train[t] = FV_MATCH_NONE;
    for (uint32_t q = 0; q < s->query_count; q++) {
        if (closure->nearest[q] == FV_MATCH_NONE) continue;
        uint32_t *best = &closure->best_of_train[closure->nearest[q] & 0xffff],
                 distance = closure->nearest[q] >> FV_MATCH_INDEX_BITS;
        if (*best == FV_MATCH_NONE || distance < *best >> FV_MATCH_INDEX_BITS)
            *best = distance << FV_MATCH_INDEX_BITS | q;
    }
    s->correspondence_count = 0;
    for (uint32_t q = 0; q < s->query_count; q++) {
        uint32_t distance = closure->nearest[q] >> FV_MATCH_INDEX_BITS,
                 train = closure->nearest[q] & 0xffff;
        if (closure->nearest[q] == FV_MATCH_NONE || distance > FV_PLACE_DISTANCE_MAX ||
            (closure->best_of_train[train] & 0xffff) != q ||
            distance > FV_PLACE_RATIO_MAX * (closure->second[q] >> FV_MATCH_INDEX_BITS))
            continue;
        uint32_t f = closure->query_feature[q], g = closure->train_feature[train];
        if (a.landmark[f] == FV_MAP_NONE || b.landmark[g] == FV_MAP_NONE) continue; /* gone since */
        struct fv_correspondence *m = &closure->correspondences[s->correspondence_count++];
        memset(m, 0, sizeof *m);
        fv_closure_side_a(map, &a, f, m);
        fv_closure_side_b(map, &b, g, m);
    }
}

static void next_candidate(struct fv_closure_state *s)
{
    s->next = 0;
    s->phase = ++s->candidate < s->candidate_count ? FV_CLOSURE_MATCH : FV_CLOSURE_IDLE;
}

static void match_unit(struct fv_closure *closure, const struct fv_map *map,
                       const struct fv_kernels *kernels)
{
    struct fv_closure_state *s = closure->state;
    if (s->next == 0) {
        s->query_count =
            gather_features(map, s->keyframe.slot, closure->query_feature, closure->queries);
        s->train_count = gather_features(map, s->candidates[s->candidate].slot,
                                         closure->train_feature, closure->trains);
        s->counts.tried++;
    }
    uint32_t left = s->query_count - s->next,
             some = left < QUERIES_PER_UNIT ? left : QUERIES_PER_UNIT;
    kernels->hamming_two_u8(closure->nearest + s->next, closure->second + s->next,
                            closure->queries + (size_t)s->next * FV_MAP_DESCRIPTOR_BYTES,
                            (int32_t)some, closure->trains, (int32_t)s->train_count);
    s->next += some;
    if (s->next < s->query_count) return;
    make_correspondences(closure, map);
    if (s->correspondence_count < FV_PLACE_MATCHES_MIN) {
        next_candidate(s);
        return;
    }
    fv_sim3_search_begin(&s->search, FV_PLACE_SAMPLES_MAX);
    s->phase = FV_CLOSURE_SAMPLE;
}

/* ---- the similarity -------------------------------------------------------------------------- */

/* Landmarks that the candidate and its neighbours see. */
static void gather_group(struct fv_closure *closure, struct fv_map *map)
{
    struct fv_closure_state *s = closure->state;
    struct fv_neighbour near[FV_CLOSURE_NEIGHBOURS + 1];
    uint32_t mark = ++map->state->mark, slot = s->candidates[s->candidate].slot;
    uint32_t count = fv_map_neighbours(map, slot, SHARED_KNOWN, near + 1, FV_CLOSURE_NEIGHBOURS);
    near[0].slot = slot;
    s->group_count = 0;
    for (uint32_t i = 0; i <= count; i++) {
        struct fv_map_frame frame = fv_map_frame_at(map, near[i].slot);
        for (uint32_t f = 0; f < frame.keyframe->features && s->group_count < FV_CLOSURE_GROUP_MAX;
             f++) {
            if (frame.landmark[f] == FV_MAP_NONE || map->landmarks[frame.landmark[f]].mark == mark)
                continue;
            struct fv_landmark *l = &map->landmarks[frame.landmark[f]];
            l->mark = mark;
            closure->group[s->group_count++] =
                (struct fv_map_handle){(uint32_t)frame.landmark[f], l->generation};
        }
    }
}

static void sample_unit(struct fv_closure *closure)
{
    struct fv_closure_state *s = closure->state;
    uint32_t samples = SAMPLE_TESTS_PER_UNIT / (s->correspondence_count + SAMPLE_SOLVED_TESTS) + 1;
    if (fv_sim3_search_more(&s->search, closure->correspondences, s->correspondence_count, samples,
                            FV_CHI_SQUARE_99_2, &s->random))
        return;
    struct fv_sim3 inverse;
    fv_sim3_invert(&s->search.best, &inverse);
    for (uint32_t i = 0; i < s->correspondence_count; i++) {
        double square[2];
        struct fv_correspondence *m = &closure->correspondences[i];
        m->inlier = fv_sim3_errors(m, &s->search.best, &inverse, square) &&
                    square[0] < FV_CHI_SQUARE_99_2 && square[1] < FV_CHI_SQUARE_99_2;
    }
    s->S_keyframe_candidate = s->search.best;
    s->inliers = s->search.best_inliers;
    s->next = 0;
    s->phase = FV_CLOSURE_REFINE;
}

/* Between two keyframes in metres nothing but motion is left open. */
static bool is_rigid(const struct fv_closure_state *s, const struct fv_map *map)
{
    return fv_map_metric_of(map, map->keyframes[s->keyframe.slot].map_id) &&
           fv_map_metric_of(map, map->keyframes[s->candidates[s->candidate].slot].map_id);
}

static uint32_t refine(struct fv_closure *closure, const struct fv_map *map)
{
    struct fv_closure_state *s = closure->state;
    return fv_sim3_refine(closure->correspondences, s->correspondence_count, FV_CHI_SQUARE_99_2, 3,
                          is_rigid(s, map), &s->S_keyframe_candidate);
}

static void refine_unit(struct fv_closure *closure, struct fv_map *map)
{
    struct fv_closure_state *s = closure->state;
    if (s->next < REFINEMENTS && s->inliers >= FV_PLACE_SAMPLED_MIN) {
        s->inliers = refine(closure, map);
        s->next++;
        return;
    }
    if (s->inliers < FV_PLACE_SAMPLED_MIN) {
        next_candidate(s);
        return;
    }
    s->counts.sampled++;
    gather_group(closure, map);
    s->next = 0;
    s->phase = FV_CLOSURE_GUIDED;
}

/* ---- confirmations --------------------------------------------------------------------------- */

static bool enough_found(const struct fv_closure_state *s, uint32_t least)
{
    return s->found >= least && s->found >= found_fraction_min * s->visible;
}

/* The keyframe has been confirmed, and what came before it was asked: believe, or wait for more. */
static void judge_confirmation(struct fv_closure *closure, const struct fv_map *map)
{
    struct fv_closure_state *s = closure->state;
    uint32_t confirmations = 1 + s->seen_before;
    if (fv_closure_same(map, s)) confirmations += s->belief.confirmations;
    s->belief = (struct fv_closure_belief){.candidate = s->candidates[s->candidate],
                                           .correction = s->correction,
                                           .number = map->keyframes[s->keyframe.slot].number,
                                           .confirmations = confirmations};
    if (confirmations < FV_CLOSURE_CONFIRMATIONS) {
        next_candidate(s);
        return;
    }
    s->belief.confirmations = 0;
    s->next = 0;
    if (s->levelled) {
        s->S_keyframe_candidate = s->level;
        fv_closure_correction(map, s);
    }
    if (map->keyframes[s->keyframe.slot].map_id ==
        map->keyframes[s->candidates[s->candidate].slot].map_id) {
        fv_closure_graph_begin(closure, map);
        s->phase = FV_CLOSURE_GRAPH;
    } else {
        s->phase = FV_CLOSURE_COMMIT;
    }
}

/* Whether the relation corrects something, and is what the landmarks say where its scale was held
 * at 1. */
static bool certain(const struct fv_closure *closure, const struct fv_map *map)
{
    const struct fv_closure_state *s = closure->state;
    struct fv_sim3_certainty certainty;
    fv_sim3_judge(closure->correspondences, s->correspondence_count, &s->S_keyframe_candidate,
                  &certainty);
    const double variance =
        certainty.scale_sigma * certainty.scale_sigma + scale_sigma_least * scale_sigma_least;
    return certainty.turn_sigma <= turn_sigma_max_rad &&
           (!is_rigid(s, map) ||
            fv_abs(certainty.log_scale) <= scale_sigmas_max * __builtin_sqrt(variance));
}

static void guided_done(struct fv_closure *closure, const struct fv_map *map)
{
    struct fv_closure_state *s = closure->state;
    uint32_t candidate = s->candidates[s->candidate].slot, inliers = s->correspondence_count;
    for (int round = 0; round < REFINEMENTS && inliers >= CORRESPONDENCES_MIN; round++)
        inliers = refine(closure, map);
    if (inliers < CORRESPONDENCES_MIN || !enough_found(s, FOUND_MIN)) {
        next_candidate(s);
        return;
    }
    s->counts.confirmed++;
    s->levelled = false;
    fv_closure_correction(map, s);
    if (!fv_closure_plausible(map, s->keyframe.slot, candidate, &s->correction) ||
        !certain(closure, map)) {
        s->counts.implausible++;
        next_candidate(s);
        return;
    }
    s->next = s->asked = s->seen_before = 0;
    s->before = s->keyframe;
    s->phase = fv_closure_upright(s, map) ? FV_CLOSURE_LEVEL : FV_CLOSURE_BEFORE;
}

static void level_unit(struct fv_closure *closure, const struct fv_map *map)
{
    struct fv_closure_state *s = closure->state;
    s->phase = FV_CLOSURE_BEFORE;
    if (fv_closure_level(closure, map, is_rigid(s, map))) return;
    s->counts.implausible++;
    next_candidate(s);
}

/* Ask the next keyframe before the offered one; when there is none, or enough have been asked,
 * judge. */
static void before_unit(struct fv_closure *closure, const struct fv_map *map,
                        const struct fv_kernels *kernels)
{
    struct fv_closure_state *s = closure->state;
    if (s->next == 0) {
        int32_t parent =
            fv_closure_holds(map, s->before) ? map->keyframes[s->before.slot].parent : FV_MAP_NONE;
        bool enough =
            s->asked == ASKED_BEFORE_MAX || 1 + s->seen_before >= FV_CLOSURE_CONFIRMATIONS;
        if (enough || parent == FV_MAP_NONE || !map->keyframes[parent].used ||
            map->keyframes[parent].map_id != map->keyframes[s->keyframe.slot].map_id) {
            judge_confirmation(closure, map);
            return;
        }
        s->before = handle_of(map, (uint32_t)parent);
        s->asked++;
    } else if (!fv_closure_holds(map, s->before)) {
        s->next = 0;
        return;
    }
    struct fv_sim3 of_keyframe, of_before, between;
    fv_sim3_from_se3(&map->keyframes[s->keyframe.slot].T_cam_world, 1, &of_keyframe);
    fv_sim3_from_se3(&map->keyframes[s->before.slot].T_cam_world, 1, &of_before);
    fv_sim3_invert(&of_keyframe, &of_keyframe);
    fv_sim3_compose(&of_before, &of_keyframe, &between);
    fv_sim3_compose(&between, &s->S_keyframe_candidate, &between);
    if (!fv_closure_search_group(closure, map, kernels, s->before.slot, &between)) return;
    s->seen_before += enough_found(s, FOUND_BEFORE_MIN);
    s->next = 0;
}

/* ---- the job --------------------------------------------------------------------------------- */

/* While a confirmation is made, the two keyframes must stay what they were. */
static bool still_there(const struct fv_closure_state *s, const struct fv_map *map)
{
    return fv_closure_holds(map, s->keyframe) && fv_closure_holds(map, s->candidates[s->candidate]);
}

bool fv_closure_unit(struct fv_closure *closure, struct fv_map *map,
                     const struct fv_kernels *kernels, struct fv_closure_outcome *outcome)
{
    struct fv_closure_state *s = closure->state;
    memset(outcome, 0, sizeof *outcome);
    if (s->phase != FV_CLOSURE_IDLE && s->phase != FV_CLOSURE_FUSE && !still_there(s, map)) {
        if (s->phase <= FV_CLOSURE_BEFORE)
            next_candidate(s);
        else
            s->phase = FV_CLOSURE_IDLE;
        return fv_closure_waiting(closure);
    }
    switch (s->phase) {
    case FV_CLOSURE_MATCH:
        match_unit(closure, map, kernels);
        break;
    case FV_CLOSURE_SAMPLE:
        sample_unit(closure);
        break;
    case FV_CLOSURE_REFINE:
        refine_unit(closure, map);
        break;
    case FV_CLOSURE_GUIDED:
        if (fv_closure_search_group(closure, map, kernels, s->keyframe.slot,
                                    &s->S_keyframe_candidate))
            guided_done(closure, map);
        break;
    case FV_CLOSURE_LEVEL:
        level_unit(closure, map);
        break;
    case FV_CLOSURE_BEFORE:
        before_unit(closure, map, kernels);
        break;
    case FV_CLOSURE_GRAPH:
        if (!fv_closure_graph_unit(closure, map)) break;
        s->phase = fv_pose_graph_start(&closure->graph) ? FV_CLOSURE_SOLVE : FV_CLOSURE_IDLE;
        break;
    case FV_CLOSURE_SOLVE:
        if (!fv_pose_graph_unit(&closure->graph)) s->phase = FV_CLOSURE_COMMIT;
        break;
    case FV_CLOSURE_COMMIT:
        fv_closure_commit(closure, map, outcome);
        s->next = 0;
        s->phase = FV_CLOSURE_FUSE;
        break;
    case FV_CLOSURE_FUSE:
        if (!fv_closure_fuse_unit(closure, map, kernels)) break;
        outcome->fused = true;
        s->phase = FV_CLOSURE_IDLE;
        break;
    case FV_CLOSURE_IDLE:
        break;
    }
    return fv_closure_waiting(closure);
}

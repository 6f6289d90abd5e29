/* Of finding the camera again. */
#include "odometry/relocalise.c"

#include "bounds/counter.h"
#include "bounds/full_map.h"
#include "bounds/pieces.h"

static void to_words(void *context)
{
    struct fovea *rt = context;
    struct fv_relocaliser *r = &rt->odometry.relocaliser;
    const struct fv_map_frame frame =
        fv_map_frame_at(&rt->odometry.map, fv_map_current(&rt->odometry.map));
    fv_place_words_begin(r->words);
    fv_place_words_add(r->words, &rt->kernels, frame.descriptors, frame.keyframe->features);
}

static void to_some_words(void *context)
{
    struct fovea *rt = context;
    struct fv_relocaliser *r = &rt->odometry.relocaliser;
    const struct fv_map_frame frame =
        fv_map_frame_at(&rt->odometry.map, fv_map_current(&rt->odometry.map));
    const uint32_t features = frame.keyframe->features;
    fv_place_words_begin(&r->index->words);
    fv_place_words_add(&r->index->words, &rt->kernels, frame.descriptors,
                       features < FV_PLACE_UNIT ? features : FV_PLACE_UNIT);
}

static void insert(void *context)
{
    struct fovea *rt = context;
    struct fv_relocaliser *r = &rt->odometry.relocaliser;
    (void)unindexed(&rt->odometry.map, &r->place);
    fv_place_insert(&r->place, 1, rt->odometry.map.keyframes[1].generation, r->words);
}

static void score(void *context)
{
    struct fovea *rt = context;
    struct fv_relocaliser *r = &rt->odometry.relocaliser;
    struct fv_place_set among = {{0}};
    struct fv_place_candidate best;
    for (uint32_t k = 0; k < rt->odometry.map.limits.keyframes; k++)
        if (!fv_odometry_given_up(&rt->odometry, k)) fv_place_set_add(&among, k);
    fv_place_scores(&r->place, r->words, &among, r->scores);
    (void)fv_place_best(r->scores, rt->odometry.map.limits.keyframes, 0, &best, 1);
}

static void match(void *context)
{
    struct fovea *rt = context;
    const struct fv_map_frame frame =
        fv_map_frame_at(&rt->odometry.map, fv_map_current(&rt->odometry.map));
    (void)match_keyframe(&rt->odometry, &rt->kernels, &frame, rt->odometry.state->newest);
}

static void find_neighbours(void *context)
{
    struct fovea *rt = context;
    struct fv_neighbour same[FV_PLACE_NEIGHBOURS_MAX];
    (void)fv_map_neighbours(&rt->odometry.map, rt->odometry.state->newest, 1, same,
                            FV_PLACE_NEIGHBOURS_MAX);
}

/* Every keyframe has every word of the frame, and these are as many as it has features. */
static void share_words(struct fovea *rt)
{
    struct fv_relocaliser *r = &rt->odometry.relocaliser;
    const uint32_t features = rt->odometry.map.limits.features;
    fv_place_words_begin(r->words);
    for (uint32_t f = 0; f < features; f++) {
        const uint32_t word = f * (FV_VOCABULARY_WORDS / features);
        r->words->present[word >> 6] |= UINT64_C(1) << (word & 63);
    }
    r->words->count = features;
    r->words->weight = 1000;
    for (uint32_t k = 0; k < rt->odometry.map.limits.keyframes; k++)
        fv_place_insert(&r->place, k, rt->odometry.map.keyframes[k].generation, r->words);
}

void pieces_of_relocalise(struct fovea *rt)
{
    struct fv_odometry *o = &rt->odometry;
    const struct crowd crowd = full_map_crowd(o);
    full_map_fill(o, FV_MAP_OBSERVERS_MAX);
    full_map_view(o, &crowd, FULL_MAP_PLACES / 2);
    const struct fv_map_frame frame = fv_map_frame_at(&o->map, fv_map_current(&o->map));
    for (uint32_t i = 0; i < frame.keyframe->features * FV_MAP_DESCRIPTOR_BYTES; i++)
        frame.descriptors[i] = (uint8_t)(i * 2654435761u >> 13); /* many words */
    NOTE(words, to_words, rt, 1);
    NOTE(words_256, to_some_words, rt, 1);
    share_words(rt);
    NOTE(words_inserted, insert, rt, 1);
    NOTE(scores, score, rt, 1);
    NOTE(neighbours, find_neighbours, rt, 1);
    full_map_view(o, &crowd, FULL_MAP_PLACES / 2);
    NOTE(keyframe_matched, match, rt, 1);
}

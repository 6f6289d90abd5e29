/* Of the first map: views, their matches and tracks. */
#include "odometry/initialise.c"

#include "bounds/counter.h"
#include "bounds/full_map.h"
#include "bounds/limits.h"
#include "bounds/pieces.h"

LIMIT(TRACKS_MAX, FIRST_TRACKS);
LIMIT(TRACKS_TRIED, FIRST_TRACKS_TRIED);

struct beginning {
    struct fovea *rt;
    struct fv_odometry *o;
    struct fv_initialise_bundle bundle;
    uint32_t matches, tracks, keyframes[FV_INITIALISE_VIEWS_MAX], track;
};

static void match(void *context)
{
    struct beginning *b = context;
    b->matches = match_views(&b->o->map, &b->o->matches, &b->rt->kernels,
                             fv_map_waiting(&b->o->map, 0), fv_map_current(&b->o->map));
}

static void note(void *context)
{
    struct beginning *b = context;
    note_matches(&b->o->map, &b->o->matches, &b->o->initialiser, 1, b->matches);
}

static void pair(void *context)
{
    struct beginning *b = context;
    b->tracks = take_pairs(b->o, b->matches, &b->bundle);
}

static void extend(void *context)
{
    struct beginning *b = context;
    extend_tracks(&b->o->map, &b->o->initialiser, b->tracks, &b->bundle);
}

static void hold_view(void *context)
{
    struct beginning *b = context;
    hold(b->o, b->matches, 0);
}

static void note_guess(void *context)
{
    struct beginning *b = context;
    fv_initialise_note_guess(&b->o->initialiser, b->o->state->frame_number, 0, b->tracks,
                             &b->bundle);
}

static void find_scale(void *context)
{
    struct beginning *b = context;
    memset(b->o->initialiser.inlier, 1, b->tracks);
    b->bundle.cost = unit_scale(&b->o->initialiser, b->tracks);
}

static void add(void *context)
{
    struct beginning *b = context;
    add_track(b->o, &b->bundle, b->keyframes, b->track, 1);
}

/* Eight views of the scene, whose features all match: one descriptor each. */
static void see_views(struct beginning *b)
{
    const struct crowd crowd = {.levels_high = 0};
    struct fv_initialise_state *s = b->o->initialiser.state;
    s->count = 0;
    for (uint32_t i = 0; i <= FV_MAP_WAITING_MAX; i++) {
        full_map_view(b->o, &crowd, i);
        const struct fv_map_frame frame = fv_map_frame_at(&b->o->map, fv_map_current(&b->o->map));
        for (uint32_t f = 0; f < frame.keyframe->features * FV_MAP_DESCRIPTOR_BYTES; f++)
            frame.descriptors[f] = (uint8_t)(f * 2654435761u >> 13);
        if (i == FV_MAP_WAITING_MAX) break;
        b->o->state->frame_number = 100 + i;
        if (s->count > 0) s->stride = 1;
        hold(b->o, 0, UINT64_MAX);
    }
    b->o->state->frame_number = 100 + FV_MAP_WAITING_MAX;
}

/* Bundles of pieces_of_bundle are made on what this leaves behind. */
void pieces_of_initialise(struct fovea *rt)
{
    static struct beginning b;
    b.rt = rt;
    b.o = &rt->odometry;
    fv_odometry_reset(b.o);
    see_views(&b);
    for (uint32_t i = 1; i < FV_MAP_WAITING_MAX; i++) {
        b.o->initialiser.state->matched[i] = 0;
        match_stale(b.o, &rt->kernels);
    }
    NOTE(views_matched, match, &b, 1);
    match_stale(b.o, &rt->kernels);
    match(&b);
    choose_views(b.o, &b.bundle);
    NOTE(pairs_taken, pair, &b, 1);
    NOTE(tracks_extended, extend, &b, 1);
    for (uint32_t i = 0; i < b.tracks; i++)
        b.o->initialiser.depths[i].value = 0.2;
    NOTE(guess_noted, note_guess, &b, 1);
    NOTE(scale_found, find_scale, &b, 1);
    for (uint32_t v = 0; v < b.bundle.view_count; v++)
        b.keyframes[v] = fv_map_add_keyframe(&b.o->map, b.bundle.slots[v]);
    b.o->state->localise.recent_count = 0;
    for (b.track = 0; b.track < b.tracks; b.track++)
        NOTE(track_added, add, &b, 1);
    match(&b);
    NOTE(matches_noted, note, &b, 1);
    NOTE(view_held, hold_view, &b, 1);
}

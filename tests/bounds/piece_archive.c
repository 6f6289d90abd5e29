/* Of saving the map. */
#include "map/archive_write.c"

#include <stdlib.h>

#include "bounds/counter.h"
#include "bounds/full_map.h"
#include "bounds/pieces.h"

struct archiving {
    struct fv_odometry *o;
    struct fv_archive_state archive;
    uint8_t *out;
    size_t capacity;
};

static void unit(void *context)
{
    struct archiving *a = context;
    fv_archive_unit(&a->archive, &a->o->map, &a->o->camera, a->out, a->capacity);
}

void pieces_of_archive(struct fovea *rt)
{
    struct archiving a = {.o = &rt->odometry,
                          .capacity = fv_archive_bytes_max(&rt->odometry.map.limits)};
    const uint32_t keyframes = a.o->map.limits.keyframes;
    const uint32_t features = a.o->map.limits.features,
                   some = features < FV_ARCHIVE_UNIT_FEATURES ? features : FV_ARCHIVE_UNIT_FEATURES;
    a.out = malloc(a.capacity);
    full_map_fill(a.o, FV_MAP_OBSERVERS_MAX);
    for (uint32_t i = 0; i < FV_MAP_EDGES_MAX; i++)
        fv_map_add_edge(&a.o->map, i % keyframes, (i + 1) % keyframes);
    fv_archive_begin(&a.archive, 1);
    while (fv_archive_busy(&a.archive)) {
        const enum fv_archive_phase phase = a.archive.phase;
        const double took = (double)counter_of(unit, &a);
        if (phase == FV_ARCHIVE_LANDMARKS)
            piece_note(PIECE_saved_landmark, took / FV_ARCHIVE_UNIT_LANDMARKS);
        else if (phase == FV_ARCHIVE_KEYFRAMES)
            piece_note(PIECE_saved_feature, took / some);
        else
            piece_note(PIECE_saved_edges, took);
    }
    free(a.out);
}

/* A source played to its end, and what came of it. */
#ifndef FOVEA_TESTS_PLAYED_H
#define FOVEA_TESTS_PLAYED_H

#include "fovea/source.h"

enum { PLAYED_MAX = 256 };

/* What came of a recording: sequences of the frames, and its counts; the first complaint. */
struct played {
    uint64_t sequence[PLAYED_MAX];
    int64_t stamp_ns[PLAYED_MAX];
    uint32_t picture[PLAYED_MAX]; /* a sum over it */
    size_t count;
    struct fovea_source_counts counts;
    double rate_hz;
    bool has_camera;
    struct fovea_camera camera;
    struct fovea_error complaint;
};

/* Play an open source, and close it. Fails the test where it does not end in order. */
void played_source(const struct fovea_source_ops *ops, struct fovea_source *source,
                   struct played *played);
/* The same of an address; the status of its opening. */
enum fovea_status played_uri(const char *scheme, const char *address,
                             const struct fovea_source_selection *selection, struct played *played,
                             struct fovea_error *error);
/* All of it; fails the test where it does not open. */
void played_fine(const char *scheme, const char *address, struct played *played);

#endif

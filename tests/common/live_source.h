/* Handling of a live source in tests. Whatever fails here fails the test with a message. */
#ifndef FOVEA_TESTS_LIVE_SOURCE_H
#define FOVEA_TESTS_LIVE_SOURCE_H

#include <stdbool.h>
#include <stdint.h>

#include "fovea/source.h"

extern const struct fovea_source_ops fv_source_v4l2; /* drivers/live/live.h */

int64_t fv_test_now_ns(void);

/* A `v4l2:` source on the fake device. */
struct fovea_source *fv_test_open(const char *address);
struct fovea_source *fv_test_start(const char *address);
void fv_test_finish(struct fovea_source *source); /* stop and close */

/* The next frame within ten seconds, to be given back. */
struct fovea_frame fv_test_hold_frame(struct fovea_source *source);
/* The same, given back at once: who looks at all its pixels holds it. */
struct fovea_frame fv_test_next_frame(struct fovea_source *source);
/* Frames go by until then, for at most ten seconds. */
void fv_test_wait_for_state(struct fovea_source *source, enum fovea_source_state wanted);
struct fovea_source_counts fv_test_counts(struct fovea_source *source);
/* Whether a line with these words comes within three seconds; other lines are lost. */
bool fv_test_complains_of(struct fovea_source *source, const char *words);

#endif

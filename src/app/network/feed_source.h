/* The pictures of a run on this host as a source of frames, "feed:SOCKET" (the key web.socket of
 * the run), for programs that look beside it: the run keeps its camera. At most
 * FV_FEED_SOURCE_RATE_HZ frames in a second come, and web.picture_rate of the run; the newest each
 * time. It ends with the run. Its calibration is not in the feed. */
#ifndef FOVEA_APP_NETWORK_FEED_SOURCE_H
#define FOVEA_APP_NETWORK_FEED_SOURCE_H

#include "fovea/source.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { FV_FEED_SOURCE_RATE_HZ = 10 };

/* `open` waits for the first frame, at most 10 seconds. */
extern const struct fovea_source_ops fv_source_feed;

#ifdef __cplusplus
}
#endif
#endif

/* The map in pieces, for a live viewer. */
#ifndef FOVEA_RUNTIME_ENCODE_MAP_H
#define FOVEA_RUNTIME_ENCODE_MAP_H

#include "runtime/state.h"

/* The next piece: FV_MESSAGE_MAP_LANDMARKS slots of landmarks and FV_MESSAGE_MAP_KEYFRAMES of
 * keyframes. Real-time safe. */
void fv_encode_map(struct fovea *rt, struct fovea_outputs *outputs);

#endif

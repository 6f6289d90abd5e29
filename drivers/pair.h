/* Two sources as one rig: the source `pair:` (drivers/pair.c). */
#ifndef FOVEA_DRIVERS_PAIR_H
#define FOVEA_DRIVERS_PAIR_H

#include "fovea/source.h"

extern const struct fovea_source_ops fv_source_pair;

#endif

/* Recordings one after the other: the source `sequence:` (drivers/sequence.c). */
#ifndef FOVEA_DRIVERS_SEQUENCE_H
#define FOVEA_DRIVERS_SEQUENCE_H

#include "fovea/source.h"

extern const struct fovea_source_ops fv_source_sequence;

#endif

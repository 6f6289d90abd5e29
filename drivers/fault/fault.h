/* Faults of cameras and of the inertial sensor, applied to the frames and samples of any other
 * source by a seeded schedule: the source `fault:`.
 *
 * A fault of pictures is a function that changes one picture in place; those of whole frames are in
 * source.c, those of samples in samples.h. faults.def lists them all. All give the same bits on
 * every machine, compiler and instruction set: integers, and doubles without libm. */
#ifndef FOVEA_DRIVERS_FAULT_FAULT_H
#define FOVEA_DRIVERS_FAULT_FAULT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "fovea/source.h"

extern const struct fovea_source_ops fv_source_fault;

/* Index of each fault; bit 1 << index stands for it in `kinds`. */
enum fv_fault_kind {
#define FV_FAULT(name, needs_last) FV_FAULT_##name,
#define FV_FAULT_OTHER(name) FV_FAULT_##name,
#include "faults.def"
    FV_FAULT_COUNT,
    /* where those of other things begin */
    FV_FAULT_OF_FRAMES = FV_FAULT_drop,
    FV_FAULT_OF_SAMPLES = FV_FAULT_imu_drop,
    FV_FAULT_OF_CALLS = FV_FAULT_stall
};

static inline uint32_t fv_fault_bit(enum fv_fault_kind kind)
{
    return 1u << (uint32_t)kind;
}

struct fv_fault_options {
    uint32_t kinds; /* bits 1 << enum fv_fault_kind */
#define FV_FAULT_OPTION(name, kind, type, member, value, low, high, unit) type member;
#include "options.def"
#undef FV_FAULT_OPTION
};

static inline bool fv_fault_has(const struct fv_fault_options *options, enum fv_fault_kind kind)
{
    return (options->kinds & fv_fault_bit(kind)) != 0;
}

/* Read what follows the last '?' of an address. FOVEA_ERROR_INPUT: `error` is the line to print. */
enum fovea_status fv_fault_options_parse(const char *text, struct fv_fault_options *options,
                                         struct fovea_error *error);

/* ---- schedule: which frames are faulty, by their index in the source alone ---------------------
 */

struct fv_fault_window {
    uint64_t begin, end; /* frames [begin, end) are faulty */
    uint64_t seed;       /* of what is the same throughout this fault */
};

struct fv_fault_schedule {
    const struct fv_fault_options *options;
    struct fv_fault_window window; /* the last one looked at */
    uint64_t number;               /* of it, from 0; the first is made by fv_fault_schedule_open */
    uint64_t since;                /* end of the one before it, whose gap the next frames are in */
    uint64_t state;                /* of the draws behind it */
};

void fv_fault_schedule_open(struct fv_fault_schedule *schedule,
                            const struct fv_fault_options *options);
/* Whether frame `index` is faulty; then `window` is the fault that it is in. Quick for indices that
 * rise; any order gives the same. */
bool fv_fault_schedule_at(struct fv_fault_schedule *schedule, uint64_t index,
                          struct fv_fault_window *window);

/* ---- stamps ---------------------------------------------------------------------------------- */

struct fv_fault_stamp {
    bool any;
    int64_t last_ns; /* of the last frame before the fault, else of its first */
};

/* Remember the stamp of a frame without a fault. */
void fv_fault_stamp_pass(struct fv_fault_stamp *stamp, int64_t stamp_ns);
/* The stamp of a faulty frame; `seed`: of this frame alone. */
int64_t fv_fault_stamp(const struct fv_fault_options *options, uint64_t seed,
                       struct fv_fault_stamp *stamp, int64_t stamp_ns);

/* ---- faults ---------------------------------------------------------------------------------- */

struct fv_fault_picture {
    const struct fv_fault_options *options;
    uint8_t *pixels; /* height rows of width * channels bytes without gaps; changed in place */
    int32_t width, height, channels;
    uint64_t seed, window_seed; /* of this picture alone; of all pictures of this fault */
    const uint8_t *last;        /* the last picture before the fault, likewise; else its first */
    uint8_t *scratch;           /* as many bytes as `pixels` */
};

/* No heap, no system call. */
#define FV_FAULT(name, needs_last) void fv_fault_##name(struct fv_fault_picture *picture);
#include "faults.def"

#endif

/* What a run was like: a short summary and JSON. Off the loop thread. */
#ifndef FOVEA_APP_RUN_REPORT_H
#define FOVEA_APP_RUN_REPORT_H

#include <stdio.h>

#include "app/network/transport.h"
#include "app/run/loop.h"

struct fv_report {
    const char *source; /* URI */
    const char *kernel_set;
    int32_t width, height;
    const struct fv_loop *loop; /* after it has ended */
    size_t part_bytes[FOVEA_MEMORY_PART_COUNT];
    size_t block_bytes;
    uint64_t resident_bytes, resident_max_bytes, anonymous_bytes;
    struct fovea_imu_status imu;          /* at the end */
    const char *imu_calibration;          /* the file or source that states its place */
    const struct fv_transport_sent *sent; /* after fv_transport_finish */
};

/* Bytes per part of the block. */
void fv_report_parts(const struct fovea_memory_table *table,
                     size_t part_bytes[FOVEA_MEMORY_PART_COUNT]);
const char *fv_report_part_name(enum fovea_memory_part part);

void fv_report_summary(FILE *file, const struct fv_report *report);

/* JSON: frames {in processed dropped posed lost ...}; stages by name, step, work, frame, each
 * with mean_ns p50_ns p99_ns max_ns of the loop thread's CPU time and the same of wall time as
 * wall_*; memory; lcm: per channel the messages offered, sent and dropped by reason;
 * imu, where the rig has an inertial sensor: its state, what became of its samples, and how far
 * its clock and its mount are off, as in struct fovea_imu_status;
 * heap_calls_after_init (null where this build cannot count). Frames that were
 * dropped came too late or were lost by the source; posed and lost count frames with and without
 * a pose, of those for which one was sought. */
void fv_report_json(FILE *file, const struct fv_report *report);

#endif

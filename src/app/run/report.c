#include "app/run/report.h"

#include <inttypes.h>
#include <math.h>
#include <string.h>

#include "app/run/heap.h"
#include "base/elementary.h"
#include "support/json.h"

void fv_report_parts(const struct fovea_memory_table *table,
                     size_t part_bytes[FOVEA_MEMORY_PART_COUNT])
{
    for (int part = 0; part < FOVEA_MEMORY_PART_COUNT; part++)
        part_bytes[part] = 0;
    for (uint32_t i = 0; i < table->count; i++)
        part_bytes[table->rows[i].part] += table->rows[i].bytes;
}

const char *fv_report_part_name(enum fovea_memory_part part)
{
    static const char *const names[FOVEA_MEMORY_PART_COUNT] = {"persistent", "job", "frame"};
    return part >= 0 && part < FOVEA_MEMORY_PART_COUNT ? names[part] : "unknown";
}

/* ---- JSON ------------------------------------------------------------------------------------ */

static void histogram_json(FILE *file, const char *prefix, const struct fv_histogram *histogram)
{
    fprintf(file,
            "\"%smean_ns\": %" PRId64 ", \"%sp50_ns\": %" PRId64 ", \"%sp99_ns\": %" PRId64
            ", \"%smax_ns\": %" PRId64,
            prefix, fv_histogram_mean(histogram), prefix, fv_histogram_percentile(histogram, 0.5),
            prefix, fv_histogram_percentile(histogram, 0.99), prefix, histogram->max_ns);
}

static void pair_json(FILE *file, int indent, const char *name, const struct fv_times_pair *pair,
                      const char *after)
{
    fprintf(file, "%*s\"%s\": {", indent, "", name);
    histogram_json(file, "", &pair->cpu);
    fprintf(file, ", ");
    histogram_json(file, "wall_", &pair->wall);
    fprintf(file, "}%s\n", after);
}

static void frames_json(FILE *file, const struct fv_loop *loop)
{
    const struct fv_loop_counts *counts = &loop->counts;
    const struct fovea_source_counts *source = &loop->source_counts;
    fprintf(file,
            "  \"frames\": {\"in\": %" PRIu64 ", \"processed\": %" PRIu64 ", \"dropped\": %" PRIu64
            ", \"posed\": %" PRIu64 ", \"lost\": %" PRIu64 ",\n",
            counts->in, counts->processed, counts->late + source->dropped, counts->posed,
            counts->lost);
    fprintf(file,
            "             \"refused\": %" PRIu64 ", \"late\": %" PRIu64
            ", \"late_without_cpu\": %" PRIu64 ", \"steps_without_frame\": %" PRIu64 ",\n",
            counts->refused, counts->late, counts->starved, counts->without_frame);
    fprintf(file,
            "             \"source_missing\": %" PRIu64 ", \"source_damaged\": %" PRIu64
            ", \"source_dropped\": %" PRIu64 ", \"source_recovered\": %" PRIu64 "},\n",
            source->missing, source->damaged, source->dropped, source->recovered);
}

/* The counts of struct fovea_imu_counts, by name. */
struct imu_row {
    const char *name;
    uint64_t count;
    const char *said; /* in the summary, where there are any; NULL: not */
};
enum { IMU_ROWS = 10 };

static void imu_rows(const struct fovea_imu_counts *c, struct imu_row rows[IMU_ROWS])
{
    const struct imu_row all[IMU_ROWS] = {
        {"taken", c->taken, NULL},
        {"repeated", c->repeated, "repeated"},
        {"late", c->late, "late"},
        {"not_finite", c->not_finite, "not finite"},
        {"saturated", c->saturated, "saturated"},
        {"frozen", c->frozen, "frozen"},
        {"off_clock", c->off_clock, "off the clock"},
        {"missing", c->missing, "missing"},
        {"gaps", c->gaps, NULL},
        {"jumps", c->jumps, NULL},
    };
    memcpy(rows, all, sizeof all);
}

static void imu_json(FILE *file, const struct fovea_imu_status *imu)
{
    struct imu_row rows[IMU_ROWS];
    if (imu->state == FOVEA_IMU_NONE) return;
    imu_rows(&imu->counts, rows);
    fprintf(file, "  \"imu\": {\"state\": \"%s\", \"rate_hz\": %.3f",
            fovea_imu_state_name(imu->state), imu->rate_hz);
    for (int i = 0; i < IMU_ROWS; i++)
        fprintf(file, ", \"%s\": %" PRIu64, rows[i].name, rows[i].count);
    if (imu->time_offset_sigma_s > 0)
        fprintf(file,
                ", \"time_offset_s\": %.6f, \"time_offset_sigma_s\": %.6f, "
                "\"time_offset_used_s\": %.6f",
                imu->time_offset_s, imu->time_offset_sigma_s, imu->time_offset_used_s);
    if (imu->mount_angle_sigma > 0)
        fprintf(file,
                ", \"mount_error\": [%.6f, %.6f, %.6f], \"mount_sigma\": [%.6f, %.6f, %.6f], "
                "\"mount_wrong\": %s",
                imu->mount_error[0], imu->mount_error[1], imu->mount_error[2], imu->mount_sigma[0],
                imu->mount_sigma[1], imu->mount_sigma[2], imu->mount_wrong ? "true" : "false");
    fprintf(file, "},\n");
}

static void sent_json(FILE *file, const struct fv_transport_sent *sent)
{
    fprintf(file, "  \"lcm\": {");
    for (uint32_t i = 0; i < sent->count; i++) {
        const struct fv_transport_channel *channel = &sent->channels[i];
        fprintf(file, "%s\n    ", i > 0 ? "," : "");
        fv_json_text(file, channel->name);
        fprintf(file, ": {\"offered\": %" PRIu64 ", \"sent\": %" PRIu64 ", \"dropped\": {",
                channel->offered, channel->sent);
        for (int reason = 0; reason < FV_TRANSPORT_DROPS; reason++)
            fprintf(file, "%s\"%s\": %" PRIu64, reason > 0 ? ", " : "",
                    fv_transport_drop_name((enum fv_transport_drop)reason),
                    channel->dropped[reason]);
        fprintf(file, "}}");
    }
    fprintf(file, "},\n");
}

void fv_report_json(FILE *file, const struct fv_report *report)
{
    const struct fv_loop *loop = report->loop;
    const struct fv_timings *timings = loop->timings;
    fprintf(file, "{\n  \"version\": \"%s\",\n  \"source\": ", FOVEA_VERSION);
    fv_json_text(file, report->source);
    fprintf(file,
            ",\n  \"width\": %d, \"height\": %d,\n  \"kernel_set\": \"%s\",\n  \"rate\": \"%s\",\n",
            report->width, report->height, report->kernel_set, loop->real_time ? "real" : "max");
    frames_json(file, loop);
    imu_json(file, &report->imu);
    fprintf(file, "  \"stages\": {\n");
    for (int i = 0; i < FOVEA_STAGE_COUNT; i++)
        pair_json(file, 4, fovea_stage_name((enum fovea_stage)i), &timings->stages[i],
                  i + 1 < FOVEA_STAGE_COUNT ? "," : "");
    fprintf(file, "  },\n");
    pair_json(file, 2, "step", &timings->step, ",");
    pair_json(file, 2, "work", &timings->work, ",");
    pair_json(file, 2, "frame", &timings->frame, ",");
    fprintf(file, "  \"latency\": {");
    histogram_json(file, "", &timings->latency);
    fprintf(file, "},\n  \"run\": {\"wall_ns\": %" PRId64 ", \"loop_cpu_ns\": %" PRId64 "},\n",
            loop->wall_ns, loop->cpu_ns);
    fprintf(file, "  \"memory\": {");
    for (int part = 0; part < FOVEA_MEMORY_PART_COUNT; part++)
        fprintf(file, "\"%s\": %zu, ", fv_report_part_name((enum fovea_memory_part)part),
                report->part_bytes[part]);
    fprintf(file,
            "\"block\": %zu, \"resident_bytes\": %" PRIu64 ", \"resident_max_bytes\": %" PRIu64
            ", \"anonymous_bytes\": %" PRIu64 "},\n",
            report->block_bytes, report->resident_bytes, report->resident_max_bytes,
            report->anonymous_bytes);
    if (report->sent != NULL) sent_json(file, report->sent);
    fprintf(file, "  \"resident_bytes\": %" PRIu64 ",\n", report->resident_bytes);
    if (fv_heap_counted())
        fprintf(file, "  \"heap_calls_after_init\": %" PRIu64 "\n}\n", loop->heap_calls);
    else
        fprintf(file, "  \"heap_calls_after_init\": null\n}\n");
}

/* ---- summary --------------------------------------------------------------------------------- */

static void row(FILE *file, const char *name, const struct fv_histogram *histogram)
{
    fprintf(file, "  %-10s %8.3f %8.3f %8.3f %8.3f\n", name,
            (double)fv_histogram_mean(histogram) * 1e-6,
            (double)fv_histogram_percentile(histogram, 0.5) * 1e-6,
            (double)fv_histogram_percentile(histogram, 0.99) * 1e-6,
            (double)histogram->max_ns * 1e-6);
}

static void troubles(FILE *file, const struct fv_loop *loop)
{
    const struct fv_loop_counts *counts = &loop->counts;
    const struct fovea_source_counts *source = &loop->source_counts;
    if (counts->late > 0)
        fprintf(file,
                "  %" PRIu64 " frames dropped as too late, %" PRIu64
                " of them while the loop had no processor\n",
                counts->late, counts->starved);
    if (counts->refused > 0)
        fprintf(file,
                "  %" PRIu64
                " frames refused (stamp not after the last, other size or format, or paused)\n",
                counts->refused);
    if (source->missing + source->damaged > 0)
        fprintf(file, "  %" PRIu64 " frames missing, %" PRIu64 " damaged: skipped\n",
                source->missing, source->damaged);
    if (source->dropped > 0)
        fprintf(file, "  %" PRIu64 " frames lost by the source\n", source->dropped);
    if (source->recovered > 0)
        fprintf(file, "  the camera came back %" PRIu64 " times\n", source->recovered);
}

/* Where the offset that the rig states is not the one that is seen. */
static void imu_clock(FILE *file, const struct fovea_imu_status *imu)
{
    const double off_ms = fabs(imu->time_offset_s) * 1e3, sigma_ms = imu->time_offset_sigma_s * 1e3;
    if (imu->time_offset_used_s == 0 && (off_ms < 1 || off_ms < 4 * sigma_ms)) return;
    fprintf(file,
            "  the camera's stamps are %.1f ms %s against the inertial sensor's (sigma %.1f)%s: "
            "add %.0f to time_offset_ns of its calibration\n",
            off_ms, imu->time_offset_s < 0 ? "early" : "late", sigma_ms,
            imu->time_offset_used_s == 0 ? "" : ", samples were moved", imu->time_offset_s * 1e9);
}

static void imu_mount(FILE *file, const struct fovea_imu_status *imu, const char *calibration)
{
    const double degrees = 180 / FV_PI;
    if (!imu->mount_wrong) return;
    fprintf(
        file,
        "  the inertial sensor is turned by %.1f degrees (sigma %.1f) against T_body_imu of %s: "
        "calibrate again\n",
        imu->mount_angle * degrees, imu->mount_angle_sigma * degrees, calibration);
}

static void imu_troubles(FILE *file, const struct fovea_imu_status *imu, const char *calibration)
{
    struct imu_row rows[IMU_ROWS];
    if (imu->state == FOVEA_IMU_NONE) return;
    imu_rows(&imu->counts, rows);
    fprintf(file, "  inertial sensor %s: %" PRIu64 " samples taken",
            fovea_imu_state_name(imu->state), imu->counts.taken);
    for (int i = 0; i < IMU_ROWS; i++)
        if (rows[i].said != NULL && rows[i].count > 0)
            fprintf(file, ", %" PRIu64 " %s", rows[i].count, rows[i].said);
    if (imu->counts.gaps > 0) fprintf(file, "; %" PRIu64 " gaps", imu->counts.gaps);
    if (imu->counts.jumps > 0)
        fprintf(file, "; its clock leapt %" PRIu64 " times", imu->counts.jumps);
    fprintf(file, "\n");
    imu_clock(file, imu);
    imu_mount(file, imu, calibration);
}

void fv_report_summary(FILE *file, const struct fv_report *report)
{
    const struct fv_loop *loop = report->loop;
    const struct fv_timings *timings = loop->timings;
    double seconds = (double)loop->wall_ns * 1e-9;
    fprintf(file, "%s: %d x %d, %" PRIu64 " frames in %.1f s (%.1f Hz), kernel set %s\n",
            report->source, report->width, report->height, loop->counts.processed, seconds,
            seconds > 0.0 ? (double)loop->counts.processed / seconds : 0.0, report->kernel_set);
    troubles(file, loop);
    imu_troubles(file, &report->imu, report->imu_calibration);
    fprintf(file, "  %-10s %8s %8s %8s %8s   ms of processor time\n", "", "mean", "p50", "p99",
            "max");
    for (int i = 0; i < FOVEA_STAGE_COUNT; i++)
        row(file, fovea_stage_name((enum fovea_stage)i), &timings->stages[i].cpu);
    row(file, "step", &timings->step.cpu);
    row(file, "work", &timings->work.cpu);
    row(file, "frame", &timings->frame.cpu);
    if (loop->real_time) row(file, "latency", &timings->latency);
    fprintf(file, "  memory: block %.2f MiB, resident %.1f MiB; ",
            (double)report->block_bytes / 1048576.0, (double)report->resident_bytes / 1048576.0);
    if (fv_heap_counted())
        fprintf(file, "heap calls of the loop: %" PRIu64 "\n", loop->heap_calls);
    else
        fprintf(file, "heap calls are not counted in this build\n");
}

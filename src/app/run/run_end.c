/* How a run ends: what came of it is told, and written to the files that were asked for. */
#include "app/run.h"

#include <errno.h>
#include <inttypes.h>
#include <math.h>
#include <string.h>
#include <unistd.h>

#include "app/process.h"
#include "app/report.h"
#include "app/run_picture.h"
#include "app/say.h"

static enum fv_exit stats_write(struct fv_run *run, const struct fv_report *report)
{
    if (run->stats == NULL) return FV_EXIT_OK;
    bool failed = ftruncate(fileno(run->stats), 0) != 0 &&
                  errno != EINVAL; /* EINVAL: not a file of its own */
    fv_report_json(run->stats, report);
    failed = failed || ferror(run->stats) != 0;
    failed = fclose(run->stats) != 0 || failed;
    run->stats = NULL;
    return failed ? fv_say_failed("%s: cannot be written", run->stats_path) : FV_EXIT_OK;
}

/* A picture that was asked for must be there; the one that is drawn unasked may fail. */
static enum fv_exit picture_draw(const struct fv_run *run, const struct fv_report *report,
                                 const struct fv_trajectory_summary *path)
{
    struct fovea_error error;
    const struct fv_run_picture picture = {report, path, &run->trails};
    const char *file = run->picture_path != NULL ? run->picture_path : FV_RUN_PICTURE_FILE;
    if (strcmp(file, "none") == 0) return FV_EXIT_OK;
    enum fovea_status status =
        fv_run_picture(file, &picture, run->loop.rt, &run->settings.runtime, &error);
    if (status != FOVEA_OK) fv_say("%s", error.text);
    if (status != FOVEA_OK && run->picture_path != NULL) return FV_EXIT_FAILED;
    if (status == FOVEA_OK && !run->quiet)
        printf("  path, map, tracks and timings are drawn in %s\n", file);
    return FV_EXIT_OK;
}

static void error_tell(const char *of, const struct fv_trajectory_summary *path)
{
    if (!isfinite(path->error_m)) return;
    printf("; %sRMS error %.4g m (%.2f %%) of a path of %.4g m, %s", of, path->error_m,
           100.0 * path->error_m / path->truth_length_m, path->truth_length_m,
           path->maps == 1 ? "aligned" : "each map aligned by itself");
    if (path->metric) printf(", scale off by %+.2f %%", 100.0 * (1.0 / path->scale - 1.0));
}

static void path_tell(const struct fv_run *run, const struct fv_trajectory_summary *path,
                      const struct fv_trajectory_summary *final)
{
    const struct fv_loop_counts *counts = &run->loop.counts;
    if (!run->settings.runtime.odometry.enabled) return;
    printf("  posed %" PRIu64 " of %" PRIu64 " frames, lost %" PRIu64, counts->tracked,
           counts->processed, counts->lost);
    struct fovea_stats stats;
    fovea_stats_get(run->loop.rt, &stats);
    if (stats.loops_closed > 0) printf(", %" PRIu32 " loops closed", stats.loops_closed);
    if (stats.maps_merged > 0) printf(", %" PRIu32 " maps merged", stats.maps_merged);
    error_tell("", path);
    error_tell("after all optimisation ", final);
    printf("\n");
}

static void found_tell(const struct fv_run *run)
{
    if (run->settings.model[0] == '\0') return;
    printf("  found %" PRIu64 " objects in %" PRIu64 " images", run->objects, run->looks);
    if (run->settings.runtime.track.mode != FOVEA_TRACK_OFF)
        printf(", %" PRIu64 " tracks", run->tracks);
    printf("\n");
}

static enum fv_exit path_failed(const char *file, const struct fv_trajectory_summary *summary)
{
    if (summary->failed != 0)
        return fv_say_failed("%s: poses could not be written: %s", file, strerror(summary->failed));
    return fv_say_failed("%s: %" PRIu64 " poses could not be written", file != NULL ? file : "path",
                         summary->lost);
}

enum fv_exit fv_run_report(struct fv_run *run)
{
    struct fovea_memory_table table;
    struct fovea_error error;
    struct fv_trajectory_summary path, final;
    struct fv_report report = {
        .source = run->settings.source,
        .kernel_set = fovea_cpu_name(run->loop.rt),
        .width = run->settings.runtime.camera.width,
        .height = run->settings.runtime.camera.height,
        .loop = &run->loop,
        .block_bytes = run->bytes,
        .resident_bytes = fv_process_resident_bytes(),
        .resident_max_bytes = fv_process_resident_max_bytes(),
    };
    if (fovea_memory(&run->settings.runtime, &table, &error) == FOVEA_OK)
        fv_report_parts(&table, report.part_bytes);
    fv_trajectory_finish(run->trajectory, &path);
    fv_final_finish(run->final, run->loop.rt, &final);
    if (!run->quiet) fv_report_summary(stdout, &report);
    if (!run->quiet) path_tell(run, &path, &final);
    if (!run->quiet) found_tell(run);
    if (!run->quiet) fv_transport_tell(stdout, run->transport);
    enum fovea_status results = fv_results_close(run->results, &error);
    run->results = NULL;
    fv_setup_close_source(&run->setup); /* its memory is the picture's */
    enum fv_exit end = stats_write(run, &report), picture = picture_draw(run, &report, &path);
    if (path.failed != 0 || path.lost > 0) return path_failed(run->trajectory_path, &path);
    if (results != FOVEA_OK) return fv_say_failed("%s", error.text);
    if (final.failed != 0 || final.lost > 0) return path_failed(run->final_path, &final);
    return end != FV_EXIT_OK ? end : picture;
}

void fv_run_end_recording(struct fv_run *run)
{
    struct fv_recorder_summary summary;
    if (run->recorder == NULL) return;
    fv_recorder_close(run->recorder, &summary);
    run->recorder = NULL;
    if (run->quiet) return;
    printf("  recorded %" PRIu64 " events, %.1f MB, in %s%s%s\n", summary.events,
           (double)summary.bytes * 1e-6, run->settings.record,
           summary.complete ? "" : ": incomplete, ", summary.complete ? "" : summary.reason);
}

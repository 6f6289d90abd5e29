/* How a run ends: the answers to who still waits, its summary, and the files that were asked for.
 */
#include "app/run/run.h"

#include <errno.h>
#include <inttypes.h>
#include <math.h>
#include <string.h>
#include <unistd.h>

#include "app/run/process.h"
#include "app/run/realtime.h"
#include "app/run/report.h"
#include "app/run/run_picture.h"
#include "support/say.h"
#include "support/stall.h"
#include "support/text.h"

/* ---- the map of the end, and answers --------------------------------------------------------- */

/* An output is whole, or it has been said that it is not: a run that ends at once loses it no more.
 */
static void written(struct fv_run *run, enum fv_run_output output)
{
    atomic_fetch_and(&run->unwritten, ~(1u << output));
    fv_stall_move(-1);
}

/* Save the map, and answer who still waits for one. */
static enum fovea_status map_end(struct fv_run *run, struct fovea_error *error)
{
    /* Ended before the first frame, there is no map: one of an earlier run is kept. */
    if (atomic_load(&run->shared.stop) && run->loop.counts.processed == 0) {
        fv_answers_end(&run->answers, &run->keeper, &run->recordings,
                       "the run ended before its first frame");
        return FOVEA_OK;
    }
    const int call = fv_stall_enter(run->settings.map_save);
    const enum fovea_status status = fv_keeper_end(&run->keeper, error);
    fv_stall_leave(call);
    fv_answers_end(&run->answers, &run->keeper, &run->recordings,
                   status != FOVEA_OK ? error->text : NULL);
    written(run, FV_RUN_MAP);
    return status;
}

enum fovea_status fv_run_end_requests(struct fv_run *run, enum fovea_status status,
                                      struct fovea_error *error)
{
    fv_recordings_end(&run->recordings);
    fv_requests_step(&run->requests, run->transport, run->feed);
    fv_backup_end(&run->backup, run->transport, run->feed);
    fv_map_loads_end(&run->map_loads, run->transport, run->feed);
    fv_parameters_end(&run->parameters, run->transport, run->feed);
    if (status == FOVEA_OK) return map_end(run, error);
    fv_answers_end(&run->answers, &run->keeper, &run->recordings, error->text);
    return status;
}

/* ---- the report ------------------------------------------------------------------------------ */

static enum fv_exit stats_write(struct fv_run *run, const struct fv_report *report)
{
    struct fovea_error error;
    if (run->stats.file < 0) return FV_EXIT_OK;
    FILE *stream = fv_output_stream(&run->stats);
    if (stream == NULL) return fv_say_failed("%s: cannot be written: no memory", run->stats_path);
    fv_report_json(stream, report);
    return fv_output_close(&run->stats, &error) == FOVEA_OK ? FV_EXIT_OK
                                                            : fv_say_failed("%s", error.text);
}

bool fv_run_draws(const struct fv_run *run)
{
    return run->picture_path != NULL ? strcmp(run->picture_path, "none") != 0 : !run->quiet;
}

/* A picture that was asked for must be there; the one that is drawn unasked may fail. */
static enum fv_exit picture_draw(struct fv_run *run, const struct fv_report *report,
                                 const struct fv_trajectory_summary *path)
{
    struct fovea_error error;
    if (!fv_run_draws(run)) return FV_EXIT_OK;
    /* No step comes any more: its scratch makes room for the frame that is read again. */
    fv_realtime_release(run->memory, run->bytes, report->part_bytes[FOVEA_MEMORY_FRAME]);
    (void)fv_snapshot_fetch(&run->snapshot, run->settings.source,
                            fv_setup_wants_colour(&run->setup));
    const struct fv_run_picture picture = {report, path, &run->trails, &run->watch,
                                           fv_snapshot_best(&run->snapshot)};
    const char *file = run->picture_path != NULL ? run->picture_path : FV_RUN_PICTURE_FILE;
    enum fovea_status status =
        fv_run_picture(file, &picture, run->loop.rt, &run->settings.runtime, &error);
    if (status != FOVEA_OK) fv_say("%s", error.text);
    if (status != FOVEA_OK && run->picture_path != NULL) return FV_EXIT_FAILED;
    if (status == FOVEA_OK && !run->quiet)
        printf("  states, a frame, map, objects and timings are drawn in %s\n", file);
    return FV_EXIT_OK;
}

static void error_print(const char *of, const struct fv_trajectory_summary *path)
{
    if (!isfinite(path->error_m)) return;
    if (!(path->truth_length_m > 0)) { /* it has no length to compare with */
        printf("; %sRMS error %.4g m, by the truth the camera stood still", of, path->error_m);
        return;
    }
    printf("; %sRMS error %.4g m (%.2f %%) of a path of %.4g m, %s", of, path->error_m,
           100.0 * path->error_m / path->truth_length_m, path->truth_length_m,
           path->maps == 1 ? "aligned" : "each map aligned by itself");
    if (path->metric) printf(", scale off by %+.2f %%", 100.0 * (1.0 / path->scale - 1.0));
}

/* How long the pose was in which state. */
static void states_print(const struct fv_watch *watch)
{
    const char *before = "  states: ";
    for (int i = FV_WATCH_STARTING; i < FV_WATCH_STATES; i++) {
        if (watch->total_ns[i] == 0) continue;
        printf("%s%s %.1f s", before, fv_watch_name((enum fv_watch_state)i),
               (double)watch->total_ns[i] * 1e-9);
        before = ", ";
    }
    if (before[0] == ',') printf("\n");
}

/* Whether lengths are in metres, and how well that is known. */
static void scale_print(const struct fv_run *run)
{
    static const char *const sources[] = {
        [FOVEA_SCALE_FREE] = "",
        [FOVEA_SCALE_CAMERA_HEIGHT] = "the camera's height over the floor",
        [FOVEA_SCALE_WHEEL_ODOMETRY] = "wheel odometry",
        [FOVEA_SCALE_STEREO] = "two cameras",
        [FOVEA_SCALE_INERTIAL] = "the inertial sensor",
    };
    struct fovea_pose pose;
    fovea_pose_get(run->loop.rt, &pose);
    const enum fovea_scale_source wanted = run->settings.runtime.scale.source;
    if (run->loop.counts.posed == 0)
        printf("  scale: unknown, as no frame has a pose\n");
    else if (pose.scale_source != FOVEA_SCALE_FREE)
        printf("  scale: metres, from %s, to %.2g %% (1 sigma)\n", sources[pose.scale_source],
               100.0 * pose.scale_sigma);
    else if (wanted != FOVEA_SCALE_FREE)
        printf("  scale: not known at the end, though scale.source names %s\n", sources[wanted]);
    else
        printf("  scale: unknown; the unit is the median depth at the start of each map "
               "(scale.source gives metres)\n");
}

static void path_print(const struct fv_run *run, const struct fv_trajectory_summary *path,
                       const struct fv_trajectory_summary *final)
{
    const struct fv_loop_counts *counts = &run->loop.counts;
    if (!run->settings.runtime.odometry.enabled) return;
    printf("  posed %" PRIu64 " of %" PRIu64 " frames, lost %" PRIu64, counts->posed,
           counts->processed, counts->lost);
    struct fovea_stats stats;
    char count[FV_TEXT_COUNT_BYTES];
    fovea_stats_get(run->loop.rt, &stats);
    if (stats.closures > 0) printf(", %s", fv_text_count(stats.closures, "closure", count));
    if (stats.maps_merged > 0)
        printf(", %s merged", fv_text_count(stats.maps_merged, "map", count));
    error_print("", path);
    error_print("after all optimisation ", final);
    printf("\n");
    if (counts->posed == 0)
        printf("  why no pose: %s\n",
               fv_watch_why_no_pose(&run->watch, run->settings.runtime.odometry.localise_only));
    states_print(&run->watch);
    scale_print(run);
    struct fovea_calibration calibration;
    fovea_calibration_get(run->loop.rt, &calibration);
    if (calibration.state != FOVEA_CALIBRATION_OK)
        printf("  calibration %s: %s\n",
               calibration.state == FOVEA_CALIBRATION_WRONG ? "wrong" : "doubtful",
               calibration.reason);
}

/* Whether a network, 0 the first, has labelled the pixels of an image. */
static bool has_labelled(const struct fv_run *run, uint32_t network)
{
    struct fovea_segmentation seen;
    fovea_segmentation_get(run->loop.rt, network, &seen);
    return seen.count > 0 && seen.list[0].object < 0;
}

/* Of a network, 0 the first: what it found, or that it labels pixels. */
static void network_print(const struct fv_run *run, uint32_t network, uint64_t found,
                          uint64_t inferences)
{
    printf("  %s", network == 0 ? "" : "the second network ");
    if (has_labelled(run, network))
        printf("labelled the pixels of %" PRIu64 " images", inferences);
    else
        printf("found %" PRIu64 " detections in %" PRIu64 " images", found, inferences);
}

/* At the end of the run. */
static enum fovea_status grid_draw(struct fv_run *run, struct fovea_error *error)
{
    const struct fovea_grid_job_config *job = &run->settings.runtime.grid_job;
    if (!job->enabled) return FOVEA_OK;
    enum fovea_status status =
        fv_grid_file_write(run->grid_path, run->loop.rt, job->grid.side_cells, &run->grid, error);
    if (status == FOVEA_OK && run->grid_path != NULL)
        status = fv_grid_file_write_heights(run->grid_path, run->loop.rt, &job->grid, error);
    return status;
}

/* How the floor lies against what T_body_cam says. */
static void print_floor(const struct fovea *rt)
{
    const double degrees = 57.29577951308232;
    struct fovea_ground ground;
    if (!fovea_ground_get(rt, &ground)) return;
    printf(
        "  floor: rises forward by %.2f degrees (+-%.2f), to the left by %.2f (+-%.2f), and is %.1f "
        "mm (+-%.1f) above what T_body_cam says; %" PRIu32 " planes of landmarks",
        degrees * ground.mount_slope[0], degrees * ground.mount_sigma[0],
        degrees * ground.mount_slope[1], degrees * ground.mount_sigma[1],
        1000 * ground.mount_height_m, 1000 * ground.mount_sigma[2], ground.landmarks_taken);
    if (ground.landmarks_refused > 0)
        printf(", %" PRIu32 " refused as another plane", ground.landmarks_refused);
    printf("\n");
}

/* Why no cell is free or occupied. */
static const char *no_cell(const struct fv_run *run)
{
    struct fovea_pose pose;
    fovea_pose_get(run->loop.rt, &pose);
    if (run->watch.state == FV_WATCH_LOST) return "the pose is lost";
    if (!has_labelled(run, 0) && !has_labelled(run, 1)) return "no image was labelled";
    if (pose.scale_source == FOVEA_SCALE_FREE) return "poses are not in metres";
    return "no mask showed the floor near the robot";
}

static void found_print(const struct fv_run *run)
{
    if (run->settings.model[0] == '\0') return;
    network_print(run, 0, run->detections, run->inferences);
    if (run->settings.runtime.objects.mode != FOVEA_OBJECTS_OFF)
        printf(", %" PRIu64 " objects", run->objects);
    printf("\n");
    if (run->settings.model2[0] != '\0') {
        network_print(run, 1, run->detections2, run->inferences2);
        printf("\n");
    }
    const struct fv_grid_counts *grid = &run->grid;
    if (!run->settings.runtime.grid_job.enabled) return;
    if (grid->free + grid->occupied == 0)
        printf("  free space: none known at the end: %s\n", no_cell(run));
    else
        printf("  free space: %" PRIu32 " cells free, %" PRIu32 " occupied%s%s\n", grid->free,
               grid->occupied, run->grid_path != NULL ? ", drawn in " : "",
               run->grid_path != NULL ? run->grid_path : "");
    print_floor(run->loop.rt);
}

static enum fv_exit path_failed(const char *file, const struct fv_trajectory_summary *summary)
{
    if (summary->failed != 0)
        return fv_say_failed("%s: poses could not be written: %s", file, strerror(summary->failed));
    return fv_say_failed("%s: %" PRIu64 " poses could not be written", file != NULL ? file : "path",
                         summary->lost);
}

void fv_run_lost(const void *context, char *text, size_t bytes)
{
    static const char *const what[FV_RUN_OUTPUT_COUNT] = {
        [FV_RUN_MAP] = "the map",
        [FV_RUN_RECORDING] = "the end of the recording",
        [FV_RUN_STATS] = "the statistics",
        [FV_RUN_TRAJECTORY] = "the end of the trajectory",
        [FV_RUN_FINAL] = "the final trajectory",
        [FV_RUN_PICTURE] = "the picture",
        [FV_RUN_DETECTIONS] = "the end of the detections",
        [FV_RUN_OBJECTS] = "the end of the objects",
        [FV_RUN_TRUTH] = "the end of the truth",
        [FV_RUN_GRID] = "the grid",
    };
    const struct fv_run *run = context;
    const unsigned unwritten = atomic_load(&run->unwritten);
    size_t length = 0;
    text[0] = '\0';
    for (int i = 0; i < FV_RUN_OUTPUT_COUNT && length < bytes; i++)
        if (unwritten & 1u << i)
            length += (size_t)snprintf(text + length, bytes - length, "%s%s %s",
                                       length > 0 ? ", " : "", what[i], run->outputs[i]);
}

static const char *name_of(const struct fv_run *run, enum fv_run_output output)
{
    return run->outputs[output] != NULL ? run->outputs[output] : "an output";
}

/* Parts of the report as calls that may stall. */
static void summary_print(struct fv_run *run, const struct fv_report *report,
                          const struct fv_trajectory_summary *path,
                          const struct fv_trajectory_summary *final)
{
    const int call = fv_stall_enter("standard output");
    fv_report_summary(stdout, report);
    path_print(run, path, final);
    found_print(run);
    fv_imu_input_tell(stdout, &run->imu);
    fv_velocity_input_tell(stdout, &run->velocities);
    fv_transport_tell(stdout, run->transport);
    fflush(stdout);
    fv_stall_leave(call);
}

static enum fv_exit recording_close(struct fv_run *run, struct fv_recorder_summary *summary)
{
    if (run->recorder == NULL) return FV_EXIT_OK;
    const enum fovea_status status = fv_recorder_close(run->recorder, summary);
    run->recorder = NULL;
    written(run, FV_RUN_RECORDING);
    return status == FOVEA_OK ? FV_EXIT_OK : FV_EXIT_FAILED;
}

static void recording_print(const struct fv_recorder_summary *summary)
{
    const int call = fv_stall_enter("standard output");
    if (summary->removed && summary->complete)
        printf("  no iteration was recorded: %s is removed\n", summary->path);
    else
        printf("  recorded %" PRIu64 " events, %.1f MB, in %s%s%s\n", summary->events,
               (double)summary->bytes * 1e-6, summary->path,
               summary->complete ? "" : ": incomplete, ", summary->complete ? "" : summary->reason);
    fflush(stdout);
    fv_stall_leave(call);
}

static enum fv_exit log_end(const struct fv_run *run)
{
    uint64_t offered;
    const uint64_t lost = fv_transport_lost(run->transport, &offered);
    if (lost > 0)
        return fv_say_failed("%s: %" PRIu64 " of %" PRIu64 " messages could not be written",
                             run->settings.lcm_url, lost, offered);
    return fv_transport_sync(run->transport) ? FV_EXIT_OK : FV_EXIT_FAILED;
}

/* What came of the outputs of a run. */
struct ends {
    struct fv_trajectory_summary path, truth, final;
    enum fovea_status results, grid;
    struct fovea_error results_error, grid_error;
    enum fv_exit statistics, picture, recording;
};

static void finish(struct fv_run *run, enum fv_run_output output, struct ends *ends)
{
    const int call = fv_stall_enter(name_of(run, output));
    if (output == FV_RUN_TRAJECTORY) fv_trajectory_finish(run->trajectory, &ends->path);
    if (output == FV_RUN_TRUTH) fv_trajectory_finish(run->truth, &ends->truth);
    if (output == FV_RUN_FINAL) fv_final_finish(run->final, run->loop.rt, &ends->final);
    if (output == FV_RUN_GRID) ends->grid = grid_draw(run, &ends->grid_error);
    written(run, output);
    fv_stall_leave(call);
}

static void finish_results(struct fv_run *run, struct ends *ends)
{
    const int call = fv_stall_enter(
        name_of(run, run->objects_path != NULL ? FV_RUN_OBJECTS : FV_RUN_DETECTIONS));
    ends->results = fv_results_close(run->results, &ends->results_error);
    run->results = NULL;
    written(run, FV_RUN_DETECTIONS);
    written(run, FV_RUN_OBJECTS);
    fv_stall_leave(call);
}

static void report_draw(struct fv_run *run, const struct fv_report *report, struct ends *ends)
{
    int call = fv_stall_enter(name_of(run, FV_RUN_STATS));
    ends->statistics = stats_write(run, report);
    written(run, FV_RUN_STATS);
    fv_stall_leave(call);
    call = fv_stall_enter(name_of(run, FV_RUN_PICTURE));
    ends->picture = picture_draw(run, report, &ends->path);
    written(run, FV_RUN_PICTURE);
    fv_stall_leave(call);
}

/* The first of what went wrong, with its line. */
static enum fv_exit report_end(struct fv_run *run, const struct ends *ends)
{
    if (ends->path.failed != 0 || ends->path.lost > 0)
        return path_failed(run->trajectory_path, &ends->path);
    if (ends->truth.failed != 0 || ends->truth.lost > 0)
        return path_failed(run->truth_path, &ends->truth);
    if (ends->results != FOVEA_OK) return fv_say_failed("%s", ends->results_error.text);
    if (ends->grid != FOVEA_OK) return fv_say_failed("%s", ends->grid_error.text);
    if (ends->final.failed != 0 || ends->final.lost > 0)
        return path_failed(run->final_path, &ends->final);
    enum fv_exit end = ends->statistics;
    if (end == FV_EXIT_OK) end = ends->picture;
    if (end == FV_EXIT_OK) end = log_end(run);
    return end != FV_EXIT_OK ? end : ends->recording;
}

enum fv_exit fv_run_report(struct fv_run *run)
{
    struct fovea_memory_table table;
    struct fovea_error error;
    struct fv_transport_sent sent;
    struct fv_recorder_summary recording;
    struct ends ends = {0};
    fv_transport_finish(run->transport);
    fv_transport_sent(run->transport, &sent);
    struct fv_report report = {
        .sent = &sent,
        .source = run->settings.source,
        .imu_calibration = fv_run_imu_calibration(run),
        .kernel_set = fovea_cpu_name(run->loop.rt),
        .width = run->settings.runtime.rig.cameras[0].camera.width,
        .height = run->settings.runtime.rig.cameras[0].camera.height,
        .loop = &run->loop,
        .block_bytes = run->bytes,
        .resident_bytes = fv_process_resident_bytes(),
        .resident_max_bytes = fv_process_resident_max_bytes(),
        .anonymous_bytes = fv_process_anonymous_bytes(),
    };
    fovea_imu_status_get(run->loop.rt, &report.imu);
    if (fovea_memory(&run->settings.runtime, &table, &error) == FOVEA_OK)
        fv_report_parts(&table, report.part_bytes);
    finish(run, FV_RUN_TRAJECTORY, &ends);
    finish(run, FV_RUN_TRUTH, &ends);
    finish(run, FV_RUN_FINAL, &ends);
    finish_results(run, &ends);
    finish(run, FV_RUN_GRID, &ends);
    fv_setup_close_source(&run->setup); /* its memory is the picture's */
    report_draw(run, &report, &ends);
    const bool recorded = run->recorder != NULL;
    ends.recording = recording_close(run, &recording);
    if (!run->quiet) { /* when all files are written: the terminal may be stopped */
        summary_print(run, &report, &ends.path, &ends.final);
        if (recorded) recording_print(&recording);
    }
    return report_end(run, &ends);
}

enum fv_exit fv_run_end_recording(struct fv_run *run)
{
    struct fv_recorder_summary summary;
    if (run->recorder == NULL) return FV_EXIT_OK;
    const enum fv_exit end = recording_close(run, &summary);
    if (!run->quiet) recording_print(&summary);
    return end;
}

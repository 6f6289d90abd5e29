/* fovea run: the real-time loop on one source. */
#include <errno.h>
#include <inttypes.h>
#include <malloc.h>
#include <math.h>
#include <semaphore.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "app/config/classes.h"
#include "app/run/process.h"
#include "app/run/realtime.h"
#include "app/run/run.h"
#include "app/run/run_sense.h"
#include "app/run/web_page.h"
#include "runtime/config.h"
#include "support/say.h"
#include "app/run/signals.h"
#include "support/stall.h"
#include "drivers/clock.h"
#include "drivers/table.h"
#include "drivers/thread.h"
#include "app/network/run_id.h"

/* ---- around the loop: called on its thread --------------------------------------------------- */

static void pace(void *context)
{
    struct fv_run *run = context;
    /* Who drives in lock-step has the grid of a frame before the pose of the next, on a busy
     * machine, too: the same bits again. */
    const bool settled = fv_velocity_input_drives(&run->velocities);
    while (!atomic_load_explicit(&run->shared.stop, memory_order_relaxed) &&
           (!fv_recorder_room(run->recorder) ||
            !fv_recorder_room(fv_recordings_recorder(&run->recordings)) ||
            !fv_transport_room(run->transport, settled) || !fv_trajectory_room(run->trajectory) ||
            !fv_trajectory_room(run->truth) || !fv_final_room(run->final) ||
            !fv_results_room(run->results))) {
        atomic_fetch_add_explicit(&run->shared.beats, 1, memory_order_relaxed);
        nanosleep(&(struct timespec){.tv_nsec = 1000000}, NULL);
    }
}

static uint32_t commands(void *context)
{
    struct fv_run *run = context;
    const uint32_t bits = fv_answers_take(&run->answers, &run->keeper, &run->recordings);
    return fv_keeper_commands(&run->keeper, bits);
}

/* What the source knows of the frame's pose, into `sample` and the file that asks for it. */
static void take_truth(struct fv_run *run, const struct fovea_frame *frame,
                       struct fv_trajectory_sample *sample)
{
    const struct fovea_source_ops *ops = run->setup.ops;
    struct fv_trajectory_sample known = {
        .stamp_ns = frame->stamp_ns, .map = FV_TRAJECTORY_NO_MAP, .metric = true};
    sample->has_truth = ops->truth_pose != NULL &&
                        ops->truth_pose(run->setup.source, frame, known.T_world_cam) == FOVEA_OK;
    if (!sample->has_truth) return;
    for (int i = 0; i < 3; i++)
        sample->truth_m[i] = known.T_world_cam[4 * i + 3];
    fv_trajectory_add(run->truth, &known);
}

static void step_done(void *context, const struct fovea_inputs *inputs,
                      const struct fovea_outputs *outputs, const struct fovea_pose *pose)
{
    struct fv_run *run = context;
    fv_transport_publish(run->transport, outputs);
    fv_feed_publish(run->feed, outputs);
    fv_feed_frame(run->feed, inputs->frame);
    fv_answers_step(&run->answers);
    fv_requests_step(&run->requests, run->transport, run->feed);
    fv_backup_step(&run->backup, run->transport, run->feed);
    struct fv_recorder *const recorders[2] = {run->recorder,
                                              fv_recordings_recorder(&run->recordings)};
    fv_parameters_step(&run->parameters, recorders, inputs, run->transport, run->feed);
    fv_map_loads_step(&run->map_loads, recorders, inputs, run->transport, run->feed);
    for (int i = 0; i < 2; i++)
        fv_recorder_step(recorders[i], inputs, outputs);
    fv_watch_step(&run->watch, run->loop.rt, inputs, pose != NULL);
    fv_final_observe(run->final, run->loop.rt);
    if (pose != NULL) fv_snapshot_step(&run->snapshot, run->loop.rt, inputs->frame, pose);
    if (pose == NULL || (!pose->posed && run->truth == NULL)) return;
    struct fv_trajectory_sample sample = {.stamp_ns = inputs->frame->stamp_ns,
                                          .map = pose->map_id,
                                          .metric = pose->scale_source != FOVEA_SCALE_FREE};
    take_truth(run, inputs->frame, &sample);
    if (!pose->posed) return;
    memcpy(sample.T_world_cam, pose->T_world_cam, sizeof sample.T_world_cam);
    fv_trajectory_add(run->trajectory, &sample);
    fv_final_frame(run->final, pose, &sample);
}

static void count_second(struct fv_run *run)
{
    struct fovea_detections detections;
    fovea_detections2_get(run->loop.rt, &detections);
    if (detections.inferences == run->inferences2) return;
    run->inferences2 = detections.inferences;
    run->detections2 += detections.count;
}

static void work_done(void *context, const struct fovea_inputs *inputs,
                      const struct fovea_grants *grants, const struct fovea_outputs *outputs)
{
    struct fv_run *run = context;
    fv_transport_publish(run->transport, outputs);
    fv_feed_publish(run->feed, outputs);
    fv_recorder_work(run->recorder, inputs, grants, outputs);
    fv_recorder_work(fv_recordings_recorder(&run->recordings), inputs, grants, outputs);
    fv_recordings_work(&run->recordings, run->transport, run->feed);
    fv_run_health_work(run, inputs);
    fv_keeper_work(&run->keeper, outputs);
    fv_final_observe(run->final, run->loop.rt);
    struct fovea_detections detections;
    fovea_detections_get(run->loop.rt, &detections);
    count_second(run);
    if (detections.inferences == run->inferences) return;
    run->inferences = detections.inferences;
    atomic_store_explicit(&run->health.inferences_now, detections.inferences, memory_order_relaxed);
    struct fovea_objects objects;
    fovea_objects_get(run->loop.rt, &objects);
    run->detections += detections.count;
    atomic_store_explicit(&run->watch.detections, detections.count, memory_order_relaxed);
    run->objects = objects.confirmed;
    if (run->all_boxes) detections.count += detections.uncertain;
    fv_results_add(run->results, &detections, &objects);
    fv_snapshot_work(&run->snapshot, &detections, &objects);
    if (objects.updates > 0) fv_trails_observe(&run->trails, &objects);
}

static void *loop_body(void *argument)
{
    struct fv_run *run = argument;
    fv_loop_run(&run->loop);
    sem_post(&run->ended);
    return NULL;
}

/* ---- set-up ---------------------------------------------------------------------------------- */

static enum fv_options_result options_read(struct fv_run *run, int argc, char **argv)
{
    const struct fv_option options[] = {
        {"config", "FILE", FV_OPTION_TEXT, &run->options.config,
         "configuration file ('fovea config' prints one)"},
        {"source", "URI", FV_OPTION_TEXT, &run->options.source, FV_SETUP_SOURCE_HELP},
        {"camera", "FILE", FV_OPTION_TEXT, &run->options.camera,
         "calibration file; default: the source's own"},
        {"fov", "DEGREES", FV_OPTION_TEXT, &run->options.fov,
         "without a calibration: horizontal field of view, for rough poses marked uncalibrated"},
        {"rate", "max|real", FV_OPTION_TEXT, &run->options.rate,
         "max: process every frame; real: follow the clock and drop late frames"},
        {"frames", "N", FV_OPTION_POSITIVE, &run->selection.frames, "end after N frames"},
        {"start", "N", FV_OPTION_COUNT, &run->selection.start,
         "start with frame N of the recording, counted from 0"},
        {"step", "K", FV_OPTION_POSITIVE, &run->selection.step,
         "take every K-th frame of the recording"},
        {"reverse", NULL, FV_OPTION_FLAG, &run->selection.reverse, "play the recording backwards"},
        {"stats", "FILE", FV_OPTION_TEXT, &run->stats_path,
         "write times, counts and memory as JSON"},
        {"trajectory", "FILE|DIR/", FV_OPTION_TEXT, &run->trajectory_path,
         "write T_world_cam of every frame with a pose, as published, in TUM format; '# map N' begins a map; in DIR/ a file map-N.tum for each map"},
        {"trajectory-final", "FILE|DIR/", FV_OPTION_TEXT, &run->final_path,
         "write the same poses after all optimisation, at the end of the run"},
        {"truth", "FILE", FV_OPTION_TEXT, &run->truth_path,
         "write T_world_cam of every processed frame as the source knows it, in TUM format"},
        {"picture", "FILE", FV_OPTION_TEXT, &run->picture_path,
         "draw states, a frame, map, objects and timings into FILE (default " FV_RUN_PICTURE_FILE
         "; none: do not draw)"},
        {"model", "FILE", FV_OPTION_TEXT, &run->options.model,
         "int8 network to run on frames (.fvm, made by tools/import)"},
        {"detections", "FILE", FV_OPTION_TEXT, &run->detections_path,
         "write the detections of the network as COCO results JSON"},
        {"all-boxes", NULL, FV_OPTION_FLAG, &run->all_boxes,
         "add to --detections those below the threshold, which objects may use"},
        {"objects", "FILE", FV_OPTION_TEXT, &run->objects_path,
         "write the objects as MOTChallenge text"},
        {"grid", "FILE", FV_OPTION_TEXT, &run->grid_path,
         "draw the grid of free space as it is at the end into FILE (PNG)"},
        {"record", "FILE|DIR/", FV_OPTION_TEXT, &run->options.record,
         "record the run for 'fovea replay'; in DIR/ each run makes a new numbered file"},
        {"map", "FILE", FV_OPTION_TEXT, &run->options.map, "start with a saved map"},
        {"save-map", "FILE", FV_OPTION_TEXT, &run->options.save_map,
         "save the map at the end, and on the command `save`"},
        {"set", "KEY=VALUE", FV_OPTION_LIST, &run->options.sets,
         "override a key of the configuration"},
        {"web", "PORT", FV_OPTION_OPTIONAL, &run->web_port,
         "show the run in browsers of this host (fovea-web), at this port (default 7680)"},
        {"quiet", NULL, FV_OPTION_FLAG, &run->quiet,
         "no status line, no lines about the pose and no summary"},
        {0},
    };
    int first;
    run->selection.step = 1;
    return fv_options_parse(options, "", 0, 0, argc, argv, &first);
}

/* Settings, and that nothing that is read would be written over; the page starts beside. */
static enum fovea_status settings_read(struct fv_run *run, struct fovea_error *error)
{
    enum fovea_status status = fv_setup_settings(&run->options, &run->settings, error);
    fv_history_path(run->settings.health_state_file, run->settings.file, run->health.history_path,
                    sizeof run->health.history_path);
    if (status == FOVEA_OK) status = fv_run_files_apart(run, error);
    if (status == FOVEA_OK)
        status = fv_web_page_start(run->web_port, &run->settings, &run->web_page, error);
    return status;
}

static enum fovea_status runtime_open(struct fv_run *run, struct fovea_error *error)
{
    struct fovea_config *config = &run->settings.runtime;
    bool locked;
    config->clock = fv_timing_clock;
    enum fovea_status status = fovea_size(config, &run->bytes, error);
    if (status == FOVEA_OK)
        status =
            fv_realtime_map(run->bytes, run->settings.lock_memory, &run->memory, &locked, error);
    if (status != FOVEA_OK) return status;
    if (run->settings.lock_memory && !locked) run->unlocked = *error;
    return fovea_init(run->memory, run->bytes, config, &run->loop.rt, error);
}

/* Before anything brings samples. */
static void fast_pose_open(struct fv_run *run)
{
    const struct fv_settings *settings = &run->settings;
    if (run->transport == NULL || settings->imu[0] == '\0' || settings->pose_fast_rate == 0 ||
        !run->setup.ops->info(run->setup.source)->live)
        return;
    fv_fast_pose_open(&run->fast_pose, run->loop.rt, run->transport,
                      settings->runtime.channel_prefix, settings->pose_fast_rate);
    fv_imu_input_tap(&run->imu, fv_fast_pose_take, &run->fast_pose);
}

/* A machine that cannot send messages is no reason not to run: the recording and the statistics are
 * still of use. A malformed URL is. */
static enum fovea_status transport_open(struct fv_run *run, struct fovea_error *error)
{
    const struct fv_settings *settings = &run->settings;
    const bool odometry = settings->runtime.scale.source == FOVEA_SCALE_WHEEL_ODOMETRY;
    struct fv_receiver_channel more[6];
    struct fv_transport_ears ears = {
        .listen = settings->listen,
        .more = more,
        .rules = {.from_network = settings->commands, .run_id = run->run_id},
        .wheel_odometry_limits = {settings->wheel_odometry_max_m_s,
                                  settings->wheel_odometry_max_rad_s},
        .prefix = settings->runtime.channel_prefix,
        .wheel_odometry_channel = odometry ? settings->wheel_odometry_channel : NULL,
    };
    const char *without = "no LCM messages";
    enum fovea_status status = FOVEA_OK;
    ears.rules.keyed = settings->command_key[0] != '\0';
    if (ears.rules.keyed)
        status = fv_command_key_read(settings->command_key, ears.rules.key, error);
    if (status == FOVEA_OK) status = fv_requests_open(&run->requests, &ears.rules, error);
    if (status == FOVEA_OK)
        status = fv_parameters_open(&run->parameters, run->loop.rt, settings, &run->setup,
                                    &run->requests, error);
    if (status == FOVEA_OK)
        status = fv_backup_open(&run->backup, &run->parameters, settings,
                                run->setup.ops->info(run->setup.source), error);
    if (status == FOVEA_OK) {
        status = fv_map_loads_open(&run->map_loads, &run->requests, run->loop.rt, settings, error);
        if (status == FOVEA_ERROR_INPUT) fv_settings_blame(settings, "map.folder", error);
    }
    more[ears.more_count++] = fv_identity_row(settings->runtime.channel_prefix, &run->others);
    more[ears.more_count++] = fv_parameters_row(&run->parameters);
    more[ears.more_count++] = fv_backup_row(&run->backup);
    more[ears.more_count++] = fv_map_loads_row(&run->map_loads);
    fv_velocity_input_open(&run->velocities, &run->requests, run->setup.ops, run->setup.source,
                           settings->runtime.channel_prefix);
    more[ears.more_count++] = fv_velocity_input_row(&run->velocities);
    if (fv_imu_input_hears(&run->imu)) more[ears.more_count++] = fv_imu_input_row(&run->imu);
    if (status == FOVEA_OK)
        status =
            fv_transport_open_early(settings->lcm_url, settings->lcm_ttl, &run->transport, error);
    if (status == FOVEA_OK) {
        fast_pose_open(run);
        without = "no commands";
        status = fv_transport_listen(run->transport, &ears, error);
    }
    if (status == FOVEA_OK) return FOVEA_OK;
    fv_settings_locate(&run->settings, error);
    if (status == FOVEA_ERROR_INPUT) return status;
    fv_say("fovea run: %s: %s", without, error->text);
    return FOVEA_OK;
}

static enum fovea_status feed_open(struct fv_run *run, struct fovea_error *error)
{
    const struct fv_feed_setup setup = {.path = run->settings.web_socket,
                                        .prefix = run->settings.runtime.channel_prefix,
                                        .run_id = run->run_id,
                                        .frame_bytes = fv_setup_frame_bytes(&run->setup),
                                        .picture_rate_hz = run->settings.web_picture_rate};
    const enum fovea_status status = fv_feed_open(&setup, &run->feed, error);
    fv_feed_repeat(run->feed, &(struct fovea_message){run->identity.channel, run->identity.data,
                                                      run->identity.bytes, true});
    if (status != FOVEA_OK) fv_settings_locate(&run->settings, error);
    return status;
}

static enum fovea_status recorders_open(struct fv_run *run, struct fovea_error *error)
{
    struct fv_recorder_setup setup = {
        .path = run->settings.record,
        .settings = &run->settings,
        .identity = &run->identity,
        .kernel_set = fovea_cpu_name(run->loop.rt),
        .real_time = run->loop.real_time,
        .frame_bytes = fv_setup_frame_bytes(&run->setup),
    };
    const enum fovea_status status =
        fv_recordings_open(&run->recordings, run->loop.rt, &setup, run->run_id, error);
    if (status == FOVEA_ERROR_INPUT) fv_settings_blame(&run->settings, "record_folder", error);
    if (status != FOVEA_OK || run->settings.record[0] == '\0') return status;
    /* A file that cannot be made is a wrong name; later troubles with it are the machine's. */
    if (fv_recorder_open(&setup, &run->recorder, error) == FOVEA_OK) {
        snprintf(run->recording, sizeof run->recording, "%s", fv_recorder_path(run->recorder));
        return FOVEA_OK;
    }
    fv_settings_blame(&run->settings, "record", error);
    return FOVEA_ERROR_INPUT;
}

/* Kept as it is until there is something to write. */
static enum fovea_status stats_open(struct fv_run *run, struct fovea_error *error)
{
    struct fovea_error why;
    if (run->stats_path == NULL ||
        fv_output_open(&run->stats, run->stats_path, FV_OUTPUT_WHOLE, &why) == FOVEA_OK)
        return FOVEA_OK;
    return fovea_error_set(error, FOVEA_ERROR_INPUT, "--stats: %.400s", why.text);
}

/* What is as good as it can be here. Not before all the rest is known to be right: wrong input is
 * one line. */
static void remarks(const struct fv_run *run)
{
    const struct fovea_config *config = &run->settings.runtime;
    const char *lacks = fv_config_stereo_lacks(&config->rig);
    if (lacks != NULL && config->rig.camera_count > 1 && config->odometry.enabled &&
        config->odometry.sensors == FOVEA_SENSORS_AUTO)
        fv_say("fovea run: odometry uses the first camera alone: found %s", lacks);
    if (run->unlocked.text[0] != '\0') fv_say("fovea run: %s", run->unlocked.text);
    if (fv_setup_wants_colour(&run->setup) &&
        run->setup.ops->info(run->setup.source)->format == FOVEA_PIXEL_GREY8)
        fv_say(
            "fovea run: the network takes colour and this source gives grey levels: each channel gets the grey level");
    char floor[256];
    const struct fv_setup *setup = &run->setup;
    fv_classes_floor(&run->settings, setup->model.data != NULL ? &setup->model.model : NULL,
                     setup->model2.data != NULL ? &setup->model2.model : NULL, floor, sizeof floor);
    if (floor[0] != '\0' && !run->quiet) fv_say_note("free space: floor is %s", floor);
}

/* Last what cuts files: by then all that can be wrong with the input has been said. */
static enum fovea_status open_all(struct fv_run *run, struct fovea_error *error)
{
    enum fovea_status status = fv_setup_open(&run->settings, &run->selection, &run->setup, error);
    if (status == FOVEA_OK) status = fv_run_files_source(run, error);
    if (status == FOVEA_OK && run->truth_path != NULL &&
        !run->setup.ops->info(run->setup.source)->has_truth)
        status = fovea_error_set(
            error, FOVEA_ERROR_INPUT,
            "fovea run: --truth: found no truth in %.400s, expected a source that knows its poses",
            run->settings.source);
    if (status != FOVEA_OK) return status;
    run->loop.real_time = fv_setup_real_time(&run->settings, &run->setup);
    fv_imu_input_open(&run->imu, &run->settings, run->setup.iio);
    status = runtime_open(run, error);
    if (status == FOVEA_OK) status = fv_run_id_make(&run->run_id, error);
    if (status == FOVEA_OK) {
        fv_message_prepare();
        fv_identity_make(&run->identity, run->settings.runtime.channel_prefix, run->run_id);
        run->others.own = run->run_id;
        status = transport_open(run, error);
    }
    if (status == FOVEA_OK) status = feed_open(run, error);
    fv_answers_open(&run->answers, run->transport, run->feed, run->settings.runtime.channel_prefix,
                    run->run_id);
    if (status == FOVEA_OK)
        status = fv_keeper_open(&run->keeper, run->loop.rt, &run->settings, error);
    if (status == FOVEA_OK) remarks(run);
    if (status == FOVEA_OK) status = stats_open(run, error);
    if (status == FOVEA_OK) status = recorders_open(run, error);
    if (status == FOVEA_OK)
        status = fv_trajectory_open(run->trajectory_path, &run->trajectory, error);
    if (status == FOVEA_OK && run->truth_path != NULL)
        status = fv_trajectory_open(run->truth_path, &run->truth, error);
    if (status == FOVEA_OK)
        status = fv_results_open(run->detections_path, run->objects_path, &run->results, error);
    if (status == FOVEA_OK && run->final_path != NULL)
        status = fv_final_open(run->final_path, &run->final, error);
    if (status == FOVEA_OK) /* the first message: a log takes its place with it */
        fv_transport_repeat(run->transport, run->identity.channel, run->identity.data,
                            run->identity.bytes);
    free(run->setup.map); /* read, and recorded */
    run->setup.map = NULL;
    run->settings.runtime.map = NULL;
    return status;
}

/* What a run that ends at once would lose. */
static void outputs_open(struct fv_run *run)
{
    const char *const paths[FV_RUN_OUTPUT_COUNT] = {
        [FV_RUN_MAP] = run->settings.map_save,      [FV_RUN_RECORDING] = run->recording,
        [FV_RUN_STATS] = run->stats_path,           [FV_RUN_TRAJECTORY] = run->trajectory_path,
        [FV_RUN_FINAL] = run->final_path,           [FV_RUN_PICTURE] = run->picture_path,
        [FV_RUN_DETECTIONS] = run->detections_path, [FV_RUN_OBJECTS] = run->objects_path,
        [FV_RUN_TRUTH] = run->truth_path,           [FV_RUN_GRID] = run->grid_path,
    };
    for (int i = 0; i < FV_RUN_OUTPUT_COUNT; i++) {
        run->outputs[i] = paths[i];
        if (paths[i] != NULL && paths[i][0] != '\0') atomic_fetch_or(&run->unwritten, 1u << i);
    }
}

static void close_all(struct fv_run *run)
{
    fv_web_page_end(run->web_page);
    fv_fast_pose_end(&run->fast_pose);
    fv_recorder_close(run->recorder, NULL);
    fv_recordings_close(&run->recordings);
    fv_transport_close(run->transport);
    fv_backup_close(&run->backup);
    fv_map_loads_close(&run->map_loads);
    fv_parameters_close(&run->parameters);
    fv_requests_close(&run->requests);
    free(run->as_read);
    fv_feed_close(run->feed);
    fv_trajectory_close(run->trajectory);
    fv_trajectory_close(run->truth);
    fv_results_close(run->results, NULL);
    fv_final_close(run->final);
    fv_keeper_close(&run->keeper);
    fv_snapshot_close(&run->snapshot);
    fv_setup_close(&run->setup);
    if (run->memory != NULL) fv_realtime_unmap(run->memory, run->bytes);
    fv_output_discard(&run->stats);
}

/* ---- watching -------------------------------------------------------------------------------- */

static void complaints(struct fv_run *run)
{
    struct fovea_error error;
    while (fv_imu_input_complaint(&run->imu, &error) != FOVEA_AGAIN)
        fv_say("%s", error.text);
    if (run->setup.ops->complaint == NULL) return;
    while (run->setup.ops->complaint(run->setup.source, &error) != FOVEA_AGAIN)
        fv_say("%s", error.text);
}

/* Into the files, each of which may stall. */
static void drain(struct fv_run *run)
{
    int call = fv_stall_enter(run->trajectory_path != NULL ? run->trajectory_path : "a path");
    fv_trajectory_drain(run->trajectory);
    fv_stall_leave(call);
    call = fv_stall_enter(run->truth_path != NULL ? run->truth_path : "the truth");
    fv_trajectory_drain(run->truth);
    fv_stall_leave(call);
    call = fv_stall_enter(run->settings.map_save);
    fv_keeper_tend(&run->keeper);
    fv_stall_leave(call);
    call = fv_stall_enter(run->detections_path != NULL ? run->detections_path
                          : run->objects_path != NULL  ? run->objects_path
                                                       : "results");
    fv_results_drain(run->results);
    fv_stall_leave(call);
    fv_final_drain(run->final);
    fv_recordings_tend(&run->recordings);
}

/* Until the loop has ended: the terminal, what the process looks like. */
static void watch(struct fv_run *run)
{
    const int64_t wait_ns = 250000000;
    const bool terminal = !run->quiet && fv_say_terminal();
    struct fv_run_pace pace = {0};
    int64_t cpu_ns;
    fv_timing_clock(NULL, &pace.wall_ns, &cpu_ns);
    for (;;) {
        atomic_store(&run->shared.resident_bytes, fv_process_resident_bytes());
        fv_run_health_tend(run);
        complaints(run);
        fv_run_changes_say(run);
        drain(run);
        fv_run_reload(run);
        fv_parameters_tend(&run->parameters, false);
        fv_backup_tend(&run->backup);
        fv_map_loads_tend(&run->map_loads);
        fv_web_page_tend(&run->web_page);
        if (fv_thread_take(&run->ended, fv_clock_ns(CLOCK_MONOTONIC) + wait_ns)) break;
        if (terminal) fv_run_status_show(run, &pace);
    }
    if (terminal) fv_say_status("%s", "");
    complaints(run);
    fv_run_changes_say(run);
}

static enum fovea_status run_loop(struct fv_run *run, struct fovea_error *error)
{
    struct fv_realtime_rights rights;
    struct fv_realtime_thread thread;
    struct fv_loop *loop = &run->loop;
    loop->config = &run->settings.runtime;
    loop->ops = run->setup.ops;
    loop->source = run->setup.source;
    loop->frames_max = run->selection.frames;
    loop->timings = &run->timings;
    loop->shared = &run->shared;
    loop->hooks = (struct fv_loop_hooks){run, pace, commands, fv_run_sense, step_done, work_done};
    fv_timings_init(&run->timings);
    if (fv_run_draws(run))
        (void)fv_snapshot_open(
            &run->snapshot,
            loop->ops->info(loop->source)->live ? fv_setup_frame_bytes(&run->setup) : 0,
            run->settings.model[0] != '\0');
    fv_watch_open(&run->watch, run->settings.runtime.odometry.enabled, loop->real_time);
    fv_process_drop_code(); /* and what is used of it from here on stays */
    if (run->settings.lock_memory && run->unlocked.text[0] == '\0' &&
        !fv_realtime_lock_program(&run->unlocked))
        fv_say("fovea run: %s", run->unlocked.text);
    atomic_store(&run->shared.temperature_c, NAN);
    sem_init(&run->ended, 0, 0);

    fv_run_health_open(run);
    enum fovea_status status = loop->ops->start(loop->source, error);
    if (status == FOVEA_OK && run->setup.iio != NULL) status = fv_iio_start(run->setup.iio, error);
    if (status != FOVEA_OK) return status;
    status = fv_realtime_start(&thread, run->settings.priority, run->settings.cpu, loop_body, run,
                               &rights, error);
    if (status != FOVEA_OK) return status;
    if (rights.why.text[0] != '\0') fv_say("fovea run: %s", rights.why.text);
    fv_service_open(&run->service, &run->shared.beats);
    watch(run);
    fv_service_close(&run->service);
    fv_realtime_join(&thread);
    fv_fast_pose_end(&run->fast_pose);
    fv_watch_close(&run->watch); /* the loop's until here */
    fv_run_health_end(run);
    if (loop->status >= 0) return FOVEA_OK;
    (void)fv_source_failed(loop->ops, loop->source, run->settings.source, loop->status, error);
    return FOVEA_ERROR_SYSTEM; /* the run failed, whatever the source's status */
}

/* ---- the command ----------------------------------------------------------------------------- */

int fv_command_run(int argc, char **argv)
{
    static struct fv_run run; /* large, and zeroed */
    struct fovea_error error = {0};
    /* Blocks that are free again before the loop go back to the system: glibc would raise the first
     * limit, and keep 128 KiB by the others. */
    (void)mallopt(M_MMAP_THRESHOLD, 128 << 10);
    (void)mallopt(M_TRIM_THRESHOLD, 4096);
    (void)mallopt(M_TOP_PAD, 0);
    run.stats = FV_OUTPUT_CLOSED;
    enum fv_options_result result = options_read(&run, argc, argv);
    if (result == FV_OPTIONS_HELP) fv_setup_sources_print();
    if (result != FV_OPTIONS_READ) return result == FV_OPTIONS_HELP ? FV_EXIT_OK : FV_EXIT_WRONG;
    enum fovea_status status = settings_read(&run, &error);
    if (status != FOVEA_OK) return (fv_say_failed("%s", error.text), fv_setup_exit(status));
    enum fv_exit end = fv_run_files_check(&run);
    if (end != FV_EXIT_OK) return (fv_web_page_end(run.web_page), end);
    status = fv_run_keep_settings(&run, &error);
    const struct fv_signals signals = {&run.shared.stop, fv_run_lost, &run,
                                       run.as_read != NULL ? &run.reload : NULL};
    if (status == FOVEA_OK) status = fv_signals_watch(&signals, &error);
    if (status == FOVEA_OK) status = open_all(&run, &error);
    fv_signals_opened();
    if (status == FOVEA_OK) {
        outputs_open(&run);
        status = run_loop(&run, &error);
        const int call = fv_stall_enter(run.settings.source);
        fv_velocity_input_end(&run.velocities);
        if (run.setup.ops != NULL) run.setup.ops->stop(run.setup.source);
        fv_stall_leave(call);
    }
    status = fv_run_end_requests(&run, status, &error);
    if (status == FOVEA_OK)
        end = fv_run_report(&run);
    else
        end = (fv_say_failed("%s", error.text), fv_setup_exit(status));
    const enum fv_exit recorded = fv_run_end_recording(&run);
    if (end == FV_EXIT_OK) end = recorded;
    close_all(&run);
    return end;
}

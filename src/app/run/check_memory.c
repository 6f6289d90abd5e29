#include <stdio.h>

#include "app/run/check_memory.h"
#include "app/record/recorder.h"
#include "app/run/realtime.h"
#include "app/run/report.h"
#include "app/run/results.h"
#include "app/run/snapshot.h"
#include "app/run/timing.h"
#include "app/run/trajectory.h"

static void memory_row(const char *owner, const char *part, size_t bytes)
{
    printf("  %-24s %-11s %10zu\n", owner, part, bytes);
}

static struct fv_recorder_setup recorder_setup(const struct fv_check_memory *memory)
{
    return (struct fv_recorder_setup){
        .settings = memory->settings,
        .kernel_set = "",
        .real_time = fv_setup_real_time(memory->settings, memory->setup),
        .frame_bytes = fv_setup_frame_bytes(memory->setup),
    };
}

/* What recording takes, or would take. */
static size_t recorder_bytes(const struct fv_check_memory *memory)
{
    const struct fv_recorder_setup setup = recorder_setup(memory);
    return fv_recorder_bytes(&setup);
}

/* Likewise where record_folder is set: with the state, which is the persistent and the job part. */
static size_t recordings_bytes(const struct fv_check_memory *memory,
                               const size_t parts[FOVEA_MEMORY_PART_COUNT])
{
    const struct fv_recorder_setup setup = recorder_setup(memory);
    return fv_recorder_ring_bytes(&setup) + parts[FOVEA_MEMORY_PERSISTENT] +
           parts[FOVEA_MEMORY_JOB];
}

static size_t masks_bytes(const struct fv_settings *settings)
{
    const struct fovea_rig *rig = &settings->runtime.rig;
    size_t bytes = 0;
    for (uint32_t i = 0; i < rig->camera_count; i++)
        if (rig->cameras[i].mask != NULL)
            bytes += (size_t)rig->cameras[i].camera.width * (size_t)rig->cameras[i].camera.height;
    return bytes;
}

enum fovea_status fv_check_memory_print(const struct fv_check_memory *memory,
                                        struct fovea_error *error)
{
    const struct fv_settings *settings = memory->settings;
    const struct fv_setup *setup = memory->setup;
    struct fovea_memory_table table;
    size_t parts[FOVEA_MEMORY_PART_COUNT];
    const struct fovea_camera *camera = &settings->runtime.rig.cameras[0].camera;
    const size_t masks = masks_bytes(settings);
    enum fovea_status status = fovea_memory(&settings->runtime, &table, error);
    if (status != FOVEA_OK) return status;
    printf("memory of %s, %d x %d, in bytes\n", settings->source, camera->width, camera->height);
    for (uint32_t i = 0; i < table.count; i++)
        memory_row(table.rows[i].owner, fv_report_part_name(table.rows[i].part),
                   table.rows[i].bytes);
    fv_report_parts(&table, parts);
    for (int part = 0; part < FOVEA_MEMORY_PART_COUNT; part++)
        memory_row("all", fv_report_part_name((enum fovea_memory_part)part), parts[part]);
    memory_row("the block", "", memory->block);
    if (setup->source != NULL) memory_row("source", "outside", memory->source);
    if (memory->lcm > 0) memory_row("LCM", "outside", memory->lcm);
    memory_row("timings", "outside", sizeof(struct fv_timings));
    memory_row("trajectory", "outside", fv_trajectory_bytes());
    if (setup->source != NULL)
        memory_row("frame for the picture", "outside",
                   fv_snapshot_bytes(
                       setup->ops->info(setup->source)->live ? fv_setup_frame_bytes(setup) : 0));
    if (setup->model.data != NULL) memory_row("model", "outside", setup->model.bytes);
    if (setup->model2.data != NULL) memory_row("second model", "outside", setup->model2.bytes);
    memory_row("stack of the loop", "outside", FV_THREAD_STACK_BYTES);
    if (setup->source != NULL)
        memory_row("recorder, if recording", "outside", recorder_bytes(memory));
    if (setup->source != NULL && settings->record_folder[0] != '\0')
        memory_row("recordings by command", "outside", recordings_bytes(memory, parts));
    if (masks > 0) memory_row("masks", "outside", masks);
    if (setup->map != NULL)
        memory_row("map, until started", "outside", settings->runtime.map_bytes);
    if (settings->map_save[0] != '\0')
        memory_row("map to be saved", "outside", fovea_map_bytes_max(&settings->runtime));
    if (settings->map_folder[0] != '\0')
        memory_row("map to be loaded", "outside",
                   fovea_map_bytes_max(&settings->runtime) +
                       fovea_map_prepared_bytes(&settings->runtime));
    if (setup->model.data != NULL) memory_row("results, if written", "outside", fv_results_bytes());
    return FOVEA_OK;
}

/* The block: how it is measured, laid out and found again after a copy. */
#include <string.h>

#include "base/hash.h"
#include "message/lockstep.h"
#include "runtime/config.h"
#include "runtime/jobs.h"
#include "runtime/kept_grid.h"
#include "runtime/live.h"

enum { PERSISTENT = FOVEA_MEMORY_PERSISTENT, JOB = FOVEA_MEMORY_JOB, FRAME = FOVEA_MEMORY_FRAME };

void fv_carving_book(struct fv_carving *carving, const char *owner)
{
    struct fovea_memory_table *table = carving->table;
    for (int part = 0; part < FOVEA_MEMORY_PART_COUNT; part++) {
        const size_t from = carving->booked[part], bytes = carving->arenas[part].used - from;
        if (carving->lockstep != NULL)
            fv_lockstep_own(carving->lockstep, owner, (enum fovea_memory_part)part, from, bytes);
        carving->booked[part] = carving->arenas[part].used;
        if (table == NULL || bytes == 0 || table->count >= FOVEA_MEMORY_ROWS_MAX) continue;
        struct fovea_memory_row *row = &table->rows[table->count++];
        memset(row, 0, sizeof *row);
        strncpy(row->owner, owner, sizeof row->owner - 1);
        row->part = (enum fovea_memory_part)part;
        row->bytes = bytes;
    }
}

static void carve_buffer(struct fv_outbox *outbox, enum fv_message_kind kind, size_t capacity,
                         struct fv_arena *arena)
{
    outbox->capacity[kind] = capacity;
    outbox->buffer[kind] = fv_arena_take(arena, capacity, 1);
}

static void carve_network(struct fv_outbox *outbox, const struct fv_detection *detection,
                          int network, struct fv_arena *arena)
{
    for (int i = 0; i < FV_DETECTION_MESSAGE_COUNT; i++) {
        const enum fv_detection_message message = (enum fv_detection_message)i;
        if (fv_detection_sends(detection, message))
            carve_buffer(outbox, fv_detection_kind(message, network),
                         fv_detection_message_bytes(detection, message), arena);
    }
}

static void carve_outbox(struct fovea *rt, struct fv_arena *arena)
{
    struct fv_outbox *outbox = &rt->outbox;
    const uint32_t count_max = rt->config.features.count_max;
    carve_buffer(outbox, FV_MESSAGE_POSE, fv_message_pose_size_max(), arena);
    carve_buffer(outbox, FV_MESSAGE_CAMERA_POSE, fv_message_pose_size_max(), arena);
    carve_buffer(outbox, FV_MESSAGE_BOT_CORE_POSE, fv_message_bot_core_pose_size(), arena);
    carve_buffer(outbox, FV_MESSAGE_FEATURES, fv_message_features_size_max(count_max), arena);
    carve_buffer(outbox, FV_MESSAGE_STATISTICS, fv_message_statistics_size_max(), arena);
    carve_buffer(outbox, FV_MESSAGE_CAMERA_STATUS, fv_message_camera_status_size_max(), arena);
    if (rt->config.rig.has_imu)
        carve_buffer(outbox, FV_MESSAGE_IMU_STATUS, fv_message_imu_status_size_max(), arena);
    if (rt->inertial.enabled)
        carve_buffer(outbox, FV_MESSAGE_POSE_FAST, fv_message_fast_pose_size_max(), arena);
    carve_buffer(outbox, FV_MESSAGE_PREVIEW, fv_message_preview_size_max(rt->preview.jpeg_capacity),
                 arena);
    if (rt->config.edge_job.period_frames > 0)
        carve_buffer(outbox, FV_MESSAGE_EDGES, fv_message_edges_size_max(), arena);
    if (rt->config.calibration.check && rt->config.odometry.enabled)
        carve_buffer(outbox, FV_MESSAGE_CALIBRATION_WARNING, fv_message_calibration_size_max(),
                     arena);
    if (rt->config.grid_job.enabled) {
        const struct fovea_grid_config *grid = &rt->config.grid_job.grid;
        carve_buffer(outbox, FV_MESSAGE_GRID,
                     fv_message_grid_size_max(fv_free_space_rows(grid) * grid->side_cells), arena);
        if (grid->heights)
            carve_buffer(
                outbox, FV_MESSAGE_GRID_HEIGHTS,
                fv_message_heights_size_max(fv_free_space_height_rows(grid) * grid->side_cells),
                arena);
        carve_buffer(outbox, FV_MESSAGE_SCAN, fv_message_scan_size_max(grid->rays), arena);
    }
    if (rt->config.lockstep_every > 0)
        carve_buffer(outbox, FV_MESSAGE_LOCKSTEP, fv_message_lockstep_size_max(), arena);
    carve_network(outbox, &rt->detection2, 1, arena);
    carve_network(outbox, &rt->detection, 0, arena);
    if (fv_detection_sends(&rt->detection, FV_DETECTION_BOXES)) {
        carve_buffer(outbox, FV_MESSAGE_OBJECTS,
                     fv_message_objects_size_max(rt->config.objects.count_max,
                                                 fv_detection_label_bytes(&rt->detection)),
                     arena);
    }
    carve_buffer(outbox, FV_MESSAGE_MAP,
                 rt->config.odometry.enabled ? fv_message_map_size_max() : 0, arena);
    outbox->features_scratch =
        fv_arena_take(arena, fv_message_features_scratch_bytes(count_max), 1);
}

/* A copy of the mask of each camera that has one. */
static void carve_masks(struct fovea *rt, struct fv_arena *arena)
{
    for (uint32_t i = 0; i < rt->config.rig.camera_count; i++) {
        const struct fovea_rig_camera *seen = &rt->config.rig.cameras[i];
        const int32_t width = seen->camera.width, height = seen->camera.height;
        rt->masks[i] = (struct fv_plane){.width = width, .height = height, .stride = width};
        if (seen->mask != NULL)
            rt->masks[i].pixels = fv_arena_take(arena, (size_t)width * (size_t)height, 1);
    }
}

/* What the second camera's images go through, and distances by both cameras. */
static void carve_stereo(struct fovea *rt, struct fv_arena *arenas)
{
    const struct fovea_config *config = &rt->config;
    const struct fovea_rig_camera *first = &config->rig.cameras[0],
                                  *second = &config->rig.cameras[1];
    const uint32_t levels = config->features.pyramid_levels;
    const uint32_t looked_at[FV_VIEWER_COUNT] = {[FV_VIEWER_FEATURES] = levels};
    rt->stereo_used = fv_config_stereo(config);
    if (!rt->stereo_used) return;
    fv_front_end_carve_images(&rt->second_front_end, &config->image.preprocess,
                              config->image.seen_by, looked_at, second->camera.width,
                              second->camera.height, levels, &arenas[FRAME]);
    fv_front_end_carve_features(&rt->second_front_end, &config->features, &arenas[FRAME]);
    fv_front_end_keep_whole_pixels(&rt->second_front_end);
    fv_front_end_carve_descriptors(&rt->second_front_end, &arenas[FRAME]);
    fv_stereo_carve(&rt->stereo, &first->camera, &second->camera, first->T_body_cam,
                    second->T_body_cam, config->features.count_max, &arenas[PERSISTENT],
                    &arenas[FRAME]);
}

/* The images of the first camera, for those who look at them. */
static void carve_images(struct fovea *rt, int32_t width, int32_t height, struct fv_arena *frame)
{
    const struct fovea_config *config = &rt->config;
    const uint32_t levels = config->features.pyramid_levels;
    const uint32_t looked_at[FV_VIEWER_COUNT] = {
        [FV_VIEWER_FEATURES] = levels,
        [FV_VIEWER_NETWORKS] = rt->detection.enabled ? 1 : 0,
        [FV_VIEWER_PREVIEW] = config->preview.period_frames > 0 ? config->preview.level + 1 : 0,
        [FV_VIEWER_EDGES] = config->edge_job.period_frames > 0 ? 1 : 0};
    fv_front_end_carve_images(&rt->front_end, &config->image.preprocess, config->image.seen_by,
                              looked_at, width, height, levels, frame);
}

/* Give every stage and job its pieces, for rt->config, from the arenas of the parts. */
static void carve(struct fovea *rt, struct fv_carving *carving)
{
    const struct fovea_config *config = &rt->config;
    const struct fovea_rig_camera *first = &config->rig.cameras[0];
    const int32_t width = first->camera.width, height = first->camera.height;
    struct fv_arena *arenas = carving->arenas;

    rt->state = fv_arena_take(&arenas[PERSISTENT], 1, sizeof *rt->state);
    fv_carving_book(carving, "runtime");
    carve_masks(rt, &arenas[PERSISTENT]);
    fv_carving_book(carving, "mask");
    if (config->rig.has_imu) {
        fv_imu_gate_carve(&rt->imu, &config->rig.imu, &arenas[PERSISTENT], &arenas[FRAME]);
        fv_carving_book(carving, "imu");
    }
    carve_images(rt, width, height, &arenas[FRAME]);
    fv_carving_book(carving, "pyramid");
    fv_front_end_carve_features(&rt->front_end, &config->features, &arenas[FRAME]);
    fv_carving_book(carving, "features");
    if (config->odometry.enabled) {
        fv_front_end_carve_descriptors(&rt->front_end, &arenas[FRAME]);
        fv_carving_book(carving, "descriptors");
        carve_stereo(rt, arenas);
        fv_carving_book(carving, "stereo");
        rt->inertial.enabled = false;
        if (fv_config_inertial(config)) {
            fv_inertial_stage_carve(&rt->inertial, &config->rig, config->odometry.imu_noise_factor,
                                    config->odometry.gravity_m_s2, &arenas[PERSISTENT]);
            rt->sense = fv_arena_take(&arenas[FRAME], 1, sizeof *rt->sense);
        }
        rt->placed = NULL;
        if (fv_config_inertial(config) && first->has_readout && first->readout_ns > 0)
            rt->placed =
                fv_arena_take(&arenas[FRAME], config->features.count_max, sizeof *rt->placed);
        fv_carving_book(carving, "inertial");
        /* The mask of boxes is used before odometry's step and shares memory with what is taken
         * from here on, none of which outlasts a step. */
        struct fv_arena beneath = arenas[FRAME];
        fv_odometry_carve(&rt->odometry, &config->odometry, &rt->config.rig.cameras[0].camera,
                          config->features.count_max, rt->stereo_used, fv_config_inertial(config),
                          &arenas[PERSISTENT], &arenas[JOB], &arenas[FRAME]);
        fv_carving_book(carving, "odometry");
        fv_scale_carve(&rt->scale, &config->scale, first->T_body_cam, &arenas[PERSISTENT],
                       &arenas[JOB]);
        fv_carving_book(carving, "scale");
        fv_publish_carve(&rt->publish, first->T_body_cam, &arenas[PERSISTENT]);
        fv_relative_carve(&rt->relative, &arenas[PERSISTENT]);
        fv_carving_book(carving, "publish");
        fv_boxes_carve(&rt->boxes, width, height, &arenas[PERSISTENT], &beneath);
        if (beneath.used > arenas[FRAME].used) arenas[FRAME] = beneath;
        fv_carving_book(carving, "boxes");
    }
    fv_jobs_carve(rt, carving);
    carve_outbox(rt, &arenas[FRAME]);
    fv_carving_book(carving, "messages");
}

/* Carve in counting mode: fills part_bytes and block_bytes. */
static enum fovea_status measure(struct fovea *rt, const struct fovea_config *config,
                                 struct fovea_memory_table *table, struct fovea_error *error)
{
    enum fovea_status status = fv_config_check(config, error);
    if (status != FOVEA_OK) return status;
    memset(rt, 0, sizeof *rt);
    rt->config = rt->started = *config;
    const struct fovea_camera *camera = &config->rig.cameras[0].camera;
    status = fv_detection_prepare(&rt->detection, "detect.model", &config->detect, camera, error);
    if (status == FOVEA_OK)
        status =
            fv_detection_prepare(&rt->detection2, "detect2.model", &config->detect2, camera, error);
    if (status != FOVEA_OK) return status;
    fv_live_spread(rt);
    struct fv_carving carving = {.table = table};
    struct fv_arena head;
    for (int part = 0; part < FOVEA_MEMORY_PART_COUNT; part++)
        fv_arena_count(&carving.arenas[part]);
    fv_arena_count(&head);
    fv_arena_take(&head, 1, sizeof *rt);
    if (table != NULL) {
        *table = (struct fovea_memory_table){.count = 1};
        memcpy(table->rows[0].owner, "head", sizeof "head");
        table->rows[0].bytes = head.used;
    }
    carve(rt, &carving);
    rt->block_bytes = head.used;
    for (int part = 0; part < FOVEA_MEMORY_PART_COUNT; part++) {
        if (carving.arenas[part].exhausted)
            return fovea_error_set(error, FOVEA_ERROR_ARGUMENT, "memory: sizes overflow");
        rt->part_bytes[part] = carving.arenas[part].used;
        rt->block_bytes += carving.arenas[part].used;
    }
    return FOVEA_OK;
}

enum fovea_status fovea_size(const struct fovea_config *config, size_t *bytes,
                             struct fovea_error *error)
{
    struct fovea rt;
    if (bytes == NULL)
        return fovea_error_set(error, FOVEA_ERROR_ARGUMENT,
                               "bytes: found NULL, expected a place for the size");
    const enum fovea_status status = measure(&rt, config, NULL, error);
    if (status == FOVEA_OK) *bytes = rt.block_bytes;
    return status;
}

enum fovea_status fovea_memory(const struct fovea_config *config, struct fovea_memory_table *table,
                               struct fovea_error *error)
{
    struct fovea rt;
    struct fovea_memory_table rows;
    if (table == NULL)
        return fovea_error_set(error, FOVEA_ERROR_ARGUMENT,
                               "table: found NULL, expected a place for it");
    const enum fovea_status status = measure(&rt, config, &rows, error);
    if (status == FOVEA_OK) *table = rows;
    return status;
}

/* Point a measured runtime at the block that it stands at the start of. */
static void place(struct fovea *rt, bool keep)
{
    uint8_t *next = (uint8_t *)rt + rt->block_bytes;
    struct fv_carving carving = {.lockstep = &rt->lockstep};
    const struct fovea_config in_force = rt->config;
    for (int part = FOVEA_MEMORY_PART_COUNT - 1; part >= 0; part--) {
        next -= rt->part_bytes[part];
        rt->part_base[part] = next;
        fv_arena_init(&carving.arenas[part], next, rt->part_bytes[part]);
        carving.arenas[part].keep = keep;
    }
    rt->lockstep.part_count = 0;
    rt->config = rt->started; /* sizes are those of the start */
    fv_live_spread(rt);
    carve(rt, &carving);
    rt->config = in_force;
    fv_live_apply(rt);
    for (uint32_t i = 0; keep && i < rt->config.rig.camera_count; i++)
        rt->config.rig.cameras[i].mask = rt->masks[i].pixels;
}

_Static_assert((int)FOVEA_BLOCK_ALIGNMENT == (int)FV_CACHE_LINE_BYTES,
               "what the caller is asked for is what is checked");

/* The map and the grid that its file holds. */
static enum fovea_status load_map(struct fovea *rt, const struct fovea_config *config,
                                  struct fovea_error *error)
{
    struct fv_archive_info info;
    struct fv_archive_grid grid;
    const enum fovea_status status =
        fv_odometry_load(&rt->odometry, &rt->kernels, config->map, config->map_bytes,
                         config->map_name != NULL ? config->map_name : "map", &info, error);
    if (status != FOVEA_OK || !rt->free_space.enabled) return status;
    fv_kept_grid_crop(&info, config->map, config->grid_job.grid.side_cells, &grid,
                      rt->free_space.recall.percent);
    fv_kept_grid_take(&rt->free_space, &grid, rt->free_space.recall.percent);
    return FOVEA_OK;
}

enum fovea_status fovea_init(void *memory, size_t bytes, const struct fovea_config *config,
                             struct fovea **rt, struct fovea_error *error)
{
    struct fovea measured;
    enum fv_cpu_set cpu;
    if (rt == NULL)
        return fovea_error_set(error, FOVEA_ERROR_ARGUMENT,
                               "rt: found NULL, expected a place for the runtime");
    enum fovea_status status = measure(&measured, config, NULL, error);
    if (status == FOVEA_OK)
        status = fv_arena_check_block(memory, bytes, measured.block_bytes, error);
    if (status == FOVEA_OK) status = fv_cpu_from_environment(&cpu, error);
    if (status != FOVEA_OK) return status;

    memset(memory, 0, bytes);
    struct fovea *built = memory;
    *built = measured;
    place(built, false);
    fv_kernels_init(&built->kernels, cpu);
    fv_detection_init(&built->detection, &built->kernels);
    fv_detection_init(&built->detection2, &built->kernels);
    for (uint32_t i = 0; i < config->rig.camera_count; i++) {
        const struct fv_plane *mask = &built->masks[i];
        if (mask->pixels == NULL) continue;
        memcpy(mask->pixels, config->rig.cameras[i].mask,
               (size_t)mask->width * (size_t)mask->height);
        built->config.rig.cameras[i].mask = mask->pixels;
    }
    if (config->odometry.enabled) {
        fv_odometry_init(&built->odometry, config->seed);
        if (built->sense != NULL) fv_sense_init(built->sense);
        if (built->stereo_used) fv_stereo_init(&built->stereo);
        fv_scale_init(&built->scale, config->seed);
        if (built->inertial.enabled) fv_inertial_stage_init(&built->inertial);
        if (config->map != NULL) status = load_map(built, config, error);
        if (status != FOVEA_OK) return status;
    }
    built->config.map = NULL; /* the caller's, and read */
    fv_message_prepare();
    for (int kind = 0; kind < FV_MESSAGE_KIND_COUNT; kind++) {
        fv_message_channel(config->channel_prefix, (enum fv_message_kind)kind,
                           built->outbox.channel[kind]);
    }
    fv_random_seed(&built->state->random, config->seed);
    *rt = built;
    return FOVEA_OK;
}

enum fovea_status fovea_copy(const struct fovea *rt, void *memory, size_t bytes,
                             struct fovea **copy)
{
    const enum fovea_status status = fv_arena_check_block(memory, bytes, rt->block_bytes, NULL);
    if (status != FOVEA_OK) return status;
    memcpy(memory, rt, rt->block_bytes);
    place(memory, true);
    *copy = memory;
    return FOVEA_OK;
}

uint64_t fovea_state_hash(const struct fovea *rt)
{
    const uint64_t hash =
        fv_hash_state(FV_HASH_START, rt->part_base[PERSISTENT], rt->part_bytes[PERSISTENT]);
    return fv_hash_state(hash, rt->part_base[JOB], rt->part_bytes[JOB]);
}

/* ---- the state as bytes ---------------------------------------------------------------------- */

/* Before the persistent and the job part: what lies in neither and still shows in later messages.
 * No padding. */
struct saved {
    uint64_t layout;
    uint64_t persistent_bytes, job_bytes;
    uint64_t distances;
    struct fovea_grants work_grants;
    uint32_t units_done[FOVEA_JOB_COUNT];
};

/* Of who owns which bytes, in this version. */
static uint64_t layout_hash(const struct fovea *rt)
{
    static const char version[] = FOVEA_VERSION;
    uint64_t hash = fv_hash(FV_HASH_START, version, sizeof version);
    for (uint32_t i = 0; i < rt->lockstep.part_count; i++) {
        const struct fv_lockstep_part *part = &rt->lockstep.parts[i];
        const uint64_t place[3] = {(uint64_t)part->part, part->from, part->bytes};
        hash = fv_hash(hash, part->owner, strlen(part->owner));
        hash = fv_hash(hash, place, sizeof place);
    }
    return hash;
}

size_t fovea_state_bytes(const struct fovea *rt)
{
    return sizeof(struct saved) + rt->part_bytes[PERSISTENT] + rt->part_bytes[JOB];
}

void fovea_state_save(const struct fovea *rt, void *data)
{
    struct saved head;
    uint8_t *to = data;
    memset(&head, 0, sizeof head);
    head.layout = layout_hash(rt);
    head.persistent_bytes = rt->part_bytes[PERSISTENT];
    head.job_bytes = rt->part_bytes[JOB];
    head.distances = rt->distances;
    head.work_grants = rt->work_grants;
    memcpy(head.units_done, rt->units_done, sizeof head.units_done);
    memcpy(to, &head, sizeof head);
    memcpy(to + sizeof head, rt->part_base[PERSISTENT], rt->part_bytes[PERSISTENT]);
    memcpy(to + sizeof head + rt->part_bytes[PERSISTENT], rt->part_base[JOB], rt->part_bytes[JOB]);
}

enum fovea_status fovea_state_load(struct fovea *rt, const void *data, size_t bytes,
                                   struct fovea_error *error)
{
    struct saved head;
    const uint8_t *from = data;
    if (bytes != fovea_state_bytes(rt))
        return fovea_error_set(error, FOVEA_ERROR_INPUT, "state: found %zu bytes, expected %zu",
                               bytes, fovea_state_bytes(rt));
    memcpy(&head, from, sizeof head);
    if (head.layout != layout_hash(rt) || head.persistent_bytes != rt->part_bytes[PERSISTENT] ||
        head.job_bytes != rt->part_bytes[JOB])
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "state: found that of another version or configuration, expected "
                               "one of version %s with this configuration",
                               FOVEA_VERSION);
    rt->distances = (uint32_t)head.distances;
    rt->work_grants = head.work_grants;
    memcpy(rt->units_done, head.units_done, sizeof head.units_done);
    memcpy(rt->part_base[PERSISTENT], from + sizeof head, rt->part_bytes[PERSISTENT]);
    memcpy(rt->part_base[JOB], from + sizeof head + rt->part_bytes[PERSISTENT],
           rt->part_bytes[JOB]);
    return FOVEA_OK;
}

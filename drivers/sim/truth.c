#include "sim.h"

#include <string.h>

/* Exact truth of a frame, traced anew at pixel centres with the frame's own geometry. With a
 * rolling shutter, maps and boxes follow the rows, pose and unoccluded sizes belong to the stamp.
 */

enum { GRID = 64 }; /* samples per side where an object reaches out of the image */
static const float aside =
    6.0f; /* normalised coordinates beyond this count as out of any lens's field */

struct tally {
    int32_t visible, x_min, y_min, x_max, y_max;
};

/* ---- maps ------------------------------------------------------------------------------------ */

static void trace_tile(struct fovea_source *source, int32_t tile, const uint16_t *list,
                       int32_t count, int32_t y_begin, int32_t y_end)
{
    const struct fv_sim_raster *raster = &source->raster;
    const int32_t tx = tile % raster->tiles_x * FV_SIM_TILE,
                  ty = tile / raster->tiles_x * FV_SIM_TILE;
    float inverse_z[FV_SIM_TILE_PIXELS];
    int32_t hit[FV_SIM_TILE_PIXELS];
    const size_t first = (size_t)tile * FV_SIM_TILE_PIXELS;
    fv_sim_trace(&source->scene, list, count, raster->x + first, raster->y + first,
                 FV_SIM_TILE_PIXELS, inverse_z, hit);
    for (int32_t i = 0; i < FV_SIM_TILE_PIXELS; i++) {
        const int32_t x = tx + i % FV_SIM_TILE, y = ty + i / FV_SIM_TILE;
        if (x >= raster->width || y < y_begin || y >= y_end) continue;
        const size_t at = (size_t)y * (size_t)raster->width + (size_t)x;
        const struct fv_sim_surface *seen =
            hit[i] < 0 ? NULL : &source->scene.surface[list[hit[i]]];
        const int32_t object = seen == NULL ? 0 : seen->object;
        source->depth_m[at] = hit[i] < 0 ? 0.0f : 1.0f / inverse_z[i];
        source->object_map[at] = (uint8_t)object;
        source->class_mask[at] = object > 0 ? (uint8_t)source->world.object[object - 1].object_class
                                 : seen != NULL ? seen->truth_class
                                                : (uint8_t)FOVEA_TRUTH_BACKGROUND;
    }
}

static void trace_image(struct fovea_source *source, double time_s)
{
    const struct fv_sim_raster *raster = &source->raster;
    const int32_t height = raster->height, band = fv_sim_band_rows(source);
    uint16_t list[FV_SIM_SURFACES_MAX];
    bool covered;
    for (int32_t y = 0; y < height; y += band) {
        const int32_t end = y + band < height ? y + band : height;
        fv_sim_set_scene(source, time_s + fv_sim_row_delay(source, y, end), y, end);
        for (int32_t ty = y / FV_SIM_TILE; ty * FV_SIM_TILE < end; ty++) {
            for (int32_t tx = 0; tx < raster->tiles_x; tx++) {
                const int32_t tile = ty * raster->tiles_x + tx;
                const int32_t count = fv_sim_scene_cull(&source->scene, NULL, 0,
                                                        &raster->bound[tile], list, &covered);
                trace_tile(source, tile, list, count, y, end);
            }
        }
    }
}

static void tally_objects(const struct fovea_source *source, struct tally *tally)
{
    const int32_t width = source->raster.width, height = source->raster.height;
    for (int32_t i = 0; i <= FV_SIM_OBJECTS_MAX; i++)
        tally[i] = (struct tally){0, width, height, 0, 0};
    for (int32_t y = 0; y < height; y++) {
        for (int32_t x = 0; x < width; x++) {
            struct tally *t = &tally[source->object_map[(size_t)y * (size_t)width + (size_t)x]];
            t->visible++;
            if (x < t->x_min) t->x_min = x;
            if (x + 1 > t->x_max) t->x_max = x + 1;
            if (y < t->y_min) t->y_min = y;
            t->y_max = y + 1;
        }
    }
}

/* ---- size of an object if nothing hid it and the image were larger --------------------------- */

struct alone {
    uint16_t list[16];
    int32_t count;
    struct fv_sim_rect bound;
};

static void find_surfaces(const struct fv_sim_scene *scene, int32_t object, struct alone *alone)
{
    *alone = (struct alone){.bound = {aside, -aside, aside, -aside}};
    for (int32_t i = 0; i < scene->surface_count && alone->count < 16; i++) {
        const struct fv_sim_surface *s = &scene->surface[i];
        if (s->object != object) continue;
        alone->list[alone->count++] = (uint16_t)i;
        alone->bound.x_min = s->x_min < alone->bound.x_min ? s->x_min : alone->bound.x_min;
        alone->bound.x_max = s->x_max > alone->bound.x_max ? s->x_max : alone->bound.x_max;
        alone->bound.y_min = s->y_min < alone->bound.y_min ? s->y_min : alone->bound.y_min;
        alone->bound.y_max = s->y_max > alone->bound.y_max ? s->y_max : alone->bound.y_max;
    }
    if (alone->bound.x_min < -aside) alone->bound.x_min = -aside;
    if (alone->bound.x_max > aside) alone->bound.x_max = aside;
    if (alone->bound.y_min < -aside) alone->bound.y_min = -aside;
    if (alone->bound.y_max > aside) alone->bound.y_max = aside;
}

/* Pixels of the image that it would fill. */
static int32_t pixels_inside(const struct fovea_source *source, const struct alone *alone)
{
    const struct fv_sim_raster *raster = &source->raster;
    float inverse_z[FV_SIM_TILE_PIXELS];
    int32_t hit[FV_SIM_TILE_PIXELS], sum = 0;
    for (int32_t tile = 0; tile < raster->tiles_x * raster->tiles_y; tile++) {
        const struct fv_sim_rect *b = &raster->bound[tile];
        if (b->x_min > alone->bound.x_max || b->x_max < alone->bound.x_min ||
            b->y_min > alone->bound.y_max || b->y_max < alone->bound.y_min)
            continue;
        const int32_t tx = tile % raster->tiles_x * FV_SIM_TILE,
                      ty = tile / raster->tiles_x * FV_SIM_TILE;
        const size_t first = (size_t)tile * FV_SIM_TILE_PIXELS;
        fv_sim_trace(&source->scene, alone->list, alone->count, raster->x + first,
                     raster->y + first, FV_SIM_TILE_PIXELS, inverse_z, hit);
        for (int32_t i = 0; i < FV_SIM_TILE_PIXELS; i++)
            sum += hit[i] >= 0 && tx + i % FV_SIM_TILE < raster->width &&
                   ty + i / FV_SIM_TILE < raster->height;
    }
    return sum;
}

/* Pixels beside the image that it would fill, by sampling its bounds in the normalised plane. */
static double pixels_outside(const struct fovea_source *source, const struct alone *alone)
{
    const struct fovea_camera *camera = &source->info.rig.cameras[0].camera;
    const double step_x = ((double)alone->bound.x_max - (double)alone->bound.x_min) / GRID;
    const double step_y = ((double)alone->bound.y_max - (double)alone->bound.y_min) / GRID;
    float x[GRID], y[GRID], inverse_z[GRID];
    int32_t hit[GRID];
    double sum = 0.0;
    for (int32_t r = 0; r < GRID; r++) {
        for (int32_t c = 0; c < GRID; c++) {
            x[c] = (float)((double)alone->bound.x_min + (c + 0.5) * step_x);
            y[c] = (float)((double)alone->bound.y_min + (r + 0.5) * step_y);
        }
        fv_sim_trace(&source->scene, alone->list, alone->count, x, y, GRID, inverse_z, hit);
        for (int32_t c = 0; c < GRID; c++) {
            double pixel[2], j[6];
            if (hit[c] < 0) continue;
            if (fovea_camera_project(camera, (const double[3]){(double)x[c], (double)y[c], 1.0},
                                     pixel, j) != FOVEA_OK)
                continue;
            const bool inside = pixel[0] >= -0.5 && pixel[0] < camera->width - 0.5 &&
                                pixel[1] >= -0.5 && pixel[1] < camera->height - 0.5;
            const double det = j[0] * j[4] - j[1] * j[3];
            if (!inside && det > 0.0) sum += det * step_x * step_y;
        }
    }
    return sum;
}

static float visible_fraction(const struct fovea_source *source, int32_t object, int32_t visible)
{
    struct alone alone;
    find_surfaces(&source->scene, object, &alone);
    const int32_t inside = pixels_inside(source, &alone);
    const double whole = inside + pixels_outside(source, &alone);
    return visible >= whole ? 1.0f : (float)(visible / whole);
}

/* ---- all of it ------------------------------------------------------------------------------- */

enum fovea_status fv_sim_truth(struct fovea_source *source, const struct fovea_frame *frame,
                               struct fovea_truth *truth)
{
    struct tally tally[FV_SIM_OBJECTS_MAX + 1];
    if (frame->slot >= FOVEA_SOURCE_FRAMES_HELD_MAX || !source->held[frame->slot])
        return FOVEA_ERROR_ARGUMENT;
    const double time_s = fv_sim_frame_time(source, source->image_index[frame->slot]);
    trace_image(source, time_s);
    tally_objects(source, tally);
    /* All that is anywhere in front, not only in the image, for the unoccluded sizes. */
    const struct fv_sim_rect everywhere = {-aside, aside, -aside, aside};
    truth->has_pose = true;
    fv_sim_world_place(&source->world, time_s);
    fv_sim_motion_pose(&source->motion, time_s, truth->T_world_cam);
    fv_sim_scene_set(&source->scene, &source->world, truth->T_world_cam, &everywhere);
    truth->box_count = 0;
    for (int32_t i = 0; i < source->world.object_count; i++) {
        const struct tally *t = &tally[i + 1];
        if (t->visible == 0 || truth->box_count == FOVEA_TRUTH_BOXES_MAX) continue;
        truth->boxes[truth->box_count++] = (struct fovea_truth_box){
            .id = (uint32_t)(i + 1),
            .object_class = source->world.object[i].object_class,
            .x_min_px = (float)t->x_min,
            .y_min_px = (float)t->y_min,
            .x_max_px = (float)t->x_max,
            .y_max_px = (float)t->y_max,
            .visible_fraction = visible_fraction(source, i + 1, t->visible),
        };
    }
    truth->depth_m = source->depth_m;
    truth->class_mask = source->class_mask;
    return FOVEA_OK;
}

enum fovea_status fv_sim_truth_pose(struct fovea_source *source, const struct fovea_frame *frame,
                                    double T_world_cam[12])
{
    if (frame->slot >= FOVEA_SOURCE_FRAMES_HELD_MAX || !source->held[frame->slot])
        return FOVEA_ERROR_ARGUMENT;
    fv_sim_motion_pose(&source->motion, fv_sim_frame_time(source, source->image_index[frame->slot]),
                       T_world_cam);
    return FOVEA_OK;
}

#include "web/foxglove_make.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "drivers/clock.h"

#include "fovea_detections_t.h"
#include "fovea_features_t.h"
#include "fovea_grid_t.h"
#include "fovea_keypoints_t.h"
#include "fovea_map_t.h"
#include "fovea_objects_t.h"
#include "fovea_preview_t.h"

/* Numbers of fields are those of foxglove_schemas.c. */
enum {
    LEVEL_INFO = 2,
    LEVEL_WARNING = 3,
    KIND_POINTS = 1,
    KIND_LINE_LOOP = 2,
    NUMBER_INT8 = 2,
    NUMBER_FLOAT32 = 7,
    POINT_BYTES = 12
};
#define HALF 0.5 /* from the centre of a pixel to its corner */

static const double colours[][3] = {{0.90, 0.29, 0.24}, {0.18, 0.55, 0.85}, {0.20, 0.68, 0.38},
                                    {0.95, 0.61, 0.07}, {0.61, 0.35, 0.71}, {0.10, 0.74, 0.71}};
enum { COLOURS = sizeof colours / sizeof colours[0], GREEN = 2 };

static const double *colour_of(int64_t number)
{
    return colours[(number % COLOURS + COLOURS) % COLOURS];
}

int64_t fv_foxglove_make_time(const fovea_stamp_t *stamp)
{
    const int64_t sum_ns = (int64_t)((uint64_t)stamp->time_ns + (uint64_t)stamp->utc_offset_ns);
    return sum_ns > 0 ? sum_ns : 0;
}

static void put_time(struct fv_protobuf *to, uint32_t field, int64_t time_ns)
{
    const size_t begun = fv_protobuf_begin(to, field);
    fv_protobuf_number(to, 1, (uint64_t)(time_ns / FV_SECOND_NS));
    fv_protobuf_number(to, 2, (uint64_t)(time_ns % FV_SECOND_NS));
    fv_protobuf_end(to, begun);
}

/* ---- places ---------------------------------------------------------------------------------- */

/* v rotated by the unit quaternion w x y z. */
static void rotate(const double q[4], const double v[3], double to[3])
{
    const double w = q[0], x = q[1], y = q[2], z = q[3];
    const double tx = 2 * (y * v[2] - z * v[1]), ty = 2 * (z * v[0] - x * v[2]),
                 tz = 2 * (x * v[1] - y * v[0]);
    to[0] = v[0] + w * tx + y * tz - z * ty;
    to[1] = v[1] + w * ty + z * tx - x * tz;
    to[2] = v[2] + w * tz + x * ty - y * tx;
}

static void multiply(const double p[4], const double q[4], double to[4])
{
    to[0] = p[0] * q[0] - p[1] * q[1] - p[2] * q[2] - p[3] * q[3];
    to[1] = p[0] * q[1] + p[1] * q[0] + p[2] * q[3] - p[3] * q[2];
    to[2] = p[0] * q[2] - p[1] * q[3] + p[2] * q[0] + p[3] * q[1];
    to[3] = p[0] * q[3] + p[1] * q[2] - p[2] * q[1] + p[3] * q[0];
}

/* scale R(orientation) point + position */
static void similar(double scale, const double position[3], const double orientation[4],
                    const double point[3], double to[3])
{
    double turned[3];
    rotate(orientation, point, turned);
    for (int i = 0; i < 3; i++)
        to[i] = scale * turned[i] + position[i];
}

static bool is_finite(const double *values, int count)
{
    for (int i = 0; i < count; i++)
        if (!isfinite(values[i])) return false;
    return true;
}

bool fv_foxglove_make_known(const fovea_pose_t *pose)
{
    return pose->map_id >= 0 && is_finite(pose->position, 3) && is_finite(pose->map_position, 3) &&
           isfinite(pose->map_scale);
}

static void put_vector(struct fv_protobuf *to, uint32_t field, const double *v, int count)
{
    const size_t begun = fv_protobuf_begin(to, field);
    for (int i = 0; i < count; i++)
        fv_protobuf_double(to, (uint32_t)i + 1, v[i]);
    fv_protobuf_end(to, begun);
}

/* Of w x y z; the schema has w last. */
static void put_quaternion(struct fv_protobuf *to, uint32_t field, const double q[4])
{
    put_vector(to, field, (const double[]){q[1], q[2], q[3], q[0]}, 4);
}

static void put_pose(struct fv_protobuf *to, uint32_t field, const double position[3],
                     const double orientation[4])
{
    const size_t begun = fv_protobuf_begin(to, field);
    put_vector(to, 1, position, 3);
    put_quaternion(to, 2, orientation);
    fv_protobuf_end(to, begun);
}

static void place_of(const fovea_pose_t *pose, double position[3], double orientation[4])
{
    similar(pose->map_scale, pose->map_position, pose->map_orientation, pose->position, position);
    multiply(pose->map_orientation, pose->orientation, orientation);
}

void fv_foxglove_make_pose(const struct fv_foxglove_views *views, const uint8_t *data, size_t bytes,
                           struct fv_protobuf *to)
{
    fovea_pose_t pose;
    double position[3], orientation[4];
    (void)views;
    if (fovea_pose_t_decode(data, 0, (int)bytes, &pose) < 0) return;
    place_of(&pose, position, orientation);
    put_time(to, 1, fv_foxglove_make_time(&pose.stamp));
    fv_protobuf_text(to, 2, "map");
    put_pose(to, 3, position, orientation);
    fovea_pose_t_decode_cleanup(&pose);
}

void fv_foxglove_make_transforms(const struct fv_foxglove_views *views, const uint8_t *data,
                                 size_t bytes, struct fv_protobuf *to)
{
    fovea_pose_t pose;
    double position[3], orientation[4];
    (void)views;
    if (fovea_pose_t_decode(data, 0, (int)bytes, &pose) < 0) return;
    place_of(&pose, position, orientation);
    const size_t begun = fv_protobuf_begin(to, 1);
    put_time(to, 1, fv_foxglove_make_time(&pose.stamp));
    fv_protobuf_text(to, 2, "map");
    fv_protobuf_text(to, 3, pose.child_frame);
    put_vector(to, 4, position, 3);
    put_quaternion(to, 5, orientation);
    fv_protobuf_end(to, begun);
    fovea_pose_t_decode_cleanup(&pose);
}

/* ---- map and grid ---------------------------------------------------------------------------- */

static void put_element(struct fv_protobuf *to, uint32_t field, const char *name, uint32_t offset,
                        uint32_t type)
{
    const size_t begun = fv_protobuf_begin(to, field);
    fv_protobuf_text(to, 1, name);
    fv_protobuf_fixed32(to, 2, offset);
    fv_protobuf_number(to, 3, type);
    fv_protobuf_end(to, begun);
}

/* The landmark in the frame `map`; whether it belongs there. */
static bool landmark_place(const struct fv_foxglove_landmark *landmark, const fovea_map_t *map,
                           double place[3])
{
    const double p[3] = {(double)landmark->p[0], (double)landmark->p[1], (double)landmark->p[2]};
    if (landmark->map != map->map_id) return false;
    similar(map->own_scale, map->own_position, map->own_orientation, p, place);
    return is_finite(place, 3);
}

static void put_landmark(struct fv_protobuf *to, const double place[3])
{
    for (int i = 0; i < 3; i++)
        fv_protobuf_more_float(to, (float)place[i]);
}

void fv_foxglove_make_map(const struct fv_foxglove_views *views, const uint8_t *data, size_t bytes,
                          struct fv_protobuf *to)
{
    static const double upright[4] = {1, 0, 0, 0};
    fovea_map_t map;
    double place[3];
    size_t count = 0;
    if (fovea_map_t_decode(data, 0, (int)bytes, &map) < 0) return;
    put_time(to, 1, fv_foxglove_make_time(&map.stamp));
    fv_protobuf_text(to, 2, "map");
    const size_t pose = fv_protobuf_begin(to, 3);
    put_quaternion(to, 2, upright);
    fv_protobuf_end(to, pose);
    fv_protobuf_fixed32(to, 4, POINT_BYTES);
    put_element(to, 5, "x", 0, NUMBER_FLOAT32);
    put_element(to, 5, "y", 4, NUMBER_FLOAT32);
    put_element(to, 5, "z", 8, NUMBER_FLOAT32);
    for (int32_t slot = 0; slot < views->landmark_slots; slot++)
        count += landmark_place(&views->landmarks[slot], &map, place);
    if (count > 0) fv_protobuf_head(to, 6, count * POINT_BYTES);
    for (int32_t slot = 0; slot < views->landmark_slots; slot++)
        if (landmark_place(&views->landmarks[slot], &map, place)) put_landmark(to, place);
    fovea_map_t_decode_cleanup(&map);
}

void fv_foxglove_make_grid(const struct fv_foxglove_views *views, const uint8_t *data, size_t bytes,
                           struct fv_protobuf *to)
{
    fovea_grid_t grid;
    double position[3], orientation[4];
    if (fovea_grid_t_decode(data, 0, (int)bytes, &grid) < 0) return;
    const double side = views->to_map.scale * grid.resolution_m;
    similar(views->to_map.scale, views->to_map.position, views->to_map.orientation,
            grid.origin_position, position);
    multiply(views->to_map.orientation, grid.origin_orientation, orientation);
    put_time(to, 1, fv_foxglove_make_time(&grid.stamp));
    fv_protobuf_text(to, 2, "map");
    put_pose(to, 3, position, orientation);
    fv_protobuf_fixed32(to, 4, (uint32_t)views->cells_wide);
    put_vector(to, 5, (const double[]){side, side}, 2);
    fv_protobuf_fixed32(to, 6, (uint32_t)views->cells_wide);
    fv_protobuf_fixed32(to, 7, 1);
    put_element(to, 8, "occupancy", 0, NUMBER_INT8);
    fv_protobuf_bytes(to, 9, (const uint8_t *)views->cells,
                      (size_t)views->cells_wide * (size_t)views->cells_high);
    fovea_grid_t_decode_cleanup(&grid);
}

/* ---- annotations of pictures ----------------------------------------------------------------- */

static void put_colour(struct fv_protobuf *to, uint32_t field, const double colour[3], double alpha)
{
    put_vector(to, field, (const double[]){colour[0], colour[1], colour[2], alpha}, 4);
}

static void put_point(struct fv_protobuf *to, uint32_t field, double x, double y)
{
    put_vector(to, field, (const double[]){x + HALF, y + HALF}, 2);
}

/* Points of PointsAnnotation between these two. */
static size_t points_begin(struct fv_protobuf *to, int64_t time_ns, uint32_t kind)
{
    const size_t begun = fv_protobuf_begin(to, 2);
    put_time(to, 1, time_ns);
    fv_protobuf_number(to, 2, kind);
    return begun;
}

static void points_end(struct fv_protobuf *to, size_t begun, const double colour[3])
{
    put_colour(to, 4, colour, 1);
    fv_protobuf_double(to, 7, 2); /* thickness */
    fv_protobuf_end(to, begun);
}

static void put_label(struct fv_protobuf *to, double x, double y, const char *text, int64_t time_ns,
                      const double colour[3])
{
    static const double white[3] = {1, 1, 1};
    const size_t begun = fv_protobuf_begin(to, 3);
    put_time(to, 1, time_ns);
    put_point(to, 2, x, y);
    fv_protobuf_text(to, 3, text);
    fv_protobuf_double(to, 4, 14); /* size of the letters */
    put_colour(to, 5, white, 1);
    put_colour(to, 6, colour, 0.8);
    fv_protobuf_end(to, begun);
}

/* The corners of a box that is turned by an angle about its centre. */
static void corners(const fovea_box_t *box, double angle, double to[4][2])
{
    static const double signs[4][2] = {{-1, -1}, {1, -1}, {1, 1}, {-1, 1}};
    const double x_min = (double)box->x_min_px, x_max = (double)box->x_max_px,
                 y_min = (double)box->y_min_px, y_max = (double)box->y_max_px;
    const double x = (x_min + x_max) / 2, y = (y_min + y_max) / 2;
    const double w = (x_max - x_min) / 2, h = (y_max - y_min) / 2;
    const double c = cos(angle), s = sin(angle);
    for (int i = 0; i < 4; i++) {
        const double dx = signs[i][0] * w, dy = signs[i][1] * h;
        to[i][0] = x + c * dx - s * dy;
        to[i][1] = y + s * dx + c * dy;
    }
}

/* Outlines are field 2 and labels field 3 of the message: each is written in a round of its own. */
static void put_box(struct fv_protobuf *to, const fovea_box_t *box, double angle, int64_t time_ns,
                    const double colour[3])
{
    double found[4][2];
    corners(box, angle, found);
    const size_t begun = points_begin(to, time_ns, KIND_LINE_LOOP);
    for (int i = 0; i < 4; i++)
        put_point(to, 3, found[i][0], found[i][1]);
    points_end(to, begun, colour);
}

static void put_box_label(struct fv_protobuf *to, const fovea_box_t *box, double angle,
                          const char *text, int64_t time_ns, const double colour[3])
{
    double found[4][2];
    corners(box, angle, found);
    put_label(to, found[0][0], found[0][1], text, time_ns, colour);
}

static void put_dots(struct fv_protobuf *to, float *const *p_px, int32_t count, int64_t time_ns,
                     const double colour[3])
{
    const size_t begun = points_begin(to, time_ns, KIND_POINTS);
    for (int32_t i = 0; i < count; i++)
        put_point(to, 3, (double)p_px[i][0], (double)p_px[i][1]);
    points_end(to, begun, colour);
}

void fv_foxglove_make_features(const struct fv_foxglove_views *views, const uint8_t *data,
                               size_t bytes, struct fv_protobuf *to)
{
    fovea_features_t features;
    (void)views;
    if (fovea_features_t_decode(data, 0, (int)bytes, &features) < 0) return;
    put_dots(to, features.p_px, features.count, fv_foxglove_make_time(&features.stamp),
             colours[GREEN]);
    fovea_features_t_decode_cleanup(&features);
}

void fv_foxglove_make_detections(const struct fv_foxglove_views *views, const uint8_t *data,
                                 size_t bytes, struct fv_protobuf *to)
{
    fovea_detections_t all;
    char name[16], text[128];
    (void)views;
    if (fovea_detections_t_decode(data, 0, (int)bytes, &all) < 0) return;
    const int64_t time_ns = fv_foxglove_make_time(&all.stamp);
    for (int32_t i = 0; i < all.count; i++)
        put_box(to, &all.detections[i].box, (double)all.detections[i].angle, time_ns,
                colour_of(all.detections[i].class_id));
    for (int32_t i = 0; i < all.count; i++) {
        const fovea_detection_t *one = &all.detections[i];
        snprintf(name, sizeof name, "%d", one->class_id);
        snprintf(text, sizeof text, "%.63s %.2f",
                 one->class_name[0] != '\0' ? one->class_name : name, (double)one->score);
        put_box_label(to, &one->box, (double)one->angle, text, time_ns, colour_of(one->class_id));
    }
    fovea_detections_t_decode_cleanup(&all);
}

void fv_foxglove_make_objects(const struct fv_foxglove_views *views, const uint8_t *data,
                              size_t bytes, struct fv_protobuf *to)
{
    fovea_objects_t all;
    char name[16], text[128];
    (void)views;
    if (fovea_objects_t_decode(data, 0, (int)bytes, &all) < 0) return;
    const int64_t time_ns = fv_foxglove_make_time(&all.stamp);
    for (int32_t i = 0; i < all.count; i++)
        put_box(to, &all.objects[i].box, 0, time_ns, colour_of(all.objects[i].id));
    for (int32_t i = 0; i < all.count; i++) {
        const fovea_object_t *one = &all.objects[i];
        snprintf(name, sizeof name, "%d", one->class_id);
        snprintf(text, sizeof text, "%.63s %lld",
                 one->class_name[0] != '\0' ? one->class_name : name, (long long)one->id);
        put_box_label(to, &one->box, 0, text, time_ns, colour_of(one->id));
    }
    fovea_objects_t_decode_cleanup(&all);
}

void fv_foxglove_make_keypoints(const struct fv_foxglove_views *views, const uint8_t *data,
                                size_t bytes, struct fv_protobuf *to)
{
    fovea_keypoints_t all;
    (void)views;
    if (fovea_keypoints_t_decode(data, 0, (int)bytes, &all) < 0) return;
    for (int32_t i = 0; i < all.count; i++)
        put_dots(to, all.sets[i].p_px, all.sets[i].point_count, fv_foxglove_make_time(&all.stamp),
                 colour_of(i));
    fovea_keypoints_t_decode_cleanup(&all);
}

/* ---- pictures and lines ---------------------------------------------------------------------- */

void fv_foxglove_make_image(int64_t time_ns, int32_t camera, const uint8_t *jpeg, size_t bytes,
                            struct fv_protobuf *to)
{
    char frame[16];
    snprintf(frame, sizeof frame, "cam%d", camera);
    put_time(to, 1, time_ns);
    fv_protobuf_bytes(to, 2, jpeg, bytes);
    fv_protobuf_text(to, 3, "jpeg");
    fv_protobuf_text(to, 4, frame);
}

void fv_foxglove_make_preview(const struct fv_foxglove_views *views, const uint8_t *data,
                              size_t bytes, struct fv_protobuf *to)
{
    fovea_preview_t preview;
    (void)views;
    if (fovea_preview_t_decode(data, 0, (int)bytes, &preview) < 0) return;
    fv_foxglove_make_image(fv_foxglove_make_time(&preview.stamp), preview.camera, preview.jpeg,
                           (size_t)preview.size_bytes, to);
    fovea_preview_t_decode_cleanup(&preview);
}

void fv_foxglove_make_log(int64_t time_ns, bool bad, const char *who, const char *text,
                          struct fv_protobuf *to)
{
    put_time(to, 1, time_ns);
    fv_protobuf_number(to, 2, bad ? LEVEL_WARNING : LEVEL_INFO);
    fv_protobuf_text(to, 3, text);
    fv_protobuf_text(to, 4, who);
}

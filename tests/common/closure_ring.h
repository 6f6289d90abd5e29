/* A synthetic ring for tests of closures: points with random descriptors, keyframes whose estimated
 * poses drift in place, direction and scale, and see the first points again as new landmarks when
 * they come round. For one file of a program. */
#ifndef FOVEA_TESTS_COMMON_CLOSURE_RING_H
#define FOVEA_TESTS_COMMON_CLOSURE_RING_H

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
/* cmocka needs the above */
#include <cmocka.h>

#include "common/carved.h"
#include "geometry/vec.h"
#include "map/closure.h"

enum { RING = 60, KEYFRAMES = 67, POINTS = 5000, FEATURES = 260, REMEMBERED = 6 };

struct world {
    struct fv_kernels kernels;
    struct fovea_camera camera;
    struct fv_bearing_table bearings;
    struct fv_map map;
    struct fv_place place;
    struct fv_closure closure;
    void *memory;
    struct fv_random random;
    double point[POINTS][3];
    uint8_t descriptor[POINTS][32];
    int32_t landmark_of[POINTS]; /* newest */
    uint32_t seen_by[POINTS];    /* number of the keyframe that saw it last */
    struct fv_sim3 drift;        /* takes the true world to the estimated one, now */
    struct fv_se3 truth[KEYFRAMES];
    uint32_t slot[KEYFRAMES];
    uint32_t count;
    bool vague;     /* seen is only what lies ahead, in coarse features */
    double step[7]; /* of the drift, with each keyframe */
};
static struct world w;
static bool measures;            /* distances, in the world that is made next */
static const double ahead = 0.3; /* half the width and height of what lies ahead, at distance 1 */

static inline void carve(void *context, struct fv_arena *arena)
{
    (void)context;
    const struct fv_map_limits limits = {80, 16000, FEATURES, 640, 480, measures};
    fv_bearing_carve(&w.bearings, limits.width, limits.height, arena);
    fv_map_carve(&w.map, &limits, &w.camera, &w.bearings, arena);
    fv_place_carve(&w.place, limits.keyframes, arena);
    fv_closure_carve(&w.closure, &limits, arena, arena);
}

static inline double uniform(double low, double high)
{
    return low + (high - low) * fv_random_unit(&w.random);
}

static inline void make_world(uint64_t seed)
{
    static const double step[7] = {0.002, 0.001, -0.002, 0.0003, 0.0015, 0, 0.0015};
    memset(&w, 0, sizeof w);
    memcpy(w.step, step, sizeof w.step);
    struct fovea_error error;
    w.camera = (struct fovea_camera){.width = 640,
                                     .height = 480,
                                     .lens = FOVEA_LENS_RADTAN,
                                     .fx = 400,
                                     .fy = 400,
                                     .cx = 320,
                                     .cy = 240};
    assert_int_equal(fovea_camera_prepare(&w.camera, &error), FOVEA_OK);
    fv_kernels_init(&w.kernels, FV_CPU_C);
    w.memory = carved(carve, NULL);
    fv_bearing_init(&w.bearings, &w.camera);
    fv_map_reset(&w.map);
    fv_place_clear(&w.place);
    fv_closure_reset(&w.closure, seed);
    fv_random_seed(&w.random, seed);
    fv_sim3_identity(&w.drift);
    for (int i = 0; i < POINTS; i++) { /* on both sides of a round corridor of radius 10 */
        double angle = uniform(0, 6.283185),
               radius = uniform(0, 1) < 0.5 ? uniform(8, 9) : uniform(11, 12);
        const double p[3] = {radius * fv_cos(angle), uniform(-1, 1), radius * fv_sin(angle)};
        fv_copy3(p, w.point[i]);
        for (int k = 0; k < 32; k++)
            w.descriptor[i][k] = (uint8_t)fv_random_u32(&w.random);
        w.landmark_of[i] = FV_MAP_NONE;
    }
}

/* The n-th place: on the ring, looking along it. */
static inline void true_pose(uint32_t n, struct fv_se3 *T_cam_world)
{
    double angle = 6.283185307 * n / RING;
    const double z[3] = {-fv_sin(angle), 0, fv_cos(angle)}, y[3] = {0, -1, 0},
                 centre[3] = {10 * fv_cos(angle), 0, 10 * fv_sin(angle)};
    double x[3], t[3];
    fv_cross3(y, z, x);
    fv_copy3(x, T_cam_world->R);
    fv_copy3(y, T_cam_world->R + 3);
    fv_copy3(z, T_cam_world->R + 6);
    fv_rotate3(T_cam_world->R, centre, t);
    for (int k = 0; k < 3; k++)
        T_cam_world->t[k] = -t[k];
}

/* A feature of point i, with some bits of its descriptor wrong. */
static inline void fill_feature(struct fovea_feature *feature, uint8_t *descriptor, int i,
                                const double pixel[2])
{
    memset(feature, 0, sizeof *feature);
    feature->x_px = (float)pixel[0];
    feature->y_px = (float)pixel[1];
    feature->level = w.vague ? 7 : 0;
    memcpy(descriptor, w.descriptor[i], 32);
    for (int k = 0; k < 4; k++)
        descriptor[fv_random_below(&w.random, 32)] ^=
            (uint8_t)(1u << fv_random_below(&w.random, 8));
}

/* A keyframe at the next place: what it sees, and its links, in the world as it is estimated there.
 */
static inline void add_keyframe(void)
{
    const uint32_t n = w.count, current = fv_map_current(&w.map);
    struct fv_map_frame frame = fv_map_frame_at(&w.map, current);
    static int seen[FEATURES];
    static struct fovea_feature features[FEATURES];
    static uint8_t descriptors[FEATURES * 32];
    uint16_t from[FEATURES];
    uint32_t count = 0;
    true_pose(n, &w.truth[n]);
    for (int i = 0; i < POINTS && count < FEATURES; i++) {
        double q[3], pixel[2];
        fv_se3_apply(&w.truth[n], w.point[i], q);
        if (q[2] < 0.7 || q[2] > 6 || fovea_camera_project(&w.camera, q, pixel, 0) != FOVEA_OK ||
            pixel[0] < 0 || pixel[1] < 0 || pixel[0] >= 639 || pixel[1] >= 479)
            continue;
        if (w.vague && (fabs(q[0]) > ahead * q[2] || fabs(q[1]) > ahead * q[2])) continue;
        pixel[0] += 0.3 * fv_random_normal(&w.random);
        pixel[1] += 0.3 * fv_random_normal(&w.random);
        seen[count] = i;
        fill_feature(&features[count], &descriptors[32 * (size_t)count], i, pixel);
        count++;
    }
    fv_map_fill_frame(&w.map, current, features, descriptors, count, from);
    assert_int_equal(frame.keyframe->features, count);
    frame.keyframe->stamp_ns = n;
    frame.keyframe->T_cam_world = w.truth[n];
    frame.keyframe->depth = 3 * w.drift.s;
    fv_sim3_move_pose(&w.drift, &frame.keyframe->T_cam_world);
    uint32_t slot = fv_map_add_keyframe(&w.map, current);
    frame.keyframe->parent = (int32_t)slot;
    for (uint32_t f = 0; f < count; f++) {
        int i = seen[from[f]];
        if (w.landmark_of[i] == FV_MAP_NONE || w.seen_by[i] + REMEMBERED < n) {
            double p[3];
            fv_sim3_apply(&w.drift, w.point[i], p);
            w.landmark_of[i] = fv_map_add_landmark(&w.map, p, n);
        }
        w.seen_by[i] = n;
        (void)fv_map_link(&w.map, (uint32_t)w.landmark_of[i], slot, f);
        fv_map_refresh_landmark(&w.map, (uint32_t)w.landmark_of[i]);
    }
    w.slot[n] = slot;
    w.count++;
    struct fv_sim3 step;
    fv_sim3_exp(w.step, &step);
    fv_sim3_compose(&w.drift, &step, &w.drift);
}

static inline void offer(uint32_t n)
{
    static struct fv_place_words words;
    const uint32_t slot = w.slot[n];
    struct fv_map_frame frame = fv_map_frame_at(&w.map, slot);
    fv_place_words_begin(&words);
    fv_place_words_add(&words, &w.kernels, frame.descriptors, frame.keyframe->features);
    fv_place_insert(&w.place, slot, frame.keyframe->generation, &words);
    fv_closure_offer(&w.closure, &w.map, &w.place, &words, slot);
}

/* Where a keyframe, or the current frame, has its camera. */
static inline void centre_in_odom(uint32_t slot, double centre[3])
{
    const double origin[3] = {0, 0, 0};
    struct fv_sim3 S_odom_map;
    fv_se3_apply_inverse(&w.map.keyframes[slot].T_cam_world, origin, centre);
    fv_sim3_invert(&w.map.state->S_map_world, &S_odom_map);
    fv_sim3_apply(&S_odom_map, centre, centre);
}

static struct fv_closure_outcome changed; /* by the last correction */

/* Finish the work on an offered keyframe, a new keyframe (if `grow`) being born while the graph is
 * solved. True when the map was corrected; the pose in odom must not have noticed. */
static inline bool work(bool grow)
{
    bool committed = false;
    while (fv_closure_waiting(&w.closure)) {
        struct fv_closure_outcome outcome;
        double before[3], after[3];
        if (grow && w.closure.state->phase == FV_CLOSURE_SOLVE && w.count < KEYFRAMES) {
            w.map.keyframes[fv_map_current(&w.map)].parent = (int32_t)w.slot[w.count - 1];
            add_keyframe();
            grow = false;
        }
        centre_in_odom(fv_map_current(&w.map), before);
        (void)fv_closure_unit(&w.closure, &w.map, &w.kernels, &outcome);
        centre_in_odom(fv_map_current(&w.map), after);
        for (int k = 0; k < 3; k++)
            assert_true(fabs(after[k] - before[k]) < 1e-9);
        committed |= outcome.committed;
        if (outcome.committed) changed = outcome;
    }
    return committed;
}

/* Distance of keyframe a from b as estimated, less the true one. */
static inline double distance_off(uint32_t a, uint32_t b)
{
    const double origin[3] = {0, 0, 0};
    double p[3], q[3], x[3], y[3], d[3], e[3];
    fv_se3_apply_inverse(&w.map.keyframes[w.slot[a]].T_cam_world, origin, p);
    fv_se3_apply_inverse(&w.map.keyframes[w.slot[b]].T_cam_world, origin, q);
    fv_se3_apply_inverse(&w.truth[a], origin, x);
    fv_se3_apply_inverse(&w.truth[b], origin, y);
    fv_subtract3(p, q, d);
    fv_subtract3(x, y, e);
    return fv_norm3(d) - fv_norm3(e);
}

/* Links from both ends agree, no landmark joins maps. */
static inline void check_links(void)
{
    for (uint32_t i = 0; i < w.map.limits.landmarks; i++) {
        const struct fv_landmark *l = &w.map.landmarks[i];
        if (!l->used) continue;
        for (uint32_t k = 0; k < l->observer_count; k++) {
            struct fv_map_frame frame = fv_map_frame_at(&w.map, l->observers[k].keyframe);
            assert_true(frame.keyframe->used);
            assert_int_equal(frame.landmark[l->observers[k].feature], i);
            assert_int_equal(frame.keyframe->map_id,
                             w.map.keyframes[l->observers[0].keyframe].map_id);
        }
    }
}

#endif

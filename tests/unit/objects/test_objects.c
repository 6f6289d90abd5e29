/* Objects: ids through crossings, gaps and turns of the camera; life cycle; the pool; its time.
 */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "common/data_folder.h"
#include "common/object_rig.h"
#include "base/elementary.h"
#include "geometry/se3.h"

/* The object in the list that overlaps a box by half and more; 0: none. */
static uint64_t id_at(const struct fovea_objects *objects, const struct fovea_detection *d)
{
    for (uint32_t i = 0; i < objects->count; i++) {
        const struct fovea_object *t = &objects->list[i];
        const float w = (t->x_max_px < d->x_max_px ? t->x_max_px : d->x_max_px) -
                        (t->x_min_px > d->x_min_px ? t->x_min_px : d->x_min_px);
        const float h = (t->y_max_px < d->y_max_px ? t->y_max_px : d->y_max_px) -
                        (t->y_min_px > d->y_min_px ? t->y_min_px : d->y_min_px);
        const float area = (d->x_max_px - d->x_min_px) * (d->y_max_px - d->y_min_px);
        if (t->state == FOVEA_OBJECT_CONFIRMED && w > 0 && h > 0 && w * h > 0.5f * area)
            return t->id;
    }
    return 0;
}

/* ---- life ------------------------------------------------------------------------------------ */

static void objects_live_and_end(void **state)
{
    (void)state;
    make();
    struct fovea_objects t;
    for (int f = 0; f < 5; f++) {
        const struct fovea_detection d = box(100 + 4 * f, 100, 40, 60, 0.9);
        t = infer(f, &d, 1);
        assert_int_equal(t.count, 1);
        assert_int_equal(t.list[0].id, 1);
        assert_int_equal(t.list[0].state, f < 1 ? FOVEA_OBJECT_TENTATIVE : FOVEA_OBJECT_CONFIRMED);
    }
    assert_int_equal(t.confirmed, 1);
    assert_in_range((int)t.list[0].x_px_s, 80, 140);
    assert_int_equal(t.list[0].hits, 5);
    int f = 5;
    for (; f < 80; f++) {
        t = infer(f, NULL, 0);
        assert_int_equal(t.count, 1);
        if (t.list[0].state == FOVEA_OBJECT_ENDED) break;
        assert_int_equal(t.list[0].state, FOVEA_OBJECT_COASTING);
        assert_int_equal(t.list[0].unseen, f - 4);
    }
    assert_in_range(f, 64, 66); /* two seconds after frame 4 */
    t = infer(f + 1, NULL, 0);
    assert_int_equal(t.count, 0);
    /* Seen once and never again: never reported as ended. A new one has a new id. */
    const struct fovea_detection d = box(300, 300, 40, 60, 0.9);
    t = infer(f + 2, &d, 1);
    assert_int_equal(t.list[0].id, 2);
    t = infer(f + 3, NULL, 0);
    assert_int_equal(t.count, 0);
    fv_objects_reset(&pool);
    t = infer(0, &d, 1); /* time may restart, ids do not */
    assert_int_equal(t.list[0].id, 3);
    free(block);
}

/* State after `hits` equal detections. */
static int state_after(int hits, double score)
{
    struct fovea_objects t = {0};
    const struct fovea_detection d = box(100, 100, 40, 60, score);
    make();
    for (int f = 0; f < hits; f++)
        t = infer(f, &d, 1);
    assert_int_equal(t.count, 1);
    const int state = t.list[0].state;
    assert_int_equal(t.confirmed, state == FOVEA_OBJECT_CONFIRMED);
    free(block);
    return state;
}

static void good_scores_confirm_and_poor_ones_never(void **state)
{
    (void)state;
    assert_int_equal(state_after(1, 0.9), FOVEA_OBJECT_TENTATIVE);
    assert_int_equal(state_after(2, 0.55), FOVEA_OBJECT_CONFIRMED);
    assert_int_equal(state_after(30, 0.45), FOVEA_OBJECT_TENTATIVE);
}

/* A detection below the model's threshold continues an object seen just before, whatever the limits
 * of score are; it starts none. */
static void what_is_below_the_threshold_starts_no_object(void **state)
{
    (void)state;
    make();
    struct fovea_objects t;
    for (int f = 0; f < 20; f++) {
        const struct fovea_detection d[2] = {box(100 + 2 * f, 100, 40, 60, 0.7),
                                             box(400, 300, 50, 50, 0.7)};
        t = f < 5 ? infer_unsure(f, d, 1, 1) : infer_unsure(f, d, 0, 2);
        assert_int_equal(t.count, 1);
    }
    assert_int_equal(t.list[0].state, FOVEA_OBJECT_CONFIRMED);
    assert_int_equal(t.list[0].hits, 20);
    free(block);
}

/* It does not bring back an object that was not visible, whatever its score. */
static void what_is_below_the_threshold_ends_no_coasting(void **state)
{
    (void)state;
    make();
    struct fovea_objects t;
    const struct fovea_detection d = box(100, 100, 40, 60, 0.7);
    for (int f = 0; f < 12; f++)
        t = infer_unsure(f, &d, f < 5, f >= 8);
    assert_int_equal(t.count, 1);
    assert_int_equal(t.list[0].state, FOVEA_OBJECT_COASTING);
    assert_int_equal(t.list[0].hits, 5);
    free(block);
}

static void uncertain_detections_hold_an_object_but_start_none(void **state)
{
    (void)state;
    make();
    struct fovea_objects t;
    for (int f = 0; f < 20; f++) {
        const struct fovea_detection d[2] = {box(100 + 2 * f, 100, 40, 60, f < 5 ? 0.9 : 0.2),
                                             box(400, 300, 50, 50, 0.3)};
        t = infer(f, d, 2);
        assert_int_equal(t.count, 1);
    }
    assert_int_equal(t.list[0].state, FOVEA_OBJECT_CONFIRMED);
    assert_int_equal(t.list[0].hits, 20);
    free(block);
}

static void classes_do_not_mix(void **state)
{
    (void)state;
    make();
    struct fovea_objects t;
    for (int f = 0; f < 10; f++) {
        struct fovea_detection d = box(100, 100, 40, 60, 0.9);
        d.class_id = f < 5 ? 1 : 2;
        t = infer(f, &d, 1);
    }
    assert_int_equal(t.count, 2);
    assert_true(t.list[0].class_id == 1 && t.list[0].state == FOVEA_OBJECT_COASTING);
    assert_true(t.list[1].class_id == 2 && t.list[1].state == FOVEA_OBJECT_CONFIRMED);
    free(block);
}

static void a_full_pool_gives_up_its_weakest(void **state)
{
    (void)state;
    config.count_max = 3;
    make();
    const struct fovea_detection first[4] = {box(50, 50, 30, 30, 0.9), box(150, 50, 30, 30, 0.9),
                                             box(250, 50, 30, 30, 0.9), box(350, 50, 30, 30, 0.8)};
    struct fovea_objects t;
    for (int f = 0; f < 4; f++)
        t = infer(f, first, 4);
    assert_int_equal(t.count, 3); /* all seen just now: none goes */
    assert_int_equal(id_at(&t, &first[3]), 0);
    for (int f = 4; f < 8; f++)
        t = infer(f, first + 1, 3);
    assert_int_equal(t.count, 3);
    assert_int_equal(id_at(&t, &first[1]), 2);
    assert_int_equal(id_at(&t, &first[2]), 3);
    assert_int_equal(id_at(&t, &first[3]), 4);
    config.count_max = 128;
    free(block);
}

/* ---- identity -------------------------------------------------------------------------------- */

/* Scenes of objects of one class that cross each other's ways; behind a pillar none is seen. True
 * boxes, shaken by a pixel. */
enum { OBJECTS_MAX = 8, SCENE_FRAMES = 300 };

struct object {
    double at[2], v[2], wave[4], size;
    bool hidden;
    uint64_t id;
};

struct motion {
    int objects;
    void (*start)(struct object *o, struct fv_random *random);
    void (*move)(struct object *o, int frame);
};

struct outcome {
    int gaps, crossings, switches;
};

/* To and fro at 1 to 3 px per frame, so through the pillar within 1.4 s; up and down in gentle
 * waves. */
static void start_gently(struct object *o, struct fv_random *random)
{
    o->at[0] = o->size + fv_random_below(random, WIDTH - 2 * (uint32_t)o->size);
    o->v[0] =
        (1.0 + fv_random_below(random, 100) / 50.0) * (fv_random_below(random, 2) == 0 ? 1 : -1);
    for (int k = 0; k < 4; k++)
        o->wave[k] = fv_random_below(random, 1000) / 1000.0;
}

static void move_gently(struct object *o, int frame)
{
    o->at[0] += o->v[0];
    if (o->at[0] < o->size / 2 || o->at[0] > WIDTH - o->size / 2) o->v[0] = -o->v[0];
    o->at[1] =
        120 + 240 * o->wave[0] +
        (20 + 20 * o->wave[1]) * fv_sin(6.28 * o->wave[2] + frame * (0.01 + 0.02 * o->wave[3]));
}

/* Straight on at up to 3 px per frame either way, thrown back by all four walls at once. */
static void start_straight(struct object *o, struct fv_random *random)
{
    for (int k = 0; k < 2; k++) {
        o->at[k] = o->size + fv_random_below(
                                 random, (uint32_t)((k == 0 ? WIDTH : HEIGHT) - 2 * (int)o->size));
        o->v[k] = (double)fv_random_below(random, 120) / 20.0 - 3.0;
    }
    if (__builtin_fabs(o->v[0]) < 1) o->v[0] = o->v[0] < 0 ? -1 : 1;
}

static void move_and_bounce(struct object *o, int frame)
{
    (void)frame;
    for (int k = 0; k < 2; k++) {
        o->at[k] += o->v[k];
        const double wall = k == 0 ? WIDTH : HEIGHT;
        if ((o->at[k] < o->size / 2 && o->v[k] < 0) ||
            (o->at[k] > wall - o->size / 2 && o->v[k] > 0))
            o->v[k] = -o->v[k];
    }
}

/* A detection's score tells which one an object took. */
static uint64_t id_of(const struct fovea_objects *objects, const struct fovea_detection *d)
{
    uint64_t id = 0;
    for (uint32_t k = 0; k < objects->count; k++) {
        if (objects->list[k].state == FOVEA_OBJECT_CONFIRMED && objects->list[k].score == d->score)
            id = objects->list[k].id;
    }
    return id;
}

static void play_frame(const struct motion *motion, int frame, struct object *o,
                       struct fv_random *random, struct outcome *outcome)
{
    struct fovea_detection seen[OBJECTS_MAX];
    int who[OBJECTS_MAX];
    uint32_t count = 0;
    for (int i = 0; i < motion->objects; i++) {
        motion->move(&o[i], frame);
        const bool behind = o[i].at[0] > 300 && o[i].at[0] < 340; /* the pillar */
        outcome->gaps += o[i].hidden && !behind;
        o[i].hidden = behind;
        if (behind) continue;
        const double shake[2] = {(double)fv_random_below(random, 21) / 10 - 1,
                                 (double)fv_random_below(random, 21) / 10 - 1};
        who[count] = i;
        seen[count++] = box(o[i].at[0] + shake[0], o[i].at[1] + shake[1], o[i].size,
                            1.5 * o[i].size, 0.9 + 0.01 * i);
        for (int j = 0; j < i; j++) {
            outcome->crossings += !o[j].hidden && __builtin_fabs(o[i].at[0] - o[j].at[0]) < 5 &&
                                  __builtin_fabs(o[i].at[1] - o[j].at[1]) < 5;
        }
    }
    const struct fovea_objects t = infer(frame, seen, count);
    for (uint32_t d = 0; d < count; d++) {
        const uint64_t id = id_of(&t, &seen[d]), before = o[who[d]].id;
        if (id == 0) continue; /* tentative */
        outcome->switches += before != 0 && before != id;
        o[who[d]].id = id;
    }
}

static struct outcome play(const struct motion *motion, int scenes)
{
    struct outcome outcome = {0, 0, 0};
    for (int scene = 0; scene < scenes; scene++) {
        struct fv_random random;
        struct object o[OBJECTS_MAX] = {0};
        fv_random_seed(&random, (uint64_t)scene);
        for (int i = 0; i < motion->objects; i++) {
            o[i].size = 24 + fv_random_below(&random, 50);
            motion->start(&o[i], &random);
        }
        make();
        for (int f = 0; f < SCENE_FRAMES; f++)
            play_frame(motion, f, o, &random, &outcome);
        for (int i = 0; i < motion->objects; i++) {
            assert_true(o[i].id > 0);
            for (int j = 0; j < i; j++)
                assert_true(o[i].id != o[j].id);
        }
        free(block);
    }
    printf(
        "%d scenes: %d times behind the pillar, %d frames with two objects in one place, %d switches\n",
        scenes, outcome.gaps, outcome.crossings, outcome.switches);
    return outcome;
}

static void crossings_and_occlusions_keep_ids(void **state)
{
    (void)state;
    const struct outcome outcome =
        play(&(struct motion){OBJECTS_MAX, start_gently, move_gently}, 20);
    assert_int_equal(outcome.switches, 0);
    assert_true(outcome.gaps > 50 && outcome.crossings > 5);
}

/* Against the filter's model of motion, invisible as well: an id is lost less than once in a
 * hundred times behind the pillar. */
static void abrupt_turns_cost_few_ids(void **state)
{
    (void)state;
    const struct outcome outcome = play(&(struct motion){5, start_straight, move_and_bounce}, 100);
    assert_true(outcome.gaps > 300 && outcome.crossings > 50);
    assert_true(outcome.switches * 100 < outcome.gaps);
}

/* The camera swings by 40 px per frame and back: without its pose the boxes are lost, with it they
 * are not. */
static uint64_t swing(bool posed)
{
    make();
    uint64_t id = 0;
    for (int f = 0; f < 60; f++) {
        const double angle = 0.3 * fv_sin(0.35 * f), rotation[3] = {0, angle, 0};
        struct fv_objects_inference l = {.stamp_ns = (int64_t)(f + 1) * 33333333, .posed = posed};
        double R[9], pixel[2];
        const double world[3] = {0.05, 0, 2};
        fv_so3_exp(rotation, R);
        double p[3];
        for (int i = 0; i < 3; i++) {
            for (int j = 0; j < 3; j++)
                l.T_world_cam[4 * i + j] = R[3 * i + j];
            p[i] = R[i] * world[0] + R[3 + i] * world[1] + R[6 + i] * world[2];
        }
        assert_int_equal(fovea_camera_project(&camera, p, pixel, NULL), FOVEA_OK);
        const struct fovea_detection d = box(pixel[0], pixel[1], 20, 20, 0.9);
        l.detections = &d;
        l.count = 1;
        fv_objects_update(&pool, &l);
        struct fovea_objects t;
        fv_objects_get(&pool, &t);
        id = t.list[t.count - 1].id;
        if (posed && f > 10) assert_true(__builtin_fabs((double)t.list[0].x_px_s) < 60);
    }
    free(block);
    return id;
}

static void turns_of_the_camera_are_taken_out(void **state)
{
    (void)state;
    assert_int_equal(swing(true), 1);
    assert_true(swing(false) > 1);
}

static bool read_truth(const char *path, double (*boxes)[4], int *count)
{
    FILE *file = fopen(path, "r");
    if (file == NULL) return false;
    double *b = boxes[0];
    for (*count = 0; *count < 2000 && fscanf(file, "%lf%*[, \t]%lf%*[, \t]%lf%*[, \t]%lf", b, b + 1,
                                             b + 2, b + 3) == 4;
         b += 4)
        ++*count;
    fclose(file);
    return true;
}

static void one_pedestrian_seen_every_third_frame_is_one_object(void **state)
{
    (void)state;
    static double boxes[2001][4];
    char path[512];
    int count;
    snprintf(path, sizeof path, "%s/tracking_crossing/groundtruth_rect.txt", fv_data_folder());
    if (!read_truth(path, boxes, &count)) {
        printf("SKIPPED tracking_crossing: no %s\n", path);
        return;
    }
    assert_int_equal(count, 120);
    for (int mode = FOVEA_OBJECTS_SORT; mode <= FOVEA_OBJECTS_CENTROID; mode++) {
        config.mode = mode;
        make();
        for (int f = 0; f < count; f += 3) {
            const struct fovea_detection d =
                box(boxes[f][0] + boxes[f][2] / 2, boxes[f][1] + boxes[f][3] / 2, boxes[f][2],
                    boxes[f][3], 0.9);
            const struct fovea_objects t = infer(f, &d, 1);
            assert_int_equal(t.count, 1);
            assert_int_equal(t.list[0].id, 1);
        }
        free(block);
    }
    config.mode = FOVEA_OBJECTS_SORT;
}

static void centroids_match_up_to_a_distance(void **state)
{
    (void)state;
    config.mode = FOVEA_OBJECTS_CENTROID;
    config.max_distance_px = 30;
    config.max_disappeared = 3;
    make();
    const struct fovea_detection a[2] = {box(100, 100, 20, 20, 0.9), box(140, 100, 20, 20, 0.9)};
    const struct fovea_detection b[2] = {
        box(125, 100, 20, 20, 0.9),
        box(160, 100, 20, 20, 0.9)}; /* nearest pairs first: 15, then 25 is too far from... */
    struct fovea_objects t = infer(0, a, 2);
    assert_int_equal(t.count, 2);
    assert_int_equal(t.list[0].state, FOVEA_OBJECT_CONFIRMED);
    t = infer(1, b, 2);
    assert_int_equal(id_at(&t, &b[0]), 2); /* 15 px from the second, 25 from the first */
    assert_int_equal(id_at(&t, &b[1]), 3); /* 60 px from the first: another */
    for (int f = 2; f < 5; f++)
        t = infer(f, b, 2);
    assert_int_equal(t.list[0].id, 1);
    assert_int_equal(t.list[0].state, FOVEA_OBJECT_ENDED); /* the fourth inference without it */
    t = infer(5, b, 2);
    assert_int_equal(t.count, 2);
    config.mode = FOVEA_OBJECTS_SORT;
    config.max_distance_px = 60;
    config.max_disappeared = 20;
    free(block);
}

static void boxes_of_movable_classes_are_listed(void **state)
{
    (void)state;
    float boxes[4][4];
    config.movable[0] = 1u << 2;
    make();
    struct fovea_detection d[2] = {box(100, 100, 40, 60, 0.9), box(300, 200, 40, 60, 0.9)};
    d[1].class_id = 2;
    infer(0, d, 2);
    assert_int_equal(fv_objects_movable(&pool, boxes, 4), 1);
    assert_true(boxes[0][0] == 280.0f && boxes[0][3] == 230.0f);
    config.movable[0] = 0;
    free(block);
}

/* ---- time ------------------------------------------------------------------------------------ */

static int64_t cpu_ns(void)
{
    struct timespec now;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
    return (int64_t)now.tv_sec * 1000000000 + now.tv_nsec;
}

/* Median of the processor time of an update with a hundred objects. */
static int64_t hundred_objects_ns(void)
{
    enum { OBJECTS = 100, FRAMES = 200 };
    static int64_t took[FRAMES];
    make();
    struct fv_random random;
    fv_random_seed(&random, 9);
    double at[OBJECTS][2], v[OBJECTS][2];
    for (int i = 0; i < OBJECTS; i++) {
        at[i][0] = fv_random_below(&random, WIDTH), at[i][1] = fv_random_below(&random, HEIGHT);
        for (int k = 0; k < 2; k++)
            v[i][k] = (double)fv_random_below(&random, 80) / 20.0 - 2.0;
    }
    struct fovea_objects t = {0};
    for (int f = 0; f < FRAMES; f++) {
        struct fovea_detection d[OBJECTS];
        const double rotation[3] = {0, 0.002 * f, 0};
        double R[9];
        struct fv_objects_inference l = {.stamp_ns = (int64_t)(f + 1) * 33333333,
                                         .detections = d,
                                         .count = OBJECTS,
                                         .posed = true};
        fv_so3_exp(rotation, R);
        for (int i = 0; i < 9; i++)
            l.T_world_cam[i / 3 * 4 + i % 3] = R[i];
        for (int i = 0; i < OBJECTS; i++) {
            for (int k = 0; k < 2; k++) {
                at[i][k] += v[i][k];
                if (at[i][k] < 0 || at[i][k] > (k == 0 ? WIDTH : HEIGHT)) v[i][k] = -v[i][k];
            }
            d[i] = box(at[i][0] - 0.8 * f, at[i][1], 30, 40, 0.9);
        }
        const int64_t begin = cpu_ns();
        fv_objects_update(&pool, &l);
        took[f] = cpu_ns() - begin;
        fv_objects_get(&pool, &t);
    }
    assert_in_range(t.count, 90, 128);
    for (int i = 1; i < FRAMES; i++)
        for (int j = i; j > 0 && took[j - 1] > took[j]; j--) {
            const int64_t swap = took[j];
            took[j] = took[j - 1];
            took[j - 1] = swap;
        }
    printf("100 objects: median %.3f ms, 90th percentile %.3f ms\n",
           (double)took[FRAMES / 2] * 1e-6, (double)took[FRAMES * 9 / 10] * 1e-6);
    free(block);
    return took[FRAMES / 2];
}

/* The least of some runs: beside a program on the other half of a core each takes twice as long. */
static void a_hundred_objects_take_a_fifth_of_a_millisecond(void **state)
{
    (void)state;
    enum { RUNS_MAX = 40 };
    int64_t least = hundred_objects_ns();
    if (getenv("FOVEA_TIMED") == NULL) return;
    for (int i = 1; i < RUNS_MAX && least > 200000; i++) {
        const int64_t again = hundred_objects_ns();
        if (again < least) least = again;
    }
    assert_true(least <= 200000);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(objects_live_and_end),
        cmocka_unit_test(good_scores_confirm_and_poor_ones_never),
        cmocka_unit_test(what_is_below_the_threshold_starts_no_object),
        cmocka_unit_test(what_is_below_the_threshold_ends_no_coasting),
        cmocka_unit_test(uncertain_detections_hold_an_object_but_start_none),
        cmocka_unit_test(classes_do_not_mix),
        cmocka_unit_test(a_full_pool_gives_up_its_weakest),
        cmocka_unit_test(crossings_and_occlusions_keep_ids),
        cmocka_unit_test(abrupt_turns_cost_few_ids),
        cmocka_unit_test(turns_of_the_camera_are_taken_out),
        cmocka_unit_test(one_pedestrian_seen_every_third_frame_is_one_object),
        cmocka_unit_test(centroids_match_up_to_a_distance),
        cmocka_unit_test(boxes_of_movable_classes_are_listed),
        cmocka_unit_test(a_hundred_objects_take_a_fifth_of_a_millisecond),
    };
    return cmocka_run_group_tests(tests, setup, NULL);
}

/* The truth of the simulated camera against geometry done another way: rays in the world by brute
 * force, objects by their documented sizes, and the pictures themselves, which must fit when one is
 * seen from the other's place. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "common/sim_source.h"

static struct fovea_source *open_at(const char *address, uint64_t start, struct fovea_frame *frame)
{
    struct fovea_source *source = sim_source_open_at(address, start);
    assert_int_equal(fv_source_sim.dequeue(source, 0, frame), FOVEA_OK);
    return source;
}

/* ---- rays by brute force --------------------------------------------------------------------- */

/* Intersection of the ray o + t d with a face, or infinity: plane, then the two coordinates. */
static double meet_face(const struct fv_sim_face *f, const double o[3], const double d[3])
{
    const double *u = f->u, *v = f->v;
    const double n[3] = {u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2],
                         u[0] * v[1] - u[1] * v[0]};
    double dn = 0, on = 0, pu = 0, pv = 0, uu = 0, vv = 0;
    for (int i = 0; i < 3; i++) {
        dn += d[i] * n[i];
        on += (f->origin[i] - o[i]) * n[i];
    }
    if (dn >= 0.0) return INFINITY; /* from behind */
    const double t = on / dn;
    for (int i = 0; i < 3; i++) {
        const double p = o[i] + t * d[i] - f->origin[i];
        pu += p * u[i];
        pv += p * v[i];
        uu += u[i] * u[i];
        vv += v[i] * v[i];
    }
    const double s = pu / uu, r = pv / vv;
    if (t <= 0.0 || s < 0.0 || s > 1.0 || r < 0.0 || r > 1.0) return INFINITY;
    if (f->disc && (s - 0.5) * (s - 0.5) + (r - 0.5) * (r - 0.5) > 0.25) return INFINITY;
    return t;
}

/* Signed: negative inside the body. */
static double body(const struct fv_sim_round *b, const double o[3], const double d[3], double t)
{
    double s = 0, square = 0;
    for (int i = 0; i < 3; i++)
        s += (o[i] + t * d[i] - b->base[i]) * b->axis[i];
    for (int i = 0; i < 3; i++) {
        const double e = o[i] + t * d[i] - b->base[i] - s * b->axis[i];
        square += e * e;
    }
    if (s < 0.0 || s > b->height) return 1.0;
    return square - (b->q0 + b->q1 * s + b->q2 * s * s);
}

/* By marching in steps of 4 mm near the body, then halving. */
static double meet_round(const struct fv_sim_round *b, const double o[3], const double d[3])
{
    double center[3], length = 0, along = 0, miss = 0;
    for (int i = 0; i < 3; i++) {
        center[i] = b->base[i] + 0.5 * b->height * b->axis[i] - o[i];
        length += d[i] * d[i];
        along += center[i] * d[i];
    }
    const double middle = along / length, reach = 1.2 / sqrt(length);
    for (int i = 0; i < 3; i++)
        miss += (middle * d[i] - center[i]) * (middle * d[i] - center[i]);
    if (miss > 1.2 * 1.2 || middle + reach < 0) return INFINITY;
    const double step = 0.004 / sqrt(length);
    for (double t = middle - reach; t < middle + reach; t += step) {
        if (t < 0 || body(b, o, d, t) > 0.0) continue;
        double low = t - step, high = t;
        for (int k = 0; k < 40; k++) {
            const double m = 0.5 * (low + high);
            if (body(b, o, d, m) > 0.0)
                low = m;
            else
                high = m;
        }
        return high;
    }
    return INFINITY;
}

static void check_rays(const char *address, uint64_t start)
{
    struct fovea_frame frame;
    static struct fovea_truth truth;
    struct fovea_source *source = open_at(address, start, &frame);
    assert_int_equal(fv_source_sim.truth(source, &frame, &truth), FOVEA_OK);
    const struct fv_sim_world *w = &source->world;
    const double *T = truth.T_world_cam, o[3] = {T[3], T[7], T[11]};
    int wrong = 0, count = 0, rounds = 0;
    double worst = 0;
    for (int32_t y = 3; y < frame.images[0].height; y += 7) {
        for (int32_t x = 2; x < frame.images[0].width; x += 7) {
            double b[3], d[3], t = INFINITY;
            int object = 0, still = 0;
            assert_int_equal(fovea_camera_unproject(&source->info.rig.cameras[0].camera,
                                                    (const double[2]){x, y}, b, NULL),
                             FOVEA_OK);
            for (int i = 0; i < 3; i++) /* scaled so that t is the depth */
                d[i] = (T[4 * i] * b[0] + T[4 * i + 1] * b[1] + T[4 * i + 2] * b[2]) / b[2];
            for (int32_t i = 0; i < w->face_count; i++) {
                const double m = meet_face(&w->face[i], o, d);
                if (m < t) {
                    t = m;
                    object = w->face[i].object;
                    still = w->face[i].truth_class;
                }
            }
            for (int32_t i = 0; i < w->round_count; i++) {
                const double m = meet_round(&w->round[i], o, d);
                if (m < t) {
                    t = m;
                    object = w->round[i].object;
                    still = w->round[i].truth_class;
                    rounds++;
                }
            }
            const int32_t at = y * frame.images[0].width + x;
            const double error = fabs((double)truth.depth_m[at] / t - 1.0);
            const int expected = object == 0 ? still : (int)w->object[object - 1].object_class;
            count++;
            if (error > 1e-4 || truth.class_mask[at] != expected)
                wrong++;
            else
                worst = fmax(worst, error);
        }
    }
    print_message("%s frame %d: %d rays (%d on bodies), %d differ (edges), others within %.1e\n",
                  address, (int)start, count, rounds, wrong, worst);
    assert_true(wrong * 500 <= count);
    sim_source_close(source);
}

static void test_depth_and_classes(void **state)
{
    (void)state;
    check_rays("orbit?objects=16", 40);
    check_rays("tour?objects=16", 700);
    check_rays("corridor?lens=pinhole", 300);
    check_rays("wander?lens=equidistant&objects=24&seed=4", 900);
}

/* Of what stands still by where it is: floor is what lies on the ground, walls and obstacles rise
 * from it, pits are below it and all that is below it is one, the ceiling is none of them; and each
 * of them is seen. */
static void test_classes_of_what_stands(void **state)
{
    static const struct {
        const char *address;
        double ceiling_m;
        int frame;
    } worlds[] = {{"orbit?seed=2", 2.8, 60},  {"tour?seed=5", 2.7, 60},  {"corridor", 2.7, 60},
                  {"wander?seed=4", 5.5, 60}, {"drive?seed=6", 2.7, 60}, {"drive?seed=7", 2.7, 60},
                  {"drive?seed=3", 2.7, 190}}; /* there the bottom of a pit is seen */
    int all[FOVEA_TRUTH_CLASS_COUNT] = {0};
    (void)state;
    for (size_t i = 0; i < sizeof worlds / sizeof worlds[0]; i++) {
        struct fovea_frame frame;
        static struct fovea_truth truth;
        struct fovea_source *source = open_at(worlds[i].address, worlds[i].frame, &frame);
        const struct fovea_camera *camera = &source->info.rig.cameras[0].camera;
        int seen[FOVEA_TRUTH_CLASS_COUNT] = {0}, low[FOVEA_TRUTH_CLASS_COUNT] = {0},
            high[FOVEA_TRUTH_CLASS_COUNT] = {0}, below[FOVEA_TRUTH_CLASS_COUNT] = {0};
        assert_int_equal(fv_source_sim.truth(source, &frame, &truth), FOVEA_OK);
        const double *T = truth.T_world_cam;
        for (int32_t at = 0; at < camera->width * camera->height; at++) {
            const double pixel[2] = {at % camera->width, at / camera->width};
            const uint8_t kind = truth.class_mask[at];
            double b[3];
            assert_true(kind < FOVEA_TRUTH_CLASS_COUNT);
            assert_int_equal(fovea_camera_unproject(camera, pixel, b, NULL), FOVEA_OK);
            const double z = T[11] + (double)truth.depth_m[at] *
                                         (T[8] * b[0] + T[9] * b[1] + T[10] * b[2]) / b[2];
            seen[kind]++;
            all[kind]++;
            low[kind] += z < 0.001;
            below[kind] += z < -0.001;
            high[kind] += z > worlds[i].ceiling_m - 0.001;
        }
        assert_int_equal(low[FOVEA_TRUTH_FLOOR], seen[FOVEA_TRUTH_FLOOR]);
        assert_int_equal(high[FOVEA_TRUTH_BACKGROUND], seen[FOVEA_TRUTH_BACKGROUND]);
        assert_true(100 * low[FOVEA_TRUTH_WALL] <= seen[FOVEA_TRUTH_WALL]);
        assert_true(100 * low[FOVEA_TRUTH_OBSTACLE] <= seen[FOVEA_TRUTH_OBSTACLE]);
        for (int kind = 0; kind < FOVEA_TRUTH_PIT; kind++)
            assert_int_equal(below[kind], 0);
        assert_true(100 * below[FOVEA_TRUTH_PIT] >= 99 * seen[FOVEA_TRUTH_PIT]);
        sim_source_close(source);
    }
    for (int kind = 0; kind < FOVEA_TRUTH_CLASS_COUNT; kind++)
        print_message("class %d: %d pixels\n", kind, all[kind]);
    for (int kind = FOVEA_TRUTH_FLOOR; kind < FOVEA_TRUTH_CLASS_COUNT; kind++)
        assert_true(all[kind] > 10000);
    assert_true(all[FOVEA_TRUTH_BACKGROUND] > 1000);
}

/* ---- boxes by the sizes in the documentation ------------------------------------------------- */

struct extent {
    double x_min, x_max, y_min, y_max;
    bool whole;
};

static void extend(struct extent *e, const struct fovea_source *source, const double T[12],
                   double x, double y, double z)
{
    const double d[3] = {x - T[3], y - T[7], z - T[11]};
    double c[3], pixel[2];
    for (int i = 0; i < 3; i++)
        c[i] = T[i] * d[0] + T[4 + i] * d[1] + T[8 + i] * d[2];
    if (fovea_camera_project(&source->info.rig.cameras[0].camera, c, pixel, NULL) != FOVEA_OK) {
        e->whole = false;
        return;
    }
    e->x_min = fmin(e->x_min, pixel[0]);
    e->x_max = fmax(e->x_max, pixel[0]);
    e->y_min = fmin(e->y_min, pixel[1]);
    e->y_max = fmax(e->y_max, pixel[1]);
}

/* Circles of points at heights, as drivers/sim/README.md gives the sizes. */
static void outline(struct extent *e, const struct fovea_source *source, const double T[12],
                    enum fovea_truth_class kind, const double p[2], double heading)
{
    const double c = cos(heading), s = sin(heading);
    for (int k = 0; k < 256; k++) {
        const double a = 2 * M_PI * k / 256, ca = cos(a), sa = sin(a);
        for (int h = 0; h <= 64; h++) {
            const double f = h / 64.0;
            if (kind == FOVEA_TRUTH_BALL) {
                const double z = 0.15 * cos(M_PI * f), r = 0.15 * sin(M_PI * f);
                extend(e, source, T, p[0] + r * ca, p[1] + r * sa, 0.15 + z);
            } else if (kind == FOVEA_TRUTH_CONE) {
                extend(e, source, T, p[0] + 0.18 * (1 - f) * ca, p[1] + 0.18 * (1 - f) * sa,
                       0.03 + fmax(0.0, f * 0.5 - 0.03));
            } else if (kind == FOVEA_TRUTH_PERSON) {
                const double z = 0.115 * cos(M_PI * f), r = 0.115 * sin(M_PI * f); /* head */
                extend(e, source, T, p[0] + r * ca, p[1] + r * sa, 1.6 + z);
                extend(e, source, T, p[0] + 0.14 * ca, p[1] + 0.14 * sa, 0.6 * f); /* legs */
                const double t = 0.92 * f, square = 4 * 0.22 * 0.22 / 0.92 * t * (1 - t / 0.92);
                extend(e, source, T, p[0] + sqrt(square) * ca, p[1] + sqrt(square) * sa, 0.6 + t);
            }
        }
    }
    const double length = 0.4, width = kind == FOVEA_TRUTH_CONE ? 0.4 : 0.3;
    const double height = kind == FOVEA_TRUTH_CONE ? 0.03 : 0.3;
    for (int k = 0; k < 8 && (kind == FOVEA_TRUTH_BOX || kind == FOVEA_TRUTH_CONE); k++) {
        const double x = ((k & 1) - 0.5) * length, y = (((k >> 1) & 1) - 0.5) * width;
        extend(e, source, T, p[0] + c * x - s * y, p[1] + s * x + c * y, (k >> 2) * height);
    }
}

static void test_boxes(void **state)
{
    (void)state;
    int checked[FOVEA_TRUTH_OBJECT_COUNT] = {0};
    double worst = 0.0;
    for (uint64_t start = 0; start < 800; start += 80) {
        struct fovea_frame frame;
        static struct fovea_truth truth;
        struct fovea_source *source = open_at("orbit?objects=16&seed=3", start, &frame);
        assert_int_equal(fv_source_sim.truth(source, &frame, &truth), FOVEA_OK);
        for (uint32_t i = 0; i < truth.box_count; i++) {
            const struct fovea_truth_box *box = &truth.boxes[i];
            const struct fv_sim_object *o = &source->world.object[box->id - 1];
            assert_int_equal(box->object_class, o->object_class);
            assert_true(box->visible_fraction > 0.0f && box->visible_fraction <= 1.0f);
            assert_true(box->x_min_px < box->x_max_px && box->y_min_px < box->y_max_px);
            if (box->visible_fraction < 1.0f || box->x_min_px < 1 || box->y_min_px < 1 ||
                box->x_max_px > 639 || box->y_max_px > 479)
                continue;
            double position[2], heading;
            struct extent e = {1e9, -1e9, 1e9, -1e9, true};
            fv_sim_object_pose(o, fv_sim_frame_time(source, start), position, &heading);
            outline(&e, source, truth.T_world_cam, o->object_class, position, heading);
            assert_true(e.whole);
            /* Pixel k covers [k - 0.5, k + 0.5]; the box's far sides are exclusive. A pixel belongs
             * to the object when its centre does, so that each side lies within a pixel of the
             * outline. */
            const double off[4] = {
                (double)box->x_min_px - e.x_min, e.x_max - ((double)box->x_max_px - 1.0),
                (double)box->y_min_px - e.y_min, e.y_max - ((double)box->y_max_px - 1.0)};
            for (int k = 0; k < 4; k++) {
                worst = fmax(worst, fabs(off[k]));
                /* The tip of a cone is thinner than a pixel for a while. */
                const double most = o->object_class == FOVEA_TRUTH_CONE && k == 2 ? 5.0 : 1.6;
                if (off[k] < -0.2 || off[k] > most)
                    print_error("start %d id %u class %d side %d: %.2f\n", (int)start, box->id,
                                o->object_class, k, off[k]);
                assert_true(off[k] >= -0.2 && off[k] <= most);
            }
            checked[o->object_class]++;
        }
        sim_source_close(source);
    }
    print_message("boxes checked: ball %d cone %d box %d person %d, sides within %.2f px\n",
                  checked[1], checked[2], checked[3], checked[4], worst);
    for (int c = 1; c < FOVEA_TRUTH_OBJECT_COUNT; c++)
        assert_true(checked[c] >= 5);
}

/* An object that leaves the image keeps its fraction of the whole, and one behind another loses
 * what is hidden.
 */
static void test_visible_fraction(void **state)
{
    (void)state;
    struct fovea_frame frame;
    static struct fovea_truth narrow, wide;
    int compared = 0;
    for (uint64_t start = 0; start < 800; start += 160) {
        /* The same camera with a smaller image: its truth must agree with counting in the larger
         * one. */
        struct fovea_source *source = open_at(
            "orbit?objects=16&seed=8&lens=pinhole&width=640&height=480&fov=80", start, &frame);
        struct fovea_frame inner;
        struct fovea_source *part = open_at(
            "orbit?objects=16&seed=8&lens=pinhole&width=320&height=240&fov=45.5288", start, &inner);
        assert_int_equal(fv_source_sim.truth(source, &frame, &wide), FOVEA_OK);
        assert_int_equal(fv_source_sim.truth(part, &inner, &narrow), FOVEA_OK);
        for (uint32_t i = 0; i < narrow.box_count; i++) {
            for (uint32_t k = 0; k < wide.box_count; k++) {
                if (wide.boxes[k].id != narrow.boxes[i].id || wide.boxes[k].visible_fraction < 1.0f)
                    continue;
                double visible = 0, whole = 0;
                const uint8_t id = (uint8_t)narrow.boxes[i].id;
                for (int32_t p = 0; p < 640 * 480; p++)
                    whole += source->object_map[p] == id;
                for (int32_t p = 0; p < 320 * 240; p++)
                    visible += part->object_map[p] == id;
                if (whole < 200 || visible / whole > 0.97) continue;
                assert_true(fabs(visible / whole - (double)narrow.boxes[i].visible_fraction) <
                            0.04);
                compared++;
            }
        }
        sim_source_close(source);
        sim_source_close(part);
    }
    print_message("visible fraction: %d cut objects agree with a wider image\n", compared);
    assert_true(compared >= 5);
}

/* ---- pictures -------------------------------------------------------------------------------- */

struct fit {
    double xx, xy, yy, xe, ye;
    int count;
};

static double sample(const uint8_t *image, int32_t width, double x, double y)
{
    const int32_t ix = (int32_t)x, iy = (int32_t)y;
    const double fx = x - ix, fy = y - iy;
    const uint8_t *p = image + iy * width + ix;
    return (p[0] * (1 - fx) + p[1] * fx) * (1 - fy) +
           (p[width] * (1 - fx) + p[width + 1] * fx) * fy;
}

static int compare_doubles(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* Two frames of one trajectory with their truths. */
struct visible {
    struct fovea_source *source;
    struct fovea_frame frame;
    struct fovea_truth truth;
};

/* Where the second frame shows what the first has at (x, y), by depth and pose. False: outside it,
 * or hidden there. */
static bool seen_again(const struct visible *a, const struct visible *b, int32_t x, int32_t y,
                       double pixel[2])
{
    double bearing[3], world[3], c[3];
    const int32_t width = a->frame.images[0].width, height = a->frame.images[0].height;
    const double *A = a->truth.T_world_cam, *B = b->truth.T_world_cam;
    const double z = (double)a->truth.depth_m[y * width + x], at[2] = {x, y};
    assert_int_equal(
        fovea_camera_unproject(&a->source->info.rig.cameras[0].camera, at, bearing, NULL),
        FOVEA_OK);
    for (int i = 0; i < 3; i++)
        world[i] = A[4 * i + 3] + z / bearing[2] *
                                      (A[4 * i] * bearing[0] + A[4 * i + 1] * bearing[1] +
                                       A[4 * i + 2] * bearing[2]);
    for (int i = 0; i < 3; i++)
        c[i] =
            B[i] * (world[0] - B[3]) + B[4 + i] * (world[1] - B[7]) + B[8 + i] * (world[2] - B[11]);
    if (fovea_camera_project(&b->source->info.rig.cameras[0].camera, c, pixel, NULL) != FOVEA_OK)
        return false;
    if (pixel[0] < 2 || pixel[1] < 2 || pixel[0] > width - 4 || pixel[1] > height - 4) return false;
    const int32_t nearest = (int32_t)(pixel[1] + 0.5) * width + (int32_t)(pixel[0] + 0.5);
    return fabs((double)b->truth.depth_m[nearest] / c[2] - 1.0) <= 0.01;
}

/* One pixel's share in the shift that would fit best. */
static void fit_add(struct fit *f, const struct fovea_image *image, const double pixel[2], double e)
{
    const double x = pixel[0], y = pixel[1];
    const double gx = (sample(image->data, image->width, x + 1, y) -
                       sample(image->data, image->width, x - 1, y)) /
                      2;
    const double gy = (sample(image->data, image->width, x, y + 1) -
                       sample(image->data, image->width, x, y - 1)) /
                      2;
    f->xx += gx * gx;
    f->xy += gx * gy;
    f->yy += gy * gy;
    f->xe += gx * e;
    f->ye += gy * e;
    f->count++;
}

enum { TILE = 40, TILES = 256 };

/* Shifts of the tiles that show enough, sorted; returns how many, and their root mean square. */
static int find_shifts(const struct fit fits[TILES], double shifts[TILES], double *rms)
{
    double sum = 0;
    int count = 0;
    for (int k = 0; k < TILES; k++) {
        const struct fit *f = &fits[k];
        const double det = f->xx * f->yy - f->xy * f->xy;
        if (f->count < TILE * TILE / 2 || det < 1e4 * f->count) continue;
        const double sx = (f->yy * f->xe - f->xy * f->ye) / det,
                     sy = (f->xx * f->ye - f->xy * f->xe) / det;
        sum += sx * sx + sy * sy;
        shifts[count++] = sqrt(sx * sx + sy * sy);
    }
    qsort(shifts, (size_t)count, sizeof *shifts, compare_doubles);
    *rms = sqrt(sum / (count > 0 ? count : 1));
    return count;
}

/* See the first frame's pixels in the second through depth and pose; then the shift that would fit
 * best, tile by tile. */
static void check_pictures(const char *address, uint64_t start, uint64_t later)
{
    static struct visible a, b;
    static struct fit fits[TILES];
    static double differences[640 * 480], shifts[TILES];
    int count = 0;
    memset(fits, 0, sizeof fits);
    a.source = open_at(address, start, &a.frame);
    b.source = open_at(address, later, &b.frame);
    assert_int_equal(fv_source_sim.truth(a.source, &a.frame, &a.truth), FOVEA_OK);
    assert_int_equal(fv_source_sim.truth(b.source, &b.frame, &b.truth), FOVEA_OK);
    const int32_t width = a.frame.images[0].width, height = a.frame.images[0].height;
    for (int32_t y = 2; y < height - 2; y++) {
        for (int32_t x = 2; x < width - 2; x++) {
            double pixel[2];
            if (!seen_again(&a, &b, x, y, pixel)) continue;
            const double e = sample(b.frame.images[0].data, width, pixel[0], pixel[1]) -
                             a.frame.images[0].data[y * width + x];
            fit_add(&fits[(y / TILE) * 16 + x / TILE], &b.frame.images[0], pixel, e);
            differences[count++] = fabs(e);
        }
    }
    double rms;
    const int tiles = find_shifts(fits, shifts, &rms);
    qsort(differences, (size_t)count, sizeof *differences, compare_doubles);
    const double median = differences[count / 2], high = differences[count * 9 / 10];
    print_message(
        "%s frames %d and %d: %d %% of pixels compared, difference median %.1f, 90 %% %.1f grey levels; shift of %d tiles median %.3f, rms %.3f px\n",
        address, (int)start, (int)later, count * 100 / (width * height), median, high, tiles,
        shifts[tiles / 2], rms);
    assert_true(count > width * height / 2);
    assert_true(tiles >= 40);
    assert_true(median <= 3.0 && high <= 16.0);
    assert_true(shifts[tiles / 2] <= 0.06 && rms <= 0.15);
    sim_source_close(a.source);
    sim_source_close(b.source);
}

static void test_pictures_fit(void **state)
{
    (void)state;
    check_pictures("orbit?noise=0&objects=0", 30, 36);
    check_pictures("orbit?noise=0&objects=0&lens=equidistant&seed=2", 200, 208);
    check_pictures("corridor?noise=0&objects=0", 60, 66);
    check_pictures("tour?noise=0&objects=0", 900, 906);
    check_pictures("wander?noise=0&objects=0&lens=pinhole&frames=3000", 2000, 2010);
}

static void test_truth_needs_a_held_frame(void **state)
{
    (void)state;
    struct fovea_frame frame;
    static struct fovea_truth truth;
    struct fovea_source *source = open_at("still?width=64&height=64", 0, &frame);
    fv_source_sim.requeue(source, &frame);
    assert_int_equal(fv_source_sim.truth(source, &frame, &truth), FOVEA_ERROR_ARGUMENT);
    sim_source_close(source);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_depth_and_classes),
        cmocka_unit_test(test_boxes),
        cmocka_unit_test(test_classes_of_what_stands),
        cmocka_unit_test(test_visible_fraction),
        cmocka_unit_test(test_pictures_fit),
        cmocka_unit_test(test_truth_needs_a_held_frame),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

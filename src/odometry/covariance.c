/* Covariance of the pose relative to its reference keyframe: see covariance.h. */
#include "odometry/covariance.h"

#include <string.h>

#include "geometry/normal_equations.h"
#include "geometry/vec.h"
#include "odometry/covariance_lens.h"
#include "odometry/covariance_unit.h"
#include "odometry/odometry.h"
#include "geometry/chi_square.h"

enum {
    SAMPLE = 48,                        /* landmarks that take part */
    SHARED_MIN = 6,                     /* of them that a keyframe must see to take part */
    FREE = FV_COVARIANCE_POSES_MAX - 1, /* keyframes besides the reference */
    REFERENCE = -1,
    OUTSIDE = -2,
    YOUNG_KEYFRAMES = 10,
    SHOWN_MIN = 12 /* errors that show a variance */
};

static const double scale_sigma =
    0.005; /* of the window's unit of length against that of the whole path */
static const double nearly = 1e-6,
                    nearly_zero = 1e-9; /* added to diagonals, relative: no parallax is any depth */
static const double parts_fraction = 0.4, parts_chance = 4, parts_sure = 8;
/* of what the parts show, where their variance is up to parts_chance times that of the errors, as
 * in good pictures; all of it from parts_sure times on */
static const double together_max =
    3; /* parts' variance over that of the errors: more, and something moves, or the map is bent */
static const double young_spread_px =
    20; /* below it, landmarks' errors have much in common; above, less and less */
static const double much_larger = 4; /* less is chance */
static const double bend_max = 0.1, bend_lost = 0.5, bend_fraction = 0.17;
static const double calibration_fraction = 0.0063; /* of the way, on good runs */
static const double open_max = 0.01; /* rad, and of the depth; good pictures leave .001 open */
static const double doubt_fraction =
    0.05; /* of the way, where the pictures do not bear the map out */

void fv_covariance_carve(struct fv_covariance *c, struct fv_arena *frame)
{
    c->joint = fv_arena_take_raw(frame, 36 * FV_COVARIANCE_POSES_MAX * FV_COVARIANCE_POSES_MAX,
                                 sizeof *c->joint);
}

/* An observation of a landmark, linearised: by the frame's small motion (left of T_cam_world) and
 * by the point. */
struct fv_linear_observation {
    int pose;                                     /* block of the system, or REFERENCE */
    double weight, rows[12], by_point[6], error2; /* squared, weighted */
    /* the same of its measured distance; a weight of 0: none */
    double distance_weight, distance_row[6], distance_by_point[3];
};

/* What a pose's errors show. */
struct fv_shown {
    uint32_t count;
    double error2, freedom; /* sums: of squared errors, and what landmarks left of their freedom */
    double noisier;         /* their variance over the frame's, 1 at least */
};

/* The problem around a frame: blocks of the free keyframes, then that of the frame. */
struct fv_joint {
    int poses, size;
    double *S; /* size x size, row-major; lower triangle */
    uint32_t slots[FREE];
    int8_t block_of[FOVEA_ODOMETRY_KEYFRAMES_MAX];
    uint32_t sample[SAMPLE]; /* features */
    uint32_t sample_count;
    struct fv_shown shown[FV_COVARIANCE_POSES_MAX + 1]; /* by block, the reference's the last */
};

/* Some of the inliers, spread as they lie in the image: features are kept cell by cell. */
static void sample_inliers(const struct fv_map_frame *frame, uint32_t inliers, struct fv_joint *j)
{
    const uint32_t wanted = inliers < SAMPLE ? inliers : SAMPLE;
    uint32_t met = 0;
    j->sample_count = 0;
    for (uint32_t f = 0; f < frame->keyframe->features && j->sample_count < wanted; f++) {
        if (frame->landmark[f] == FV_MAP_NONE) continue;
        if (met * wanted / inliers != (met + 1) * wanted / inliers)
            j->sample[j->sample_count++] = f;
        met++;
    }
}

/* The keyframes that see most of the sample. */
static void pick_poses(const struct fv_map *map, uint32_t newest, const struct fv_map_frame *frame,
                       struct fv_joint *j)
{
    uint16_t shared[FOVEA_ODOMETRY_KEYFRAMES_MAX] = {0};
    for (uint32_t i = 0; i < j->sample_count; i++) {
        const struct fv_landmark *l = &map->landmarks[frame->landmark[j->sample[i]]];
        for (uint32_t k = 0; k < l->observer_count; k++)
            shared[l->observers[k].keyframe]++;
    }
    memset(j->block_of, OUTSIDE, sizeof j->block_of);
    j->block_of[newest] = REFERENCE;
    shared[newest] = 0;
    for (j->poses = 0; j->poses < FREE; j->poses++) {
        const uint32_t best = fv_map_best_shared(map, shared);
        if (shared[best] < SHARED_MIN) break;
        shared[best] = 0;
        j->slots[j->poses] = best;
        j->block_of[best] = (int8_t)j->poses;
    }
    j->poses++;
    j->size = 6 * j->poses;
    memset(j->S, 0, (size_t)(j->size * j->size) * sizeof *j->S);
}

/* `measured`: the distance of the feature, in a metric map; else NULL. */
static void linear_distance_of(const struct fv_se3 *T, const double bearing[3], const double q[3],
                               const struct fv_inverse_distance *measured,
                               struct fv_linear_observation *s)
{
    double e;
    s->distance_weight = 0;
    if (measured == NULL || !fv_inverse_distance_error(measured, bearing, q, &e, s->distance_row))
        return;
    s->distance_weight = fv_inverse_distance_robust(measured, e);
    fv_cross3(q, s->distance_row, s->distance_row + 3);
    fv_rotate_back3(T->R, s->distance_row, s->distance_by_point);
}

/* Measured distances of a frame's features; NULL in a map that is not metric. */
static const struct fv_inverse_distance *distances_of(const struct fv_map *map, uint32_t slot)
{
    return fv_map_metric(map) ? fv_map_distances(map, slot) : NULL;
}

/* False: behind the camera, or a misfit that robust estimates leave out. */
static bool linear_observation_of(const struct fv_se3 *T, const struct fv_keypoint *p,
                                  const struct fv_inverse_distance *measured, const double point[3],
                                  int pose, struct fv_linear_observation *s)
{
    double q[3], e[2], J[6];
    struct fv_observation observation;
    fv_observation_from(p, point, &observation);
    fv_se3_apply(T, point, q);
    if (!fv_observation_error(observation.bearing, observation.A, q, e, J)) return false;
    s->error2 = observation.weight * (e[0] * e[0] + e[1] * e[1]);
    if (s->error2 > FV_CHI_SQUARE_95_2) return false;
    s->pose = pose;
    s->weight = observation.weight;
    for (int r = 0; r < 2; r++) {
        fv_copy3(J + 3 * r, s->rows + 6 * r);
        fv_cross3(q, J + 3 * r, s->rows + 6 * r + 3);
        fv_rotate_back3(T->R, J + 3 * r, s->by_point + 3 * r);
    }
    linear_distance_of(T, observation.bearing, q, measured, s);
    return true;
}

/* All observations of a landmark by frames that take part; returns their number. */
static int find_observations(const struct fv_map *map, const struct fv_map_frame *frame,
                             uint32_t feature, const struct fv_joint *j,
                             struct fv_linear_observation observations[FV_MAP_OBSERVERS_MAX + 1])
{
    const struct fv_landmark *l = &map->landmarks[frame->landmark[feature]];
    const struct fv_inverse_distance *own = distances_of(map, fv_map_current(map));
    int count = linear_observation_of(&frame->keyframe->T_cam_world, &frame->keypoints[feature],
                                      own == NULL ? NULL : &own[feature], l->point, j->poses - 1,
                                      observations);
    struct fv_pixel seen[FV_MAP_OBSERVERS_MAX];
    struct fv_keypoint points[FV_MAP_OBSERVERS_MAX];
    const struct fv_observer *taking[FV_MAP_OBSERVERS_MAX];
    uint32_t takes = 0;
    for (uint32_t k = 0; k < l->observer_count; k++) {
        const struct fv_observer *observer = &l->observers[k];
        if (j->block_of[observer->keyframe] == OUTSIDE) continue;
        taking[takes] = observer;
        seen[takes++] = fv_map_frame_at(map, observer->keyframe).points[observer->feature];
    }
    fv_map_keypoints(map, seen, takes, points);
    for (uint32_t k = 0; k < takes; k++) {
        const uint32_t slot = taking[k]->keyframe;
        if (points[k].weight > 0)
            count += linear_observation_of(
                &map->keyframes[slot].T_cam_world, &points[k],
                own == NULL ? NULL : &fv_map_distances(map, slot)[taking[k]->feature], l->point,
                j->block_of[slot], &observations[count]);
    }
    return count;
}

/* What an observation's distance adds to a landmark's own block and to that with its pose. */
static void add_distance(const struct fv_linear_observation *s, double H[6], double cross[18])
{
    const double *b = s->distance_by_point, w = s->distance_weight;
    for (int r = 0, k = 0; r < 3; r++)
        for (int c = r; c < 3; c++, k++)
            H[k] += w * b[r] * b[c];
    for (int r = 0; r < 3; r++)
        for (int c = 0; c < 6; c++)
            cross[6 * r + c] += w * s->distance_row[c] * b[r];
}

/* A landmark's observations, the landmark itself eliminated. */
static void add_landmark(struct fv_joint *j, const struct fv_linear_observation *observations,
                         int count)
{
    double H[6] = {0}, V[6], cross[FV_MAP_OBSERVERS_MAX + 1][18];
    struct fv_coupling couplings[FV_MAP_OBSERVERS_MAX + 1];
    int coupled = 0;
    for (int i = 0; i < count; i++) {
        const double *b = observations[i].by_point, w = observations[i].weight;
        for (int r = 0, k = 0; r < 3; r++)
            for (int c = r; c < 3; c++, k++)
                H[k] += w * (b[r] * b[c] + b[3 + r] * b[3 + c]);
        for (int r = 0; r < 3; r++)
            for (int c = 0; c < 6; c++)
                cross[i][6 * r + c] =
                    w * (observations[i].rows[c] * b[r] + observations[i].rows[6 + c] * b[3 + r]);
        if (observations[i].distance_weight > 0) add_distance(&observations[i], H, cross[i]);
    }
    H[0] *= 1 + nearly;
    H[3] *= 1 + nearly;
    H[5] *= 1 + nearly;
    if (count < 2 || !fv_invert_symmetric3(H, V)) return;
    for (int i = 0; i < count; i++) {
        const int first = 6 * observations[i].pose;
        if (observations[i].pose == REFERENCE) continue;
        couplings[coupled++] = (struct fv_coupling){cross[i], first, 6};
        fv_block_add_inner(j->S + first * (j->size + 1), j->size, observations[i].rows, 6,
                           observations[i].rows, 6, 2, observations[i].weight, true);
        if (observations[i].distance_weight > 0)
            fv_block_add_inner(j->S + first * (j->size + 1), j->size, observations[i].distance_row,
                               6, observations[i].distance_row, 6, 1,
                               observations[i].distance_weight, true);
    }
    const struct fv_normal normal = {j->S, NULL, j->size};
    fv_normal_eliminate(&normal, 3, V, NULL, couplings, coupled);
}

/* The unit of length is free: hold it, so that the path of the poses keeps its size about the
 * reference. */
static void hold_scale(const struct fv_map *map, uint32_t newest, const struct fv_map_frame *frame,
                       struct fv_joint *j)
{
    const double origin[3] = {0, 0, 0};
    double centre[3], way[6 * FV_COVARIANCE_POSES_MAX] = {0}, square = 0;
    double weighted[6 * FV_COVARIANCE_POSES_MAX];
    fv_se3_apply_inverse(&map->keyframes[newest].T_cam_world, origin, centre);
    for (int k = 0; k < j->poses; k++) {
        const struct fv_keyframe *keyframe =
            k == j->poses - 1 ? frame->keyframe : &map->keyframes[j->slots[k]];
        fv_se3_apply(&keyframe->T_cam_world, centre, way + 6 * k);
        square += fv_dot3(way + 6 * k, way + 6 * k);
    }
    if (!(square > 0)) return;
    /* In metres it is the measured distances that hold it, also of a short path. */
    const double depth = fv_map_metric(map) ? map->keyframes[newest].depth : 0;
    const double prior = 1 / (scale_sigma * scale_sigma * square * (square + depth * depth));
    const struct fv_normal normal = {j->S, NULL, j->size};
    fv_block_weigh(way, j->size, prior, weighted);
    fv_normal_add_one(&normal, 0, j->size, way, weighted, NULL, 1, NULL);
}

static void add_distance_error(const struct fv_inverse_distance *measured, const double bearing[3],
                               const double q[3], struct fv_pose_part *part)
{
    double e, row[6];
    if (!fv_inverse_distance_error(measured, bearing, q, &e, row)) return;
    fv_cross3(q, row, row + 3);
    fv_pose_part_add(part, fv_inverse_distance_robust(measured, e), e, row);
}

/* The inliers' errors by part of the image. */
static void collect_parts(const struct fv_map *map, const struct fv_map_frame *frame,
                          struct fv_pose_part parts[FV_MAP_PARTS])
{
    const struct fv_se3 *T = &frame->keyframe->T_cam_world;
    const struct fv_inverse_distance *distances = distances_of(map, fv_map_current(map));
    memset(parts, 0, FV_MAP_PARTS * sizeof *parts);
    for (uint32_t f = 0; f < frame->keyframe->features; f++) {
        double q[3], e[2], J[6], row[6];
        struct fv_observation s;
        if (frame->landmark[f] == FV_MAP_NONE) continue;
        fv_observation_from(&frame->keypoints[f], map->landmarks[frame->landmark[f]].point, &s);
        fv_se3_apply(T, s.point, q);
        if (!fv_observation_error(s.bearing, s.A, q, e, J)) continue;
        struct fv_pose_part *part = &parts[fv_map_part(map, &frame->points[f])];
        for (int r = 0; r < 2; r++) {
            fv_copy3(J + 3 * r, row);
            fv_cross3(q, row, row + 3);
            fv_pose_part_add(part, s.weight, e[r], row);
        }
        if (distances != NULL) add_distance_error(&distances[f], s.bearing, q, part);
    }
}

/* How far the visible map is bent: noise over the mean parallax of its landmarks. Those with more
 * of it hold the rest in place; where none has much, as in a young map, their errors have much in
 * common. */
static double map_bend(const struct fv_map *map, double focal_px, const struct fv_map_frame *frame,
                       double noise_px)
{
    double sum = 0;
    uint32_t count = 0;
    for (uint32_t f = 0; f < frame->keyframe->features; f++) {
        if (frame->landmark[f] == FV_MAP_NONE) continue;
        sum += (double)map->landmarks[frame->landmark[f]].spread;
        count++;
    }
    if (fv_map_metric(map)) return 0; /* distances hold it from the first keyframe on */
    const double mean_px = sum * focal_px / (count > 0 ? count : 1);
    if (!(mean_px > noise_px)) return 1;
    const double bend = noise_px / mean_px * young_spread_px / mean_px;
    return bend < 1 ? bend : 1;
}

static struct fv_shown *shown_of(struct fv_joint *j, int pose)
{
    return &j->shown[pose == REFERENCE ? FV_COVARIANCE_POSES_MAX : pose];
}

/* Variances of the keyframes' errors, by those of the sample. Places of landmarks were fitted to
 * them, which took 3 degrees of freedom of a landmark's 2 per observer. */
static void find_variances(const struct fv_map *map, const struct fv_map_frame *frame,
                           double variance, struct fv_joint *j)
{
    memset(j->shown, 0, sizeof j->shown);
    for (uint32_t i = 0; i < j->sample_count; i++) {
        struct fv_linear_observation observations[FV_MAP_OBSERVERS_MAX + 1];
        const int count = find_observations(map, frame, j->sample[i], j, observations);
        const uint32_t observers = map->landmarks[frame->landmark[j->sample[i]]].observer_count;
        const double freedom = 2 - 3.0 / (observers > 2 ? observers : 2);
        for (int k = 0; k < count; k++) {
            struct fv_shown *shown = shown_of(j, observations[k].pose);
            shown->count++;
            shown->error2 += observations[k].error2;
            shown->freedom += freedom;
        }
    }
    for (int k = 0; k <= FV_COVARIANCE_POSES_MAX; k++) {
        struct fv_shown *shown = &j->shown[k];
        const bool is_frame = k == j->poses - 1;
        const double own = shown->count < SHOWN_MIN ? 0 : shown->error2 / shown->freedom;
        shown->noisier = !is_frame && own > variance ? own / variance : 1;
    }
}

/* Observations of noisier keyframes have less weight. */
static void weigh(struct fv_joint *j, struct fv_linear_observation *observations, int count)
{
    for (int k = 0; k < count; k++) {
        const double noisier = shown_of(j, observations[k].pose)->noisier;
        observations[k].weight /= noisier;
        observations[k].distance_weight /= noisier;
    }
}

/* The joint problem's covariance upper triangle by rows. False: not determined. */
static bool solve_joint(struct fv_odometry *o, const struct fv_map_frame *frame, uint32_t inliers,
                        double variance, double covariance[21])
{
    struct fv_joint j;
    j.S = o->covariance.joint;
    sample_inliers(frame, inliers, &j);
    pick_poses(&o->map, o->state->newest, frame, &j);
    find_variances(&o->map, frame, variance, &j);
    for (uint32_t i = 0; i < j.sample_count; i++) {
        struct fv_linear_observation observations[FV_MAP_OBSERVERS_MAX + 1];
        const int count = find_observations(&o->map, frame, j.sample[i], &j, observations);
        weigh(&j, observations, count);
        add_landmark(&j, observations, count);
    }
    const double information = (double)inliers / (double)j.sample_count / variance;
    for (int k = 0; k < j.size * j.size; k++)
        j.S[k] *= information;
    hold_scale(&o->map, o->state->newest, frame, &j);
    const struct fv_normal normal = {j.S, NULL, j.size};
    fv_normal_damp(&normal, nearly_zero, 0);
    if (!fv_ldlt_factor(j.S, j.size)) return false;
    const int at = j.size - 6;
    for (int row = 0, k = 0; row < 6; row++) {
        double solved[6 * FV_COVARIANCE_POSES_MAX] = {0};
        solved[at + row] = 1;
        fv_ldlt_back(j.S, j.size, solved);
        for (int column = row; column < 6; column++, k++)
            covariance[k] = solved[at + column];
    }
    return true;
}

/* Whether a pose is known well enough to be relied on. */
static bool well_known(const double covariance[21], double depth)
{
    const double place2 = covariance[0] + covariance[6] + covariance[11],
                 turn2 = covariance[15] + covariance[18] + covariance[20];
    return place2 <= open_max * open_max * depth * depth && turn2 <= open_max * open_max;
}

/* The reference keyframe seen from the frame. */
static void reference_from(const struct fv_keyframe *reference, const struct fv_map_frame *frame,
                           struct fv_se3 *T)
{
    struct fv_se3 T_world_ref;
    fv_se3_invert(&reference->T_cam_world, &T_world_ref);
    fv_se3_compose(&frame->keyframe->T_cam_world, &T_world_ref, T);
}

/* What is counted of what the parts show, errors of the fit having `variance`: all of it where
 * distances are measured, since behind a noisy keyframe two fifths are too few there. */
static void weigh_parts(const struct fv_map *map, double variance, struct fv_pose_shown *parts)
{
    if (fv_map_metric(map)) return;
    const double beyond = (parts->variance / variance - parts_chance) / (parts_sure - parts_chance);
    const double sure = beyond < 0 ? 0 : beyond > 1 ? 1 : beyond;
    const double counted = parts_fraction + (1 - parts_fraction) * sure;
    for (int k = 0; k < 21; k++)
        parts->covariance[k] *= counted;
}

/* What the parts of the reference's image showed, in place of what those of the frame's show, where
 * that is much larger, judged by turns, which have one unit everywhere. */
static void larger_parts(const struct fv_odometry *o, const struct fv_se3 *T_frame_ref,
                         double parts[21])
{
    double carried[21];
    if (!fv_odometry_reference_known(o)) return;
    fv_se3_carry_covariance(T_frame_ref, o->state->reference.parts, carried);
    if (carried[15] + carried[18] + carried[20] > much_larger * (parts[15] + parts[18] + parts[20]))
        memcpy(parts, carried, sizeof carried);
}

void fv_covariance_rescale(double covariance[21], double factor)
{
    for (int row = 0, k = 0; row < 6; row++)
        for (int column = row; column < 6; column++, k++)
            covariance[k] *= (row < 3 ? factor : 1) * (column < 3 ? factor : 1);
}

void fv_covariance_begin(struct fv_covariance_state *s)
{
    memset(s->lens, 0, sizeof s->lens);
    s->focal = 0;
}

static void write_own(struct fv_covariance_state *s, const struct fv_pose_fit *fit, double variance)
{
    double own[21] = {0};
    (void)fv_pose_add_alone(fit, variance, own);
    s->own_position = __builtin_sqrt((own[0] + own[6] + own[11]) / 3);
    s->own_turn = __builtin_sqrt((own[15] + own[18] + own[20]) / 3);
}

/* What grows with the way, in all directions, and turns alike over the depth. In metres by two
 * cameras what the calibration errs by is the scale's. */
static void add_drift(const struct fv_map *map, double bend, bool doubt, double way, double depth,
                      double covariance[21])
{
    const double of_bend = bend_fraction * bend * bend, of_doubt = doubt ? doubt_fraction : 0,
                 of_lens = fv_map_metric(map) ? 0 : calibration_fraction,
                 drift2 = (of_bend * of_bend + of_doubt * of_doubt + of_lens * of_lens) * way * way;
    for (int row = 0, k = 0; row < 6; k += 6 - row, row++)
        covariance[k] += row < 3 ? drift2 : drift2 / (depth * depth);
}

bool fv_covariance_write(struct fv_odometry *o, const struct fv_map_frame *frame,
                         const struct fv_pose_fit *fit)
{
    const struct fv_keyframe *reference = &o->map.keyframes[o->state->newest];
    double *covariance = o->state->pose.covariance, variance = fv_pose_variance(fit);
    if (variance < FV_MAP_VARIANCE_MIN) variance = FV_MAP_VARIANCE_MIN;
    struct fv_pose_part part[FV_MAP_PARTS];
    struct fv_pose_shown parts;
    write_own(&o->state->covariance, fit, variance);
    collect_parts(&o->map, frame, part);
    const bool spread = fv_pose_jackknife(fit, part, FV_MAP_PARTS, &parts);
    const double bend = map_bend(&o->map, o->focal_px, frame, __builtin_sqrt(variance));
    bool reliable = spread && (parts.variance < together_max * variance ||
                               fv_agreement_settled(&o->state->agreement));
    fv_pose_spread(fit, together_max * variance, &parts);
    weigh_parts(&o->map, variance, &parts);
    if (!solve_joint(o, frame, fit->inliers, variance, covariance)) {
        memset(covariance, 0, sizeof o->state->pose.covariance);
        (void)fv_pose_add_alone(fit, variance, covariance);
        reliable = false;
    }
    struct fv_se3 T_frame_ref;
    reference_from(reference, frame, &T_frame_ref);
    memcpy(o->state->parts, parts.covariance, sizeof o->state->parts);
    larger_parts(o, &T_frame_ref, parts.covariance);
    for (int k = 0; k < 21; k++)
        covariance[k] += parts.covariance[k];
    const double depth = reference->depth > 0 ? reference->depth : 1;
    if (!well_known(covariance, depth)) reliable = false;
    const bool is_young =
        o->map.state->keyframe_number - o->state->first_keyframe < YOUNG_KEYFRAMES;
    if (fv_covariance_add_lens(o, variance, is_young ? bend : 0, covariance)) reliable = false;
    fv_covariance_add_reference_lens(o, &T_frame_ref, covariance);
    const bool doubt = fv_agreement_verdict(&o->state->agreement) != FV_AGREEMENT_GOOD;
    add_drift(&o->map, bend, doubt, fv_norm3(T_frame_ref.t), depth, covariance);
    fv_covariance_add_unit(o, frame, bend, is_young, T_frame_ref.t, covariance);
    return reliable && bend < (is_young ? bend_max : bend_lost);
}

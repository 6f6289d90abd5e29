/* The first map, from two views: matches without prediction, essential matrix and homography, a model test,
 * and triangulation with enough parallax. Scores and the share of 0.45 in the model test: Mur-Artal, Montiel,
 * Tardos, "ORB-SLAM: a versatile and accurate monocular SLAM system" (T-RO 2015), section IV. */
#include <string.h>

#include "geometry/essential.h"
#include "geometry/homography.h"
#include "geometry/triangulate.h"
#include "geometry/vec.h"
#include "odometry/odometry.h"

enum {
    MATCHES_MIN = 80,       /* fewer, and the waiting frame is exchanged */
    DISTANCE_MAX = 64,      /* Hamming */
    LANDMARKS_MIN = 50,     /* with the full parallax, to start on */
    WAITING_FRAMES_MAX = 60 /* then the view has changed too much to hope */
};

static const double ratio_max = 0.8;
static const double direction_sigma_max_rad = 0.02; /* of the baseline; more, and the first map may be bent */
static const double essential_chi_square = 3.841, homography_chi_square = 5.991; /* 95 % of 1 and 2 dof */
static const double cos_parallax_full = 0.99985;                                 /* 1 degree */
/* 0.63 degree: of points with less, noise decides which pass, and those look too near and shrink the first
 * steps. */
static const double cos_parallax_some = 0.99994;

/* Matches of the waiting view's features in the current one: nearest, clearly nearer than the second, one to
 * one. Pairs go to odometry->pairs; nearest[k] and second[k] are rewritten to the features of pair k. */
static uint32_t fv_match_views(struct fv_odometry *o, const struct fv_kernels *kernels)
{
    struct fv_view a = fv_map_view(&o->map, fv_map_waiting(&o->map));
    struct fv_view b = fv_map_view(&o->map, fv_map_current(&o->map));
    uint32_t count_a = a.frame->features, count_b = b.frame->features, count = 0;
    kernels->hamming_two_u8(o->nearest, o->second, a.descriptors, (int32_t)count_a, b.descriptors,
                            (int32_t)count_b);
    for (uint32_t i = 0; i < count_b; i++)
        o->match_distance[i] = UINT16_MAX;
    for (uint32_t i = 0; i < count_a; i++) {
        uint32_t distance = o->nearest[i] >> FV_MATCH_INDEX_BITS, feature = o->nearest[i] & 0xffff;
        if (o->nearest[i] != FV_MATCH_NONE && distance < o->match_distance[feature])
            o->match_distance[feature] = (uint16_t)distance;
    }
    for (uint32_t i = 0; i < count_a; i++) {
        uint32_t distance = o->nearest[i] >> FV_MATCH_INDEX_BITS, feature = o->nearest[i] & 0xffff;
        if (o->nearest[i] == FV_MATCH_NONE || distance > DISTANCE_MAX ||
            distance != o->match_distance[feature] ||
            distance > ratio_max * (o->second[i] >> FV_MATCH_INDEX_BITS))
            continue;
        o->match_distance[feature] =
            0; /* taken: an equal one later is left out, unless it is a perfect match */
        for (int k = 0; k < 3; k++) {
            o->pairs[count].x1[k] = (double)a.points[i].bearing[k];
            o->pairs[count].x2[k] = (double)b.points[feature].bearing[k];
        }
        o->nearest[count] = i;
        o->second[count++] = feature;
    }
    return count;
}

/* Sum of what residuals leave of the chi-square bound, for the model test. */
static double fv_score(const double M[9], bool essential, const struct fv_pair *pairs, uint32_t count,
                       double sigma_rad)
{
    double limit = essential ? essential_chi_square : homography_chi_square, score = 0,
           inverse = 1 / (sigma_rad * sigma_rad);
    for (uint32_t i = 0; i < count; i++) {
        double r2 = inverse * (essential ? fv_essential_residual2(M, &pairs[i])
                                         : fv_homography_residual2(M, &pairs[i]));
        score += r2 < limit ? homography_chi_square - r2 : 0;
    }
    return score;
}

/* Triangulate a pair; false when it is not in front of both cameras or does not fit. */
static bool fv_pair_point(const struct fv_pair *pair, const struct fv_se3 *T_2_1, double limit_rad,
                          double point[3], double *cos_parallax)
{
    double q[3], r[3];
    if (!fv_triangulate(T_2_1, pair->x1, pair->x2, point, cos_parallax)) return false;
    fv_se3_apply(T_2_1, point, q);
    fv_cross3(q, pair->x2, r);
    double limit2 = limit_rad * limit_rad;
    if (fv_dot3(r, r) > limit2 * fv_dot3(q, q)) return false;
    fv_cross3(point, pair->x1, r);
    return fv_dot3(r, r) <= limit2 * fv_dot3(point, point);
}

/* Points that a motion gives, and how many of them with full parallax. */
static uint32_t fv_count_points(const struct fv_odometry *o, uint32_t count, const uint8_t *inlier,
                                const struct fv_se3 *T, uint32_t *with_parallax)
{
    uint32_t points = 0;
    *with_parallax = 0;
    for (uint32_t i = 0; i < count; i++) {
        double point[3], cosine;
        if (!inlier[i] || !fv_pair_point(&o->pairs[i], T, 2.5 / o->focal_px, point, &cosine)) continue;
        points++;
        *with_parallax += cosine < cos_parallax_full;
    }
    return points;
}

/* The best motion of the homography, when it is clearly better than the second best. */
static bool fv_plane_motion(const struct fv_odometry *o, uint32_t count, const double H[9], struct fv_se3 *T)
{
    struct fv_se3 candidates[4];
    double ratio;
    int motions = fv_homography_motions(H, candidates, &ratio);
    uint32_t best = 0, second = 0;
    for (int k = 0; k < motions; k++) {
        uint32_t with_parallax, points = fv_count_points(o, count, o->inlier, &candidates[k], &with_parallax);
        if (points > best) {
            second = best;
            best = points;
            *T = candidates[k];
        } else if (points > second) {
            second = points;
        }
    }
    return best > 0 && second < 0.75 * best;
}

/* Relative motion of the two views; number of points with parallax, 0: no start. */
static uint32_t fv_two_view(struct fv_odometry *o, uint32_t count, struct fv_se3 *T)
{
    struct fv_sampling sampling = {2.0 / o->focal_px, 0.999, 300};
    double H[9], E[9], sigma_rad = 1 / o->focal_px;
    uint32_t fit_h = fv_homography_estimate(o->pairs, count, &sampling, &o->state->random, H, o->inlier);
    struct fv_se3 plane;
    bool plane_known = fit_h > 0 && fv_plane_motion(o, count, H, &plane);
    uint32_t fit = fv_essential_estimate(o->pairs, count, &sampling, &o->state->random, T, o->inlier);
    if (fit < MATCHES_MIN / 2) return 0;
    fv_essential_from_motion(T, E);
    double score_e = fv_score(E, true, o->pairs, count, sigma_rad);
    double score_h = fit_h ? fv_score(H, false, o->pairs, count, sigma_rad) : 0;
    if (score_h > 0.45 * (score_h + score_e)) {
        if (!plane_known) return 0;
        *T = plane;
        for (uint32_t i = 0; i < count; i++)
            o->inlier[i] =
                fv_homography_residual2(H, &o->pairs[i]) < sampling.threshold_rad * sampling.threshold_rad;
    }
    uint32_t with_parallax, points = fv_count_points(o, count, o->inlier, T, &with_parallax);
    double spread = fv_essential_direction_sigma(o->pairs, count, sampling.threshold_rad, sigma_rad, T);
    bool good = points >= 0.7 * fit && with_parallax >= LANDMARKS_MIN && spread < direction_sigma_max_rad;
    return good ? with_parallax : 0;
}

/* Median depth (camera 1) of the points, by halving the interval of log depths: no sorting. */
static double fv_median_depth(const struct fv_odometry *o, uint32_t count, const struct fv_se3 *T)
{
    double low = 1e-3, high = 1e4;
    for (int step = 0; step < 40; step++) {
        double middle = __builtin_sqrt(low * high), point[3], cosine;
        uint32_t below = 0, all = 0;
        for (uint32_t i = 0; i < count; i++) {
            if (!o->inlier[i] || !fv_triangulate(T, o->pairs[i].x1, o->pairs[i].x2, point, &cosine)) continue;
            if (cosine > cos_parallax_some) continue;
            all++;
            below += point[2] < middle;
        }
        *(2 * below > all ? &high : &low) = middle;
    }
    return __builtin_sqrt(low * high);
}

static void fv_make_first_map(struct fv_odometry *o, uint32_t count, struct fv_se3 *T)
{
    double scale = 1 / fv_median_depth(o, count, T);
    for (int i = 0; i < 3; i++)
        T->t[i] *= scale;
    fv_se3_identity(&o->map.keyframes[fv_map_waiting(&o->map)].T_cam_world);
    o->map.keyframes[fv_map_current(&o->map)].T_cam_world = *T;
    if (o->map.state->keyframe_count > 0) fv_map_begin_another(&o->map);
    fv_map_make_room(&o->map, count, o->state->frame_number);
    uint32_t first = fv_map_add_keyframe(&o->map, fv_map_waiting(&o->map));
    o->map.keyframes[first].parent = FV_MAP_NONE;
    uint32_t second = fv_map_add_keyframe(&o->map, fv_map_current(&o->map));
    o->map.keyframes[first].depth = o->map.keyframes[second].depth = 1;
    o->map.keyframes[second].parent = (int32_t)first;
    struct fv_view current = fv_map_view(&o->map, fv_map_current(&o->map));
    current.frame->parent = (int32_t)second;
    o->state->recent_count = 0;
    for (uint32_t i = 0; i < count; i++) {
        double point[3], cosine;
        if (!o->inlier[i] || !fv_pair_point(&o->pairs[i], T, 2.5 / o->focal_px, point, &cosine) ||
            cosine > cos_parallax_some)
            continue;
        int32_t landmark = fv_map_add_landmark(&o->map, point, o->state->frame_number);
        if (landmark == FV_MAP_NONE) break;
        (void)fv_map_link(&o->map, (uint32_t)landmark, first, o->nearest[i]);
        (void)fv_map_link(&o->map, (uint32_t)landmark, second, o->second[i]);
        fv_map_refresh_landmark(&o->map, (uint32_t)landmark);
        current.landmark[o->second[i]] = landmark;
        struct fv_recent recent = {(uint32_t)landmark, o->map.landmarks[landmark].generation,
                                   current.points[o->second[i]].level};
        o->recent[o->state->recent_count++] = recent;
    }
    o->state->newest = second;
    o->state->keyframe_frame = o->state->frame_number;
    o->state->keyframe_matches = o->state->recent_count;
    o->state->job_wanted = true;
    o->state->moving_known = false;
    fv_odometry_queue(o, second);
}

bool fv_odometry_start(struct fv_odometry *o, const struct fv_kernels *kernels)
{
    struct fv_odometry_state *s = o->state;
    uint32_t count = s->waiting ? fv_match_views(o, kernels) : 0;
    if (!s->waiting || count < MATCHES_MIN || ++s->waiting_frames > WAITING_FRAMES_MAX) {
        fv_map_copy_view(&o->map, fv_map_current(&o->map), fv_map_waiting(&o->map));
        s->waiting = true;
        s->waiting_frames = 0;
        return false;
    }
    struct fv_se3 T;
    if (!fv_two_view(o, count, &T)) return false;
    fv_make_first_map(o, count, &T);
    s->waiting = false;
    s->pose.matches = count;
    s->pose.inliers = s->recent_count;
    return true;
}

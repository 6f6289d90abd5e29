#include "runtime/calibration.h"

#include <string.h>

/* Logarithms of focal lengths. Over 22 simulated runs (odd seeds, all trajectories, rolling
 * shutter, blur) and the recordings, two frames in a row of a lens that is right show a change of
 * at most 7 deviations, and of 6 where it is above .007; a mismatch is at most .034 beyond its four
 * deviations while a map is young, .02 later. A focal length 2 % off shows as .018 to .02, 20
 * deviations. */
static const double change_limit = 0.014;    /* of a large one, */
static const double change_again_sigmas = 3; /* with which the next or the last frame agrees; */
static const double change_lasting = 0.004;  /* and of one that lasts */
static const double change_sigmas = 8;       /* of both */
static const double mismatch_doubtful = 0.06, mismatch_wrong = 0.1, mismatch_sigmas = 4;
static const double fading = 0.7; /* of the sums, by measured frame */

enum { MESSAGE_FRAMES = 128 };

void fv_calibration_carve(struct fv_calibration *c, struct fv_arena *persistent,
                          struct fv_arena *job)
{
    c->state = fv_arena_take(persistent, 1, sizeof *c->state);
    fv_lens_window_carve(&c->window, job);
}

void fv_calibration_reset(struct fv_calibration *c)
{
    memset(c->state, 0, sizeof *c->state);
    memset(c->window.state, 0, sizeof *c->window.state);
}

/* ---- the verdict ----------------------------------------------------------------------------- */

static void decide(struct fv_calibration_state *s, enum fovea_calibration_state verdict,
                   enum fovea_calibration_cause cause, double value)
{
    const bool is_larger = (uint32_t)verdict == s->verdict && s->cause == (uint32_t)cause &&
                           cause == FOVEA_CALIBRATION_UNFIT && verdict == FOVEA_CALIBRATION_WRONG &&
                           value * value > s->value * s->value;
    if ((uint32_t)verdict <= s->verdict && !is_larger) return;
    s->verdict = (uint32_t)verdict;
    s->cause = (uint32_t)cause;
    s->value = value;
    s->due = 1;
}

/* Put a value behind the others of a list of `size`, whose oldest goes. */
static void push(double *list, uint32_t count, uint32_t size, double value)
{
    if (count == size) memmove(list, list + 1, (size - 1) * sizeof *list);
    list[count == size ? size - 1 : count] = value;
}

/* The least that all `count` values are, with the sign of the first, less `sigmas` deviations. */
static double least_of(const double *values, const double *deviations, int count, double sigmas)
{
    double least = 1e9;
    const double sign = values[0] < 0 ? -1 : 1;
    for (int i = 0; i < count; i++) {
        const double sure = sign * values[i] - sigmas * deviations[i];
        if (sure < least) least = sure;
    }
    return least;
}

/* The largest of `count` changes that is beyond a limit for large ones; 0: none. */
static double large_change(const double *change, const double *sigma, int count)
{
    double largest = 0;
    for (int i = 0; i < count; i++) {
        const double size = change[i] < 0 ? -change[i] : change[i];
        if (size > change_limit && size > change_sigmas * sigma[i] &&
            size * size > largest * largest)
            largest = change[i];
    }
    return largest;
}

static void judge_change(struct fv_calibration_state *s)
{
    const int all = FV_CALIBRATION_FRAMES, pair = 2;
    if (s->changes < (uint32_t)all) return;
    const double *change = s->change + all - pair, *sigma = s->sigma + all - pair,
                 large = large_change(change, sigma, pair);
    const bool agrees = least_of(change, sigma, pair, change_again_sigmas) > 0;
    const bool lasts = least_of(s->change, s->sigma, all, 0) > change_lasting &&
                       least_of(s->change, s->sigma, all, change_sigmas) > 0;
    if ((large != 0 && agrees) || lasts)
        decide(s, FOVEA_CALIBRATION_WRONG,
               s->steady >= FV_CALIBRATION_STEADY ? FOVEA_CALIBRATION_CHANGED
                                                  : FOVEA_CALIBRATION_UNFIT,
               large != 0 ? large : s->change[0]);
    else if (s->steady < FV_CALIBRATION_STEADY)
        s->steady++;
}

static void judge_mismatch(struct fv_calibration_state *s)
{
    const int count = FV_CALIBRATION_WINDOWS;
    if (s->windows < (uint32_t)count) return;
    const double least = least_of(s->mismatch, s->mismatch_sigma, count, mismatch_sigmas),
                 value = s->mismatch[count - 1];
    if (least > mismatch_wrong)
        decide(s, FOVEA_CALIBRATION_WRONG, FOVEA_CALIBRATION_UNFIT, value);
    else if (least > mismatch_doubtful)
        decide(s, FOVEA_CALIBRATION_DOUBTFUL, FOVEA_CALIBRATION_UNFIT, value);
}

/* ---- frames ---------------------------------------------------------------------------------- */

static void parts_fade(struct fv_calibration_state *s, const struct fv_lens_frame *frame)
{
    s->error2 = fading * s->error2 + frame->error2;
    s->error2_fitted = fading * s->error2_fitted + frame->error2_fitted;
    s->points = fading * s->points + frame->points;
    for (int part = 0; part < FV_MAP_PARTS; part++) {
        s->part_points[part] = fading * s->part_points[part] + frame->part_points[part];
        for (int r = 0; r < 2; r++)
            s->part_sum_px[part][r] =
                fading * s->part_sum_px[part][r] + (double)frame->part_sum_px[part][r];
    }
}

void fv_calibration_frame(struct fv_calibration *c, const struct fv_odometry *odometry,
                          const struct fv_frame_id *id)
{
    struct fv_calibration_state *s = c->state;
    const struct fovea_pose *pose = fv_odometry_pose(odometry);
    struct fv_lens_frame frame;
    if (pose->map_id != s->map_id || pose->reset_counter != s->reset_counter) {
        s->map_id = pose->map_id; /* another map, which may know the lens or not */
        s->reset_counter = pose->reset_counter;
        s->changes = s->windows = s->steady = 0;
    }
    if (!fv_lens_frame_measure(odometry, &frame)) return;
    push(s->change, s->changes, FV_CALIBRATION_FRAMES, frame.change);
    push(s->sigma, s->changes, FV_CALIBRATION_FRAMES, frame.sigma);
    if (s->changes < FV_CALIBRATION_FRAMES) s->changes++;
    parts_fade(s, &frame);
    s->frame = *id;
    if (s->frames++ % MESSAGE_FRAMES == 0) s->due = 1;
    judge_change(s);
}

/* ---- windows --------------------------------------------------------------------------------- */

bool fv_calibration_waiting(const struct fv_calibration *c, const struct fv_odometry *odometry)
{
    return c->state->due || c->window.state->phase != FV_LENS_IDLE ||
           fv_lens_window_due(odometry, c->state->looked_newest);
}

void fv_calibration_unit(struct fv_calibration *c, const struct fv_odometry *odometry)
{
    struct fv_calibration_state *s = c->state;
    struct fv_lens_mismatch found;
    if (c->window.state->phase == FV_LENS_IDLE) {
        if (!fv_lens_window_due(odometry, s->looked_newest)) return;
        s->looked_newest = fv_lens_window_begin(&c->window, odometry);
        return;
    }
    if (!fv_lens_window_unit(&c->window, odometry, &found)) return;
    s->looked_newest = found.newest;
    push(s->mismatch, s->windows, FV_CALIBRATION_WINDOWS, found.mismatch);
    push(s->mismatch_sigma, s->windows, FV_CALIBRATION_WINDOWS, found.sigma);
    if (s->windows < FV_CALIBRATION_WINDOWS) s->windows++;
    judge_mismatch(s);
}

/* ---- what it says ---------------------------------------------------------------------------- */

static char *append(char *to, const char *end, const char *text)
{
    while (*text != '\0' && to < end)
        *to++ = *text++;
    *to = '\0';
    return to;
}

/* Tenths as "12.3". */
static char *append_tenths(char *to, const char *end, uint32_t tenths)
{
    char digits[16];
    int at = (int)sizeof digits - 1;
    digits[at] = '\0';
    digits[--at] = (char)('0' + tenths % 10);
    digits[--at] = '.';
    tenths /= 10;
    do {
        digits[--at] = (char)('0' + tenths % 10);
        tenths /= 10;
    } while (tenths > 0);
    return append(to, end, digits + at);
}

/* Of a focal length that differs by `value`: "2.1 % longer". */
static char *append_difference(char *to, const char *end, double value)
{
    const double limit = 0.25, size = value < 0 ? -value : value;
    const bool far = size > limit; /* a step of Newton says no more there */
    if (far) to = append(to, end, "more than ");
    const double percent = 100 * (fv_exp(far ? (value < 0 ? -limit : limit) : value) - 1);
    to = append_tenths(to, end, (uint32_t)(10 * (percent < 0 ? -percent : percent) + 0.5));
    return append(to, end, value < 0 ? " % shorter" : " % longer");
}

void fv_calibration_get(const struct fv_calibration *c, struct fovea_calibration *found)
{
    const struct fv_calibration_state *s = c->state;
    memset(found, 0, sizeof *found);
    found->state = (enum fovea_calibration_state)s->verdict;
    found->cause = (enum fovea_calibration_cause)s->cause;
    found->focal_difference = s->value;
    if (s->verdict == FOVEA_CALIBRATION_OK) return;
    const char *const end = found->reason + sizeof found->reason - 1;
    char *at = append(found->reason, end, "the focal length is ");
    at = append_difference(at, end, s->value);
    append(at, end,
           s->cause == FOVEA_CALIBRATION_CHANGED
               ? " than before: the lens moved; calibrate again"
               : " than the calibration says: wrong or old file; calibrate again");
}

uint32_t fv_calibration_encode(struct fv_calibration *c, uint8_t *buffer, size_t capacity)
{
    struct fv_calibration_state *s = c->state;
    struct fovea_calibration found;
    struct fv_message_calibration message = {
        .stamp = fv_frame_id_stamp(&s->frame),
        .calibration = &found,
        .frames = s->frames,
        .columns = FV_MAP_PART_COLUMNS,
        .rows = FV_MAP_PART_ROWS,
    };
    fv_calibration_get(c, &found);
    if (s->points > 0) {
        message.rms_px = (float)__builtin_sqrt(s->error2 / s->points);
        message.expected_px = (float)__builtin_sqrt(s->error2_fitted / s->points);
    }
    for (int part = 0; part < FV_MAP_PARTS; part++) {
        const double points = s->part_points[part];
        message.samples[part] = (int32_t)(points + 0.5);
        for (int r = 0; r < 2; r++)
            message.mean_px[part][r] = message.samples[part] > 0
                                           ? (float)(s->part_sum_px[part][r] / points)
                                           : __builtin_nanf("");
    }
    s->due = 0;
    return fv_message_calibration_encode(&message, buffer, capacity);
}

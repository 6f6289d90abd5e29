/* Two sources as one rig, their frames matched by stamp:
 *
 *     pair:URI and URI [within MS]
 *     pair:v4l2:/dev/v4l/by-id/left?format=GREY and v4l2:/dev/v4l/by-id/right?format=GREY within 4
 *
 * A frame of each whose stamps are at most MS milliseconds apart (default: a quarter of the first
 * one's frame period, at most 10 ms) becomes one frame, with the stamp of the first, and its
 * cameras before those of the second. The stamps must be of one clock. A frame of the second that
 * fits none is dropped and counted; one of the first goes on alone, its partner's pictures absent,
 * so that the rig goes on when the second camera is covered, late or gone. Two frames wait at most,
 * one of each; nothing is copied.
 *
 * The first " and " of the address divides it, and the last " within " behind that begins the
 * bound: a first URI with " and " in it, as of a folder of such a name, cannot be stated; a second
 * one with " within " only with a bound behind it.
 *
 * Truth, samples, state and selection are the first source's, and so is the body: a velocity
 * command is for the first, and the second has it too where it can be driven. Two that wait for the
 * answer to each frame count their frames alike, from 0. Where the second's cameras stand on the
 * body is for the calibration file to say (cam0, cam1 of a camchain). */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "clock.h"
#include "pair.h"
#include "support/text.h"
#include "table.h"

enum { ADDRESS_MAX = 4096, SIDES = 2 };

static const double bound_max_ms = 10, rate_unknown_hz = 30;

struct side {
    const struct fovea_source_ops *ops;
    struct fovea_source *source;
    bool waits; /* a frame that is in no pair yet */
    struct fovea_frame frame;
};

struct held {
    bool used, both;
    struct fovea_frame own[SIDES]; /* as the sources gave them */
};

struct fovea_source { /* NOLINT(clang-analyzer-optin.performance.Padding): in order of meaning */
    struct fovea_source_info info;
    struct side sides[SIDES];
    int64_t bound_ns, period_ns;
    int64_t patience_ns; /* the second one is waited for as long, more where it comes later */
    bool any_alone;
    int64_t alone_ns; /* stamp of the last frame that went alone */
    struct held held[FOVEA_SOURCE_FRAMES_HELD_MAX];
    uint32_t held_max;
    uint64_t unmatched;                           /* frames of the second without a partner */
    bool second_away;                             /* the last frame went alone */
    double requested[FOVEA_SOURCE_CONTROL_COUNT]; /* of both, the last */
};

/* ---- opening --------------------------------------------------------------------------------- */

static void pair_close(struct fovea_source *source)
{
    for (int i = 0; i < SIDES; i++)
        if (source->sides[i].source != NULL) source->sides[i].ops->close(source->sides[i].source);
    free(source);
}

static enum fovea_status refuse(const char *found, struct fovea_error *error)
{
    return fovea_error_set(
        error, FOVEA_ERROR_INPUT,
        "pair: found '%.200s', expected 'URI and URI' or 'URI and URI within MS'", found);
}

/* The two URIs and the bound (0: none is stated) of an address, which is cut up. */
static enum fovea_status parse(char *text, const char *uris[SIDES], double *bound_ms,
                               struct fovea_error *error)
{
    static const char between[] = " and ", bound[] = " within ";
    char *middle = strstr(text, between);
    *bound_ms = 0;
    if (middle == NULL || middle == text) return refuse(text, error);
    char *second = middle + sizeof between - 1, *limit = NULL;
    for (char *at = second; (at = strstr(at, bound)) != NULL; at++)
        limit = at;
    if (limit != NULL) {
        const char *value = limit + sizeof bound - 1;
        if (!fv_text_number(value, bound_ms) || !(*bound_ms > 0 && *bound_ms <= 1000))
            return fovea_error_set(
                error, FOVEA_ERROR_INPUT,
                "pair: within: found '%.60s', expected milliseconds above 0, up to 1000", value);
        *limit = '\0';
    }
    if (*second == '\0') return refuse(text, error);
    *middle = '\0';
    uris[0] = text;
    uris[1] = second;
    return FOVEA_OK;
}

static enum fovea_status side_open(struct side *side, const char *uri,
                                   const struct fovea_source_selection *selection,
                                   struct fovea_error *error)
{
    const char *address;
    const enum fovea_status status = fv_source_find(uri, &side->ops, &address, error);
    return status == FOVEA_OK ? side->ops->open(address, selection, &side->source, error) : status;
}

static const struct fovea_source_info *info_of(const struct fovea_source *source, int i)
{
    return source->sides[i].ops->info(source->sides[i].source);
}

/* What of the second is unlike the first and must not be. */
static enum fovea_status check_fit(const struct fovea_source *source, struct fovea_error *error)
{
    const struct fovea_source_info *a = info_of(source, 0), *b = info_of(source, 1);
    const uint32_t cameras = a->rig.camera_count + b->rig.camera_count;
    if (cameras > FOVEA_CAMERAS_MAX)
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "pair: found %u cameras in both, expected at most %d", cameras,
                               FOVEA_CAMERAS_MAX);
    if (a->format != b->format)
        return fovea_error_set(
            error, FOVEA_ERROR_INPUT,
            "pair: found pictures of %s and of %s, expected one format (option format=)",
            fovea_pixel_format_name(a->format), fovea_pixel_format_name(b->format));
    if (a->live != b->live)
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "pair: found a camera beside a recording, expected two of a kind");
    return FOVEA_OK;
}

/* The first one's info with the cameras of the second behind its own. */
static void info_make(struct fovea_source *source, double bound_ms)
{
    const struct fovea_source_info *b = info_of(source, 1);
    struct fovea_source_info *info = &source->info;
    *info = *info_of(source, 0);
    for (uint32_t i = 0; i < b->rig.camera_count; i++) {
        const uint32_t at = info->rig.camera_count++;
        info->cameras[at] = b->cameras[i];
        info->rig.cameras[at] = b->rig.cameras[i];
        info->rig.cameras[at].has_T_body_cam = false; /* its body may be another */
    }
    info->heap_bytes += b->heap_bytes + sizeof *source;
    const double period_ms = 1000 / (info->rate_hz > 0 ? info->rate_hz : rate_unknown_hz),
                 quarter_ms = period_ms / 4 < bound_max_ms ? period_ms / 4 : bound_max_ms;
    source->bound_ns = (int64_t)((bound_ms > 0 ? bound_ms : quarter_ms) * 1e6);
    source->period_ns = (int64_t)(period_ms * 1e6);
    source->patience_ns = source->period_ns / 2;
}

static bool pair_takes_device(const char *address)
{
    char text[ADDRESS_MAX];
    const char *uris[SIDES];
    double bound_ms;
    if (strlen(address) >= sizeof text) return false;
    memcpy(text, address, strlen(address) + 1);
    return parse(text, uris, &bound_ms, NULL) == FOVEA_OK &&
           (fv_source_takes_device(uris[0]) || fv_source_takes_device(uris[1]));
}

static enum fovea_status pair_open(const char *address,
                                   const struct fovea_source_selection *selection,
                                   struct fovea_source **source, struct fovea_error *error)
{
    char text[ADDRESS_MAX];
    const char *uris[SIDES] = {"", ""};
    double bound_ms;
    if (strlen(address) >= sizeof text)
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "pair: found more than %d bytes, expected less", ADDRESS_MAX - 1);
    memcpy(text, address, strlen(address) + 1);
    enum fovea_status status = parse(text, uris, &bound_ms, error);
    if (status != FOVEA_OK) return status;
    struct fovea_source *opened = calloc(1, sizeof *opened);
    if (opened == NULL) return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "pair: out of memory");
    opened->held_max = fv_source_frames_held(selection);
    for (int i = 0; i < SIDES && status == FOVEA_OK; i++)
        status = side_open(&opened->sides[i], uris[i], selection, error);
    if (status == FOVEA_OK) status = check_fit(opened, error);
    if (status != FOVEA_OK) {
        pair_close(opened);
        return status;
    }
    info_make(opened, bound_ms);
    opened->requested[FOVEA_SOURCE_GAIN] = -1;
    *source = opened;
    return FOVEA_OK;
}

static const struct fovea_source_info *pair_info(const struct fovea_source *source)
{
    return &source->info;
}

static enum fovea_status pair_start(struct fovea_source *source, struct fovea_error *error)
{
    struct side *first = &source->sides[0], *second = &source->sides[1];
    enum fovea_status status = first->ops->start(first->source, error);
    if (status != FOVEA_OK) return status;
    status = second->ops->start(second->source, error);
    if (status != FOVEA_OK) first->ops->stop(first->source);
    return status;
}

static void give_back(struct side *side)
{
    if (side->waits) side->ops->requeue(side->source, &side->frame);
    side->waits = false;
}

static void pair_stop(struct fovea_source *source)
{
    for (int i = 0; i < SIDES; i++) {
        give_back(&source->sides[i]);
        source->sides[i].ops->stop(source->sides[i].source);
    }
}

/* ---- frames ---------------------------------------------------------------------------------- */

static enum fovea_status side_take(struct side *side, int64_t deadline_ns)
{
    if (side->waits) return FOVEA_OK;
    const enum fovea_status status = side->ops->dequeue(side->source, deadline_ns, &side->frame);
    side->waits = status == FOVEA_OK;
    return status;
}

/* How long a second camera may take: not at all while it has nothing and is known to be late. A
 * second recording is waited for, if need be by the next call. */
static int64_t second_deadline(const struct fovea_source *source, int64_t deadline_ns)
{
    if (!source->info.live) return deadline_ns;
    if (source->second_away) return 0;
    const int64_t until_ns = fv_clock_ns(CLOCK_MONOTONIC) + source->patience_ns;
    return until_ns < deadline_ns ? until_ns : deadline_ns;
}

/* b's stamp less a's; at the ends of the range, the end. */
static int64_t apart(int64_t b_ns, int64_t a_ns)
{
    int64_t apart_ns;
    if (!__builtin_sub_overflow(b_ns, a_ns, &apart_ns)) return apart_ns;
    return b_ns < a_ns ? INT64_MIN : INT64_MAX;
}

/* A frame of the second that is of no use. Had its partner waited longer, it would have been: then
 * the next ones do. */
static void second_drop(struct fovea_source *source)
{
    struct side *second = &source->sides[1];
    const int64_t since_ns = apart(second->frame.stamp_ns, source->alone_ns);
    if (source->any_alone && since_ns >= -source->bound_ns && since_ns <= source->bound_ns) {
        const int64_t more_ns = source->patience_ns + source->period_ns / 4;
        source->patience_ns = more_ns < source->period_ns ? more_ns : source->period_ns;
    }
    source->second_away = false;
    source->unmatched++;
    give_back(second);
}

/* Bring the second one's frame up to the waiting one of the first. FOVEA_OK: they are a pair;
 * FOVEA_END: the first one has no partner; FOVEA_AGAIN: it may still have; negative: the second has
 * failed. */
static enum fovea_status partner_take(struct fovea_source *source, int64_t deadline_ns)
{
    const struct fovea_frame *a = &source->sides[0].frame;
    struct side *second = &source->sides[1];
    for (;;) {
        const enum fovea_status status = side_take(second, second_deadline(source, deadline_ns));
        if (status < 0 || (status == FOVEA_AGAIN && !source->info.live)) return status;
        if (status != FOVEA_OK) return FOVEA_END;
        const int64_t apart_ns = apart(second->frame.stamp_ns, a->stamp_ns);
        const bool one_clock = a->clock == second->frame.clock;
        if (one_clock && apart_ns > source->bound_ns) return FOVEA_END; /* of a later one */
        if (one_clock && apart_ns >= -source->bound_ns) return FOVEA_OK;
        second_drop(source);
    }
}

/* The pictures and stamps of b behind those of a. */
static void join(struct fovea_frame *frame, const struct fovea_frame *b, uint32_t cameras)
{
    for (uint32_t i = 0; i < cameras; i++) {
        const uint32_t at = frame->image_count++;
        frame->images[at] = (struct fovea_image){.data = NULL};
        frame->offset_ns[at] = frame->exposure_ns[at] = 0;
        if (b == NULL || i >= b->image_count) continue;
        frame->images[at] = b->images[i];
        frame->offset_ns[at] = b->offset_ns[i] + b->stamp_ns - frame->stamp_ns;
        frame->exposure_ns[at] = b->exposure_ns[i];
    }
}

static enum fovea_status pair_dequeue(struct fovea_source *source, int64_t deadline_ns,
                                      struct fovea_frame *frame)
{
    struct side *first = &source->sides[0], *second = &source->sides[1];
    uint32_t slot = 0;
    while (slot < source->held_max && source->held[slot].used)
        slot++;
    if (slot == source->held_max) return FOVEA_AGAIN;
    enum fovea_status status = side_take(first, deadline_ns);
    if (status == FOVEA_OK) status = partner_take(source, deadline_ns);
    if (!first->waits || status < 0 || status == FOVEA_AGAIN) return status;
    struct held *held = &source->held[slot];
    held->both = status == FOVEA_OK;
    held->used = true;
    held->own[0] = first->frame;
    first->waits = false;
    *frame = held->own[0];
    frame->slot = slot;
    if (held->both) {
        held->own[1] = second->frame;
        second->waits = false;
    }
    if (!held->both) {
        source->alone_ns = held->own[0].stamp_ns;
        source->any_alone = true;
    }
    source->second_away = !held->both && !second->waits;
    join(frame, held->both ? &held->own[1] : NULL, info_of(source, 1)->rig.camera_count);
    return FOVEA_OK;
}

static void pair_requeue(struct fovea_source *source, const struct fovea_frame *frame)
{
    struct held *held = &source->held[frame->slot];
    for (int i = 0; i < (held->both ? 2 : 1); i++)
        source->sides[i].ops->requeue(source->sides[i].source, &held->own[i]);
    held->used = false;
}

/* ---- what the sources say, passed on --------------------------------------------------------- */

static enum fovea_status pair_truth(struct fovea_source *source, const struct fovea_frame *frame,
                                    struct fovea_truth *truth)
{
    const struct side *first = &source->sides[0];
    if (first->ops->truth == NULL) return FOVEA_ERROR_UNSUPPORTED;
    return first->ops->truth(first->source, &source->held[frame->slot].own[0], truth);
}

static enum fovea_status pair_truth_pose(struct fovea_source *source,
                                         const struct fovea_frame *frame, double T_world_cam[12])
{
    const struct side *first = &source->sides[0];
    if (first->ops->truth_pose == NULL) return FOVEA_ERROR_UNSUPPORTED;
    return first->ops->truth_pose(first->source, &source->held[frame->slot].own[0], T_world_cam);
}

static uint32_t pair_samples(struct fovea_source *source, const struct fovea_frame *frame,
                             struct fovea_sample *samples, uint32_t count_max)
{
    const struct side *first = &source->sides[0];
    if (first->ops->samples == NULL) return 0;
    return first->ops->samples(first->source, &source->held[frame->slot].own[0], samples,
                               count_max);
}

/* Delivered are the frames of the first, also those that went alone; what either lost, and the
 * second had no partner for, is dropped. */
static void pair_counts(const struct fovea_source *source, struct fovea_source_counts *counts)
{
    *counts = (struct fovea_source_counts){.dropped = source->unmatched};
    for (int i = 0; i < SIDES; i++) {
        struct fovea_source_counts own = {0};
        const struct side *side = &source->sides[i];
        if (side->ops->counts != NULL) side->ops->counts(side->source, &own);
        if (i == 0) counts->delivered = own.delivered;
        counts->missing += own.missing;
        counts->damaged += own.damaged;
        counts->dropped += own.dropped;
        counts->recovered += own.recovered;
    }
}

static enum fovea_source_state pair_state(const struct fovea_source *source)
{
    const struct side *first = &source->sides[0];
    return first->ops->state != NULL ? first->ops->state(first->source) : FOVEA_SOURCE_OK;
}

static enum fovea_status pair_complaint(struct fovea_source *source, struct fovea_error *error)
{
    for (int i = 0; i < SIDES; i++) {
        const struct side *side = &source->sides[i];
        if (side->ops->complaint == NULL) continue;
        const enum fovea_status status = side->ops->complaint(side->source, error);
        if (status != FOVEA_AGAIN) return status;
    }
    return FOVEA_AGAIN;
}

/* Both, or none: where the second refuses, the first goes back. */
static enum fovea_status pair_control(struct fovea_source *source,
                                      enum fovea_source_control control, double value,
                                      struct fovea_error *error)
{
    struct side *first = &source->sides[0], *second = &source->sides[1];
    struct fovea_error said = {.text = ""}, unused;
    enum fovea_status status = fv_source_control(first->ops, first->source, control, value, error);
    if (status != FOVEA_OK) return status;
    status = fv_source_control(second->ops, second->source, control, value, &said);
    if (status == FOVEA_OK)
        source->requested[control] = value;
    else
        (void)fv_source_control(first->ops, first->source, control, source->requested[control],
                                &unused);
    if (error != NULL && (status != FOVEA_OK || error->text[0] == '\0')) *error = said;
    return status;
}

/* The first has it before the second, which need not be driven. */
static enum fovea_status pair_drive(struct fovea_source *source,
                                    const struct fovea_velocity_command *command,
                                    struct fovea_error *error)
{
    const struct side *first = &source->sides[0], *second = &source->sides[1];
    enum fovea_status status = fv_source_drive(first->ops, first->source, command, error);
    if (status != FOVEA_OK) return status;
    struct fovea_error said = {.text = ""};
    status = fv_source_drive(second->ops, second->source, command, &said);
    if (status == FOVEA_OK || status == FOVEA_ERROR_UNSUPPORTED) return FOVEA_OK;
    if (error != NULL) *error = said;
    return status;
}

static enum fovea_status pair_failure(const struct fovea_source *source, struct fovea_error *error)
{
    for (int i = 0; i < SIDES; i++) {
        const struct side *side = &source->sides[i];
        const enum fovea_status status = fv_source_failure(side->ops, side->source, error);
        if (status != FOVEA_AGAIN) return status;
    }
    return FOVEA_AGAIN;
}

static void pair_reads(const struct fovea_source *source,
                       void (*visit)(void *context, const char *path), void *context)
{
    for (int i = 0; i < SIDES; i++)
        if (source->sides[i].ops->reads != NULL)
            source->sides[i].ops->reads(source->sides[i].source, visit, context);
}

const struct fovea_source_ops fv_source_pair = {
    .name = "pair",
    .help = "URI and URI [within MS]  two cameras as one rig, frames matched by stamp",
    .open = pair_open,
    .info = pair_info,
    .start = pair_start,
    .dequeue = pair_dequeue,
    .requeue = pair_requeue,
    .stop = pair_stop,
    .close = pair_close,
    .truth = pair_truth,
    .truth_pose = pair_truth_pose,
    .samples = pair_samples,
    .counts = pair_counts,
    .state = pair_state,
    .complaint = pair_complaint,
    .reads = pair_reads,
    .control = pair_control,
    .drive = pair_drive,
    .failure = pair_failure,
    .takes_device = pair_takes_device,
};

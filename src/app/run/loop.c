#include "app/run/loop.h"

#include "app/run/heap.h"
#include "app/run/realtime.h"
#include "drivers/clock.h"

static const int64_t poll_ns = 100000000;      /* how long to wait before looking at `stop` again */
static const int64_t gap_max_ns = 10000000000; /* a longer gap between stamps is not waited for */

static int64_t now_ns(void)
{
    return fv_clock_ns(CLOCK_MONOTONIC);
}

static bool stopped(const struct fv_loop *loop)
{
    return atomic_load_explicit(&loop->shared->stop, memory_order_relaxed);
}

static void sleep_until(const struct fv_loop *loop, int64_t due_ns)
{
    for (int64_t now = now_ns(); now < due_ns && !stopped(loop); now = now_ns()) {
        atomic_fetch_add_explicit(&loop->shared->beats, 1, memory_order_relaxed);
        int64_t until = due_ns - now > poll_ns ? now + poll_ns : due_ns;
        const struct timespec time = fv_clock_timespec(until);
        clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &time, NULL);
    }
}

/* ---- pace ------------------------------------------------------------------------------------ */

/* When a frame of a source that is not live is due. `asked_ns`: when the loop began to ask for it.
 */
static int64_t due_of(struct fv_loop *loop, const struct fovea_frame *frame, int64_t asked_ns)
{
    int64_t now = now_ns(), gap = 0;
    bool odd = __builtin_sub_overflow(frame->stamp_ns, loop->last_stamp_ns, &gap) || gap <= 0 ||
               gap > gap_max_ns;
    if (!loop->any_frame) {
        loop->last_due_ns = now;
    } else if (odd) { /* repeats, goes back or leaps: a new start, one period on */
        loop->last_due_ns = (loop->last_due_ns > now ? loop->last_due_ns : now) + loop->period_ns;
    } else {
        loop->last_due_ns += gap;
        /* Waiting for the source is not the loop's lateness: the schedule moves on with it. */
        int64_t waited_from = loop->last_due_ns > asked_ns ? loop->last_due_ns : asked_ns;
        if (now > waited_from) loop->last_due_ns += now - waited_from;
    }
    loop->last_stamp_ns = frame->stamp_ns;
    loop->any_frame = true;
    return loop->last_due_ns;
}

/* Whether to drop a frame that was due `late_ns` ago. A dropped frame tells apart a busy loop from
 * one that had no processor: `own_late_ns` is how late it would be had the loop had a processor to
 * itself, by what it used of one since the frame before.
 */
static bool too_late(struct fv_loop *loop, int64_t due_ns, int64_t late_ns)
{
    const int64_t cpu_ns = fv_clock_ns(CLOCK_THREAD_CPUTIME_ID);
    const int64_t late_max_ns = FV_LOOP_QUEUE * loop->period_ns;
    loop->own_late_ns += cpu_ns - loop->mark_cpu_ns - (due_ns - loop->mark_due_ns);
    if (loop->own_late_ns < 0) loop->own_late_ns = 0;
    loop->mark_cpu_ns = cpu_ns;
    loop->mark_due_ns = due_ns;
    if (late_ns <= late_max_ns) return false;
    loop->counts.late++;
    if (loop->own_late_ns <= late_max_ns) loop->counts.starved++;
    return true;
}

/* ---- taking a frame -------------------------------------------------------------------------- */

enum taken { TAKEN_FRAME, TAKEN_NONE, TAKEN_END };

static enum taken take_frame(struct fv_loop *loop, struct fovea_frame *frame, int64_t *late_ns)
{
    const bool live = loop->ops->info(loop->source)->live;
    /* A camera's frame may be late by a period; while none comes, the loop goes on at its rate. */
    const int64_t wanted_ns = (loop->waiting ? 1 : 2) * loop->period_ns;
    const int64_t patience_ns = live && wanted_ns < poll_ns ? wanted_ns : poll_ns;
    int64_t asked_ns = now_ns();
    while (!stopped(loop)) {
        int64_t deadline_ns = now_ns() + patience_ns;
        atomic_fetch_add_explicit(&loop->shared->beats, 1, memory_order_relaxed);
        enum fovea_status status = loop->ops->dequeue(loop->source, deadline_ns, frame);
        if (status == FOVEA_GONE) sleep_until(loop, deadline_ns);
        if (status == FOVEA_END || status < 0) {
            loop->status = status;
            return TAKEN_END;
        }
        if (status != FOVEA_OK) {
            loop->waiting = live;
            if (live) return TAKEN_NONE;
            continue;
        }
        loop->waiting = false;
        loop->counts.in++;
        if (live || !loop->real_time) return TAKEN_FRAME;
        int64_t due_ns = due_of(loop, frame, asked_ns);
        sleep_until(loop, due_ns);
        *late_ns = now_ns() - due_ns;
        if (!too_late(loop, due_ns, *late_ns)) return TAKEN_FRAME;
        loop->ops->requeue(loop->source, frame);
        asked_ns = now_ns();
    }
    return TAKEN_END;
}

/* Times of a live frame. Recordings carry stamps of another clock: there, latency is what pacing
 * measured. */
static void tell_times(struct fv_loop *loop, const struct fovea_frame *given, int64_t late_ns,
                       struct fovea_inputs *inputs)
{
    const struct fovea_frame *frame = inputs->frame;
    bool live = loop->ops->info(loop->source)->live;
    inputs->now_ns = given != NULL ? given->stamp_ns : loop->last_stamp_ns;
    inputs->latency_ns = loop->real_time && !live ? late_ns : 0;
    if (!live) return;
    if (frame != NULL) loop->clock = frame->clock; /* that of steps without one, too */
    const clockid_t clock = fv_clock_of(loop->clock);
    int64_t now = fv_clock_ns(clock);
    inputs->utc_offset_ns = clock != CLOCK_REALTIME ? fv_clock_ns(CLOCK_REALTIME) - now : 0;
    if (frame != NULL) inputs->latency_ns = now - frame->stamp_ns;
    if (frame == NULL) inputs->now_ns = now;
}

/* Whether any camera gave an image. */
static bool has_image(const struct fovea_frame *frame)
{
    bool any = false;
    for (uint32_t i = 0; i < frame->image_count; i++)
        any = any || frame->images[i].data != NULL;
    return any;
}

/* Images of each camera that a step has processed. */
static void count_images(struct fv_loop *loop, const struct fovea_frame *frame)
{
    for (uint32_t i = 0; i < frame->image_count; i++)
        if (frame->images[i].data != NULL)
            atomic_fetch_add_explicit(&loop->shared->images[i], 1, memory_order_relaxed);
}

/* `given`: what the source gave, or NULL. Without any image it is a step without a frame, at the
 * time of its stamp. */
static void fill_inputs(struct fv_loop *loop, const struct fovea_frame *given, int64_t late_ns,
                        struct fovea_inputs *inputs)
{
    *inputs = (struct fovea_inputs){.frames_late = loop->counts.late};
    if (given != NULL && has_image(given)) inputs->frame = given;
    tell_times(loop, given, late_ns, inputs);
    if (loop->ops->state != NULL) inputs->source_state = loop->ops->state(loop->source);
    if (loop->ops->counts != NULL) loop->ops->counts(loop->source, &inputs->source_counts);
    if (loop->hooks.commands != NULL) inputs->commands = loop->hooks.commands(loop->hooks.context);
    inputs->temperature_c =
        atomic_load_explicit(&loop->shared->temperature_c, memory_order_relaxed);
    inputs->resident_bytes =
        atomic_load_explicit(&loop->shared->resident_bytes, memory_order_relaxed);
    if (loop->real_time) {
        const uint32_t share = atomic_load_explicit(&loop->shared->share, memory_order_relaxed);
        loop->governor.period_ns = share > 0 ? loop->period_ns / 100 * share : loop->period_ns;
        fovea_governor_next(&loop->governor, loop->config, &inputs->grants);
    } else {
        fovea_grants_fixed(loop->config, &inputs->grants);
    }
    if (loop->hooks.sense != NULL) loop->hooks.sense(loop->hooks.context, given, inputs);
}

/* ---- one iteration --------------------------------------------------------------------------- */

struct span {
    int64_t wall_ns, cpu_ns;
};

static struct span span_begin(void)
{
    struct span span;
    fv_timing_clock(NULL, &span.wall_ns, &span.cpu_ns);
    return span;
}

static struct span span_end(struct span begin)
{
    struct span end = span_begin();
    return (struct span){end.wall_ns - begin.wall_ns, end.cpu_ns - begin.cpu_ns};
}

static void pair_add(struct fv_times_pair *pair, struct span span)
{
    fv_histogram_add(&pair->cpu, span.cpu_ns);
    fv_histogram_add(&pair->wall, span.wall_ns);
}

/* Times of processed frames only: a step without a frame would flatter them. */
static void account(struct fv_loop *loop, struct span step, struct span work, int64_t latency_ns)
{
    struct fv_timings *timings = loop->timings;
    struct span frame = {step.wall_ns + work.wall_ns, step.cpu_ns + work.cpu_ns};
    struct fovea_stats stats;
    fovea_stats_get(loop->rt, &stats);
    for (int i = 0; i < FOVEA_STAGE_COUNT; i++)
        pair_add(&timings->stages[i], (struct span){stats.stage_wall_ns[i], stats.stage_cpu_ns[i]});
    pair_add(&timings->step, step);
    pair_add(&timings->work, work);
    pair_add(&timings->frame, frame);
    if (loop->real_time) fv_histogram_add(&timings->latency, latency_ns);
    fv_curve_add(&timings->step_curve, step.cpu_ns);
    fv_curve_add(&timings->frame_curve, frame.cpu_ns);
    atomic_store_explicit(&loop->shared->features, stats.features, memory_order_relaxed);
    atomic_store_explicit(&loop->shared->step_ns, step.cpu_ns, memory_order_relaxed);
}

static void iteration(struct fv_loop *loop, const struct fovea_frame *given, int64_t late_ns)
{
    const struct fv_loop_hooks *hooks = &loop->hooks;
    struct fovea_inputs inputs;
    struct fovea_outputs outputs;
    struct fovea_pose pose;
    fill_inputs(loop, given, late_ns, &inputs);
    struct fovea_grants grants = inputs.grants;

    struct span begin = span_begin();
    enum fovea_status status = fovea_step(loop->rt, &inputs, &outputs);
    struct span step = span_end(begin);
    fovea_pose_get(loop->rt, &pose);
    if (hooks->step_done != NULL)
        hooks->step_done(hooks->context, &inputs, &outputs, status == FOVEA_OK ? &pose : NULL);

    if (loop->real_time)
        fovea_governor_work(&loop->governor, step.cpu_ns, outputs.jobs_waiting, &grants);
    begin = span_begin();
    fovea_work(loop->rt, &grants, &outputs);
    struct span work = span_end(begin);
    if (hooks->work_done != NULL) hooks->work_done(hooks->context, &inputs, &grants, &outputs);

    if (loop->real_time) fovea_governor_learn(&loop->governor, step.cpu_ns, work.cpu_ns, &outputs);
    if (status == FOVEA_OK) account(loop, step, work, inputs.latency_ns);
    if (status == FOVEA_OK) count_images(loop, inputs.frame);
    loop->counts.processed += status == FOVEA_OK;
    loop->counts.posed += status == FOVEA_OK && pose.posed;
    loop->counts.lost += status == FOVEA_OK && pose.state == FOVEA_TRACKING_LOST;
    loop->counts.refused += inputs.frame != NULL && status != FOVEA_OK;
    loop->counts.without_frame += inputs.frame == NULL;
    atomic_store_explicit(&loop->shared->frames, loop->counts.in, memory_order_relaxed);
    atomic_store_explicit(&loop->shared->pictures, loop->counts.processed, memory_order_relaxed);
    atomic_store_explicit(&loop->shared->dropped, loop->counts.late + inputs.source_counts.dropped,
                          memory_order_relaxed);
}

static void prepare(struct fv_loop *loop)
{
    double rate_hz = loop->ops->info(loop->source)->rate_hz;
    loop->period_ns = rate_hz >= 0.1 && rate_hz <= 10000.0
                          ? (int64_t)((double)FV_SECOND_NS / rate_hz)
                          : FV_SECOND_NS / 30;
    fovea_governor_init(&loop->governor, loop->config, loop->period_ns);
    loop->counts = (struct fv_loop_counts){0};
    loop->status = FOVEA_OK;
    loop->any_frame = loop->waiting = false;
}

void fv_loop_run(struct fv_loop *loop)
{
    struct fovea_frame frame;
    int64_t late_ns = 0;
    prepare(loop);
    fv_realtime_touch_stack();
    struct span begin = span_begin();
    loop->mark_due_ns = begin.wall_ns;
    loop->mark_cpu_ns = begin.cpu_ns;
    loop->own_late_ns = 0;
    fv_heap_arm();
    for (;;) {
        if (loop->hooks.pace != NULL && !loop->real_time) loop->hooks.pace(loop->hooks.context);
        enum taken taken = take_frame(loop, &frame, &late_ns);
        if (taken == TAKEN_END) break;
        iteration(loop, taken == TAKEN_FRAME ? &frame : NULL, late_ns);
        if (taken == TAKEN_FRAME) loop->ops->requeue(loop->source, &frame);
        if (loop->frames_max > 0 && loop->counts.in >= loop->frames_max) break;
    }
    fv_heap_disarm();
    loop->heap_calls = fv_heap_calls();
    struct span whole = span_end(begin);
    loop->wall_ns = whole.wall_ns;
    loop->cpu_ns = whole.cpu_ns;
    if (loop->ops->counts != NULL) loop->ops->counts(loop->source, &loop->source_counts);
}

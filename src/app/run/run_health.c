#include "app/run/run_health.h"

#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

#include "app/run/run.h"
#include "drivers/clock.h"
#include "support/say.h"
#include "support/stall.h"
#include "support/text.h"

/* ---- the history ----------------------------------------------------------------------------- */

static const int64_t keep_ns = 60 * FV_SECOND_NS;

static void history_keep(struct fv_run *run)
{
    struct fovea_error error;
    const char *path = run->health.history_path;
    if (path[0] == '\0') return;
    if (fv_history_write(path, &run->health.history, &error) != FOVEA_OK) fv_say("%s", error.text);
}

/* Count the start and keep it at once, so that a run that is killed is known by the ends. */
static void history_open(struct fv_run *run)
{
    struct fovea_error error;
    struct fv_history *history = &run->health.history;
    char *path = run->health.history_path, runs[FV_TEXT_COUNT_BYTES];
    if (path[0] == '\0') return;
    if (fv_history_read(path, history, &error) != FOVEA_OK) {
        fv_say("%s; the file is left as it is, and counters are not kept", error.text);
        path[0] = '\0';
        return;
    }
    if (!run->quiet && history->starts > 0)
        fv_say_note("%.200s: %s before, %" PRIu64 " of them not ended in order; %.1f hours", path,
                    fv_text_count(history->starts, "run", runs), history->starts - history->ends,
                    (double)history->seconds / 3600);
    history->starts++;
    history_keep(run);
}

/* Whole seconds of what has gone by, and the rest. */
static uint64_t whole_seconds(int64_t *rest_ns, int64_t more_ns)
{
    *rest_ns += more_ns;
    const int64_t seconds = *rest_ns / FV_SECOND_NS;
    *rest_ns -= seconds * FV_SECOND_NS;
    return (uint64_t)seconds;
}

/* 1 where a part has failed that had not. */
static uint32_t fails_anew(const struct fv_health *before, const struct fv_health *now,
                           const char *name)
{
    bool failed = false, was = false;
    for (uint32_t i = 0; i < now->count; i++)
        failed |= strcmp(now->parts[i].name, name) == 0 && now->parts[i].state == FV_HEALTH_FAILED;
    for (uint32_t i = 0; i < before->count; i++)
        was |=
            strcmp(before->parts[i].name, name) == 0 && before->parts[i].state == FV_HEALTH_FAILED;
    return failed && !was;
}

static void history_count(struct fv_run *run, const struct fv_health *before, int64_t now_ns)
{
    struct fv_run_health *health = &run->health;
    struct fv_history *history = &health->history;
    const int64_t gone_ns = now_ns - health->counted_ns;
    health->counted_ns = now_ns;
    history->seconds += whole_seconds(&health->rest_ns, gone_ns);
    if (health->share < FV_HOST_SHARE_MAX)
        history->hot_seconds += whole_seconds(&health->hot_rest_ns, gone_ns);
    history->source_failures += fails_anew(before, &health->judged, "source");
    history->pose_failures += fails_anew(before, &health->judged, "odometry");
    if (now_ns - health->kept_ns < keep_ns) return;
    health->kept_ns = now_ns;
    history_keep(run);
}

void fv_run_health_end(struct fv_run *run)
{
    if (!run->health.on) return;
    fv_run_health_tend(run); /* the last frames */
    run->health.history.ends++;
    history_keep(run);
}

/* ---- health ---------------------------------------------------------------------------------- */

void fv_run_health_open(struct fv_run *run)
{
    struct fv_run_health *health = &run->health;
    const char *root = getenv("FOVEA_SYS_ROOT");
    health->on = run->loop.real_time;
    health->root = root != NULL ? root : "";
    health->share = FV_HOST_SHARE_MAX;
    health->picture_ns = health->inference_ns = health->sent_ns = fv_clock_ns(CLOCK_MONOTONIC);
    health->stamp = fv_message_stamp(NULL, 0);
    fv_message_channel(run->settings.runtime.channel_prefix, FV_MESSAGE_HEALTH, health->channel);
    health->counted_ns = health->kept_ns = health->looked_ns = health->picture_ns;
    for (int i = 0; i < FOVEA_CAMERAS_MAX; i++)
        health->image_ns[i] = health->picture_ns;
    if (!health->on) return;
    fv_transport_reserve(run->transport, FV_TRANSPORT_WATCHER, health->channel);
    /* A hot machine is given less from the first frame on. */
    fv_host_read(health->root, run->settings.health_heat_limit_c, &health->host);
    health->share = fv_host_share(&health->host, run->settings.health_heat_limit_c, health->share);
    atomic_store(&run->shared.share, health->share);
    fv_self_test(health->self_test);
    if (health->self_test[0] != '\0')
        fv_say_word(FV_SAY_RED, "self-test", ": %s", health->self_test);
    history_open(run);
}

/* How much a counter has risen since it was last seen. */
static uint64_t risen(uint64_t *seen, uint64_t now)
{
    const uint64_t before = *seen;
    *seen = now;
    return now - before;
}

/* For how long the loop has not moved. A look that comes late says that this thread, or the whole
 * process, had no processor: so much counts at most. */
static int64_t stood(struct fv_run *run, int64_t now_ns)
{
    const int64_t look_max_ns = FV_SECOND_NS / 2;
    struct fv_run_health *health = &run->health;
    const int64_t gone_ns = now_ns - health->looked_ns;
    health->looked_ns = now_ns;
    health->stood_ns += gone_ns < look_max_ns ? gone_ns : look_max_ns;
    if (risen(&health->beats, atomic_load(&run->shared.beats)) > 0) health->stood_ns = 0;
    return health->stood_ns;
}

/* Whether a recording has ended by itself. */
static bool recording_ended(const struct fv_run *run)
{
    return (run->recorder != NULL && fv_recorder_has_ended(run->recorder)) ||
           run->recordings.reason[0] != '\0';
}

/* The camera of a rig that has been silent for longest; 0: there is no rig. */
static uint32_t most_silent(struct fv_run *run, int64_t now_ns, int64_t *silent_ns)
{
    struct fv_run_health *health = &run->health;
    const uint32_t cameras = run->settings.runtime.rig.camera_count;
    uint32_t most = 0;
    *silent_ns = 0;
    for (uint32_t i = 0; i < cameras; i++) {
        if (risen(&health->images[i], atomic_load(&run->shared.images[i])) > 0)
            health->image_ns[i] = now_ns;
        if (cameras == 1 || now_ns - health->image_ns[i] <= *silent_ns) continue;
        *silent_ns = now_ns - health->image_ns[i];
        most = i + 1;
    }
    return most;
}

static void facts_gather(struct fv_run *run, int64_t now_ns, struct fv_health_facts *facts)
{
    struct fv_run_health *health = &run->health;
    struct fv_transport_counts counts;
    fv_transport_counts(run->transport, &counts);
    health->history.frames += risen(&health->frames, atomic_load(&run->shared.frames));
    if (risen(&health->pictures, atomic_load(&run->shared.pictures)) > 0)
        health->picture_ns = now_ns;
    health->dropped_now = atomic_load(&run->shared.dropped);
    health->unsent_now = counts.dropped;
    if (risen(&health->sent, counts.sent) > 0) health->sent_ns = now_ns;
    if (risen(&health->inferences, atomic_load(&health->inferences_now)) > 0)
        health->inference_ns = now_ns;
    int64_t camera_silent_ns;
    const uint32_t silent_camera = most_silent(run, now_ns, &camera_silent_ns);
    *facts = (struct fv_health_facts){
        .self_test = health->self_test,
        .silence_ns = (int64_t)run->settings.health_silence_ms * 1000000,
        .source_state = atomic_load(&run->watch.source_state),
        .silent_ns = now_ns - health->picture_ns,
        .silent_camera = silent_camera,
        .camera_silent_ns = camera_silent_ns,
        .imu_state = atomic_load(&run->watch.imu_state),
        .pose = (enum fv_watch_state)atomic_load(&run->watch.now_state),
        .pose_ns = atomic_load(&run->watch.lasts_ns),
        .calibration = atomic_load(&run->watch.calibration),
        .has_network = run->settings.model[0] != '\0',
        .inferences = health->inferences,
        .inference_ns = now_ns - health->inference_ns,
        .stood_ns = stood(run, now_ns),
        .late = health->dropped_now - health->late,
        .publishes = run->settings.lcm_url[0] != '\0',
        .sends = run->transport != NULL,
        .unsent = health->unsent_now - health->unsent,
        .sent_ns = now_ns - health->sent_ns,
        .records = run->recorder != NULL || run->recordings.setup.path != NULL,
        .recording_ended = recording_ended(run),
        .unlocked = run->unlocked.text,
        .host = health->host,
        .heat_limit_c = run->settings.health_heat_limit_c,
        .share = health->share};
}

/* A change of the host's state, which no other line says; at first all is thought to be well. */
static void change_say(const struct fv_run *run, struct fv_run_health *health)
{
    static const enum fv_say_colour colours[] = {FV_SAY_GREEN, FV_SAY_YELLOW, FV_SAY_RED};
    const struct fv_health_part *host = &health->judged.parts[health->judged.count - 1];
    if (run->quiet || host->state == health->host_said) return;
    health->host_said = host->state;
    fv_say_word(colours[host->state], host->name, ": %s",
                host->state == FV_HEALTH_OK ? "as it should be" : host->reason);
}

/* What was sent need not be counted again. */
static void forget_sent(struct fv_run_health *health)
{
    if (atomic_load_explicit(&health->news, memory_order_acquire) != FV_RUN_HEALTH_SENT) return;
    health->late = health->told_late;
    health->unsent = health->told_unsent;
}

/* Once a second, and when a part's state has changed: the loop sends it. What it has not sent yet
 * is replaced. */
static void tell(struct fv_run_health *health, int64_t now_ns)
{
    if (now_ns - health->told_ns < FV_SECOND_NS &&
        !fv_health_differs(&health->judged, &health->told))
        return;
    int ready = FV_RUN_HEALTH_READY;
    if (!atomic_compare_exchange_strong(&health->news, &ready, FV_RUN_HEALTH_SENT) &&
        ready == FV_RUN_HEALTH_TAKEN)
        return;
    const bool told_before = health->told_ns > 0 && now_ns - health->told_ns >= FV_SECOND_NS;
    health->untaken = risen(&health->takes_seen, atomic_load(&health->takes)) == 0 && told_before;
    health->told_ns = now_ns;
    health->told = health->judged;
    health->told_late = health->dropped_now;
    health->told_unsent = health->unsent_now;
    atomic_store_explicit(&health->news, FV_RUN_HEALTH_READY, memory_order_release);
}

/* `told` as a message; 0 bytes: it does not fit. */
static uint32_t encode(struct fv_run *run, fovea_stamp_t stamp, uint8_t data[FV_HEALTH_BYTES_MAX])
{
    struct fv_run_health *health = &run->health;
    fovea_health_part_t parts[FV_HEALTH_PARTS_MAX];
    struct fv_health *told = &health->told;
    for (uint32_t i = 0; i < told->count; i++)
        parts[i] = (fovea_health_part_t){.name = (char *)told->parts[i].name,
                                         .state = (int8_t)told->parts[i].state,
                                         .reason = told->parts[i].reason};
    const fovea_health_t message = {.stamp = stamp,
                                    .utime = fv_clock_ns(CLOCK_REALTIME) / 1000,
                                    .run_id = run->run_id,
                                    .state = (int8_t)fv_health_worst(told),
                                    .count = (int32_t)told->count,
                                    .parts = parts};
    const int bytes = fovea_health_t_encode(data, 0, FV_HEALTH_BYTES_MAX, &message);
    return bytes > 0 ? (uint32_t)bytes : 0;
}

/* While the loop does not move, or waits for the time of a frame that it has, this thread sends by
 * itself, without the stamp, which is the loop's; the feed is the loop's as well. */
static void send_for_loop(struct fv_run *run)
{
    struct fv_run_health *health = &run->health;
    uint8_t data[FV_HEALTH_BYTES_MAX];
    int news = FV_RUN_HEALTH_READY;
    const bool hangs = health->stood_ns > (int64_t)run->settings.health_silence_ms * 1000000;
    if (!(hangs || health->untaken) ||
        !atomic_compare_exchange_strong(&health->news, &news, FV_RUN_HEALTH_SENT))
        return;
    const uint32_t bytes = encode(run, fv_message_stamp(NULL, 0), data);
    const struct fovea_message out = {health->channel, data, bytes, true};
    if (bytes > 0) fv_transport_put_from(run->transport, FV_TRANSPORT_WATCHER, &out);
}

void fv_run_health_tend(struct fv_run *run)
{
    struct fv_run_health *health = &run->health;
    struct fv_health_facts facts;
    const int64_t now_ns = fv_clock_ns(CLOCK_MONOTONIC);
    const int call = fv_stall_enter("the temperatures in /sys");
    fv_host_read(health->root, run->settings.health_heat_limit_c, &health->host);
    fv_stall_leave(call);
    atomic_store(&run->shared.temperature_c, health->host.temperature_c);
    if (!health->on) return;
    health->share = fv_host_share(&health->host, run->settings.health_heat_limit_c, health->share);
    atomic_store(&run->shared.share, health->share);
    const struct fv_health before = health->judged;
    forget_sent(health);
    facts_gather(run, now_ns, &facts);
    fv_health_judge(&facts, &health->judged);
    history_count(run, &before, now_ns);
    change_say(run, health);
    tell(health, now_ns);
    send_for_loop(run);
}

void fv_run_health_work(struct fv_run *run, const struct fovea_inputs *inputs)
{
    struct fv_run_health *health = &run->health;
    uint8_t data[FV_HEALTH_BYTES_MAX];
    if (inputs->frame != NULL)
        health->stamp = fv_message_stamp(inputs->frame, inputs->utc_offset_ns);
    int news = FV_RUN_HEALTH_READY;
    if (!atomic_compare_exchange_strong(&health->news, &news, FV_RUN_HEALTH_TAKEN)) return;
    const uint32_t bytes = encode(run, health->stamp, data);
    atomic_fetch_add_explicit(&health->takes, 1, memory_order_relaxed);
    atomic_store_explicit(&health->news, FV_RUN_HEALTH_SENT, memory_order_release);
    if (bytes == 0) return;
    const struct fovea_message out = {health->channel, data, bytes, true};
    fv_transport_put(run->transport, &out);
    fv_feed_put(run->feed, &out);
}

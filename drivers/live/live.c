#include "live.h"

#include <errno.h>
#include <poll.h>
#include <pthread.h>
#include <sched.h>
#include <semaphore.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include "../clock.h"
#include "../complaints.h"
#include "../slot_ring.h"
#include "../table.h"
#include "../thread.h"
#include "control_request.h"
#include "picture.h"

enum { URI_BYTES = 256 };

enum complaint { NOTICE, AWAY, REFUSED, BROKEN, DAMAGED, STAMPS };

struct slot {
    struct fovea_frame frame;
    uint32_t buffer; /* of the device, to give back: raw frames */
};

/* What the camera thread counts and others read; each is written by one thread. */
struct tallies {
    _Atomic uint64_t damaged, dropped, recovered;
};

struct fovea_source { /* NOLINT(clang-analyzer-optin.performance.Padding): in order of meaning */
    const struct fv_live_ops *ops;
    void *device;
    char uri[URI_BYTES];
    struct fovea_source_info info;
    struct fv_recovery_times times;
    uint32_t slot_count;
    uint64_t frames_max; /* 0: no limit */
    uint32_t held_max;
    int64_t readout_ns;

    struct fv_live_pictures pictures;
    struct slot slots[FV_LIVE_BUFFERS_MAX];
    struct fv_slot_ring ready, free;
    sem_t ready_count;
    int wake_fd; /* to the camera thread: a slot is free, or quit */
    int quit_fd; /* to the device: quit */

    pthread_t thread;
    bool started, scheduled;
    _Atomic bool quit;
    struct tallies tallies;
    _Atomic int phase; /* of the recovery's view */
    _Atomic int64_t mark_ns;
    struct fv_control_request request;

    /* Camera thread only. */
    struct fv_recovery recovery;
    struct fv_order order;
    uint32_t out; /* slots that the loop has, ready or held */
    bool slot_free[FV_LIVE_BUFFERS_MAX];
    bool set_up;

    /* Loop thread only. */
    bool held[FV_LIVE_BUFFERS_MAX];
    uint32_t held_count;
    uint64_t delivered;

    struct fv_complaints complaints;
};

static int64_t now_ns(void)
{
    return fv_clock_ns(CLOCK_MONOTONIC);
}

void fv_live_notice(struct fovea_source *source, const struct fovea_error *line)
{
    fv_complaints_add(&source->complaints, NOTICE, line);
}

enum fovea_status fv_live_complaint(struct fovea_source *source, struct fovea_error *error)
{
    return fv_complaints_take(&source->complaints, error);
}

/* ---- camera thread: recovery ----------------------------------------------------------------- */

static bool quitting(const struct fovea_source *source)
{
    return atomic_load_explicit(&source->quit, memory_order_relaxed);
}

/* Tell the loop where recovery stands. */
static void show(struct fovea_source *source)
{
    atomic_store_explicit(&source->mark_ns, source->recovery.view.mark_ns, memory_order_relaxed);
    atomic_store_explicit(&source->phase, (int)source->recovery.view.phase, memory_order_release);
    atomic_store_explicit(&source->tallies.recovered, source->recovery.recovered,
                          memory_order_relaxed);
}

static void count(_Atomic uint64_t *tally, uint64_t more)
{
    atomic_store_explicit(tally, atomic_load_explicit(tally, memory_order_relaxed) + more,
                          memory_order_relaxed);
}

/* Sleep until then, or until woken. */
static void pause_until(struct fovea_source *source, int64_t until_ns)
{
    const int64_t left_ns = until_ns - now_ns();
    if (left_ns <= 0) return;
    const struct timespec time = fv_clock_timespec(left_ns);
    struct pollfd wake = {.fd = source->wake_fd, .events = POLLIN};
    ppoll(&wake, 1, &time, NULL); /* take_back notes that it was woken */
}

/* Slots that came back from the loop; a buffer of the device is given back to it while it streams.
 */
static enum fovea_status take_back(struct fovea_source *source, struct fovea_error *error)
{
    enum fovea_status status = FOVEA_OK;
    uint64_t woken;
    uint8_t slot;
    if (read(source->wake_fd, &woken, sizeof woken) < 0)
        woken = 0; /* not woken: nothing to take note of */
    while (fv_slot_ring_pop(&source->free, &slot)) {
        source->slot_free[slot] = true;
        source->out--;
        if (source->pictures.jpeg == NULL && source->set_up && status == FOVEA_OK)
            status = source->ops->give(source->device, source->slots[slot].buffer, error);
    }
    return status;
}

/* The loop may still look at the device's buffers: wait until it has given them back. */
static void take_all_back(struct fovea_source *source)
{
    struct fovea_error unused;
    source->set_up = false; /* nothing goes back to the device any more */
    take_back(source, &unused);
    while (source->pictures.jpeg == NULL && source->out > 0 && !quitting(source)) {
        pause_until(source, now_ns() + 10000000);
        take_back(source, &unused);
    }
}

static void tear_down(struct fovea_source *source)
{
    if (!source->set_up) return;
    take_all_back(source);
    source->ops->tear_down(source->device);
}

static void broken(struct fovea_source *source, enum fovea_status status,
                   const struct fovea_error *error)
{
    if (error->text[0] != '\0')
        fv_complaints_add(&source->complaints, status == FOVEA_GONE ? AWAY : BROKEN, error);
    fv_recovery_broken(&source->recovery, status, now_ns());
    show(source);
    tear_down(source);
}

static void try_set_up(struct fovea_source *source)
{
    struct fovea_error error = {.text = ""};
    enum fovea_status status = source->ops->find(source->device, source->quit_fd, &error);
    if (status == FOVEA_OK) {
        if (source->recovery.view.phase == FV_RECOVERY_ABSENT) {
            source->recovery.view =
                (struct fv_recovery_view){.phase = FV_RECOVERY_LOOKING, .mark_ns = now_ns()};
            show(source);
        }
        status = source->ops->set_up(source->device, source->quit_fd, &error);
    }
    fv_recovery_tried(&source->recovery, status, now_ns());
    if (status == FOVEA_OK) {
        source->set_up = true;
        fv_order_again(&source->order);
    }
    if (error.text[0] != '\0')
        fv_complaints_add(&source->complaints, status == FOVEA_GONE ? AWAY : REFUSED, &error);
    show(source);
}

/* ---- camera thread: frames ------------------------------------------------------------------- */

static void read_clocks(struct fv_order_now *now)
{
    now->clock_ns[FOVEA_CLOCK_MONOTONIC] = fv_clock_ns(CLOCK_MONOTONIC);
    now->clock_ns[FOVEA_CLOCK_BOOTTIME] = fv_clock_ns(CLOCK_BOOTTIME);
    now->clock_ns[FOVEA_CLOCK_REALTIME] = fv_clock_ns(CLOCK_REALTIME);
}

static enum fovea_status fill_order(struct fovea_source *source,
                                    const struct fv_live_buffer *buffer, struct slot *slot,
                                    struct fovea_error *error)
{
    struct fv_order_now now;
    const uint64_t replaced = source->order.replaced;
    read_clocks(&now);
    const enum fv_order_verdict verdict =
        fv_order_frame(&source->order, &buffer->stamp, &now, &slot->frame);
    if (source->order.replaced > replaced) {
        fovea_error_set(
            error, FOVEA_OK,
            "%s: found stamps that are not of the last 10 s on any clock; the time of arrival takes their place",
            source->uri);
        fv_complaints_add(&source->complaints, STAMPS, error);
    }
    if (verdict == FV_ORDER_GOOD) return FOVEA_OK;
    return fovea_error_set(error, FOVEA_ERROR_INPUT, "%s: frame skipped: its stamp %s", source->uri,
                           verdict == FV_ORDER_REPEATED ? "is that of the frame before"
                                                        : "lies before that of the frame before");
}

static int free_slot(const struct fovea_source *source)
{
    for (uint32_t i = 0; i < source->slot_count; i++)
        if (source->slot_free[i]) return (int)i;
    return -1;
}

static void hand_over(struct fovea_source *source, int slot)
{
    source->slot_free[slot] = false;
    source->out++;
    source->slots[slot].frame.slot = (uint32_t)slot;
    if (source->recovery.view.phase == FV_RECOVERY_FIRST)
        fv_complaints_forget(&source->complaints, AWAY, BROKEN);
    fv_recovery_good(&source->recovery, now_ns());
    show(source);
    fv_slot_ring_push(&source->ready, (uint8_t)slot);
    sem_post(&source->ready_count);
}

/* One filled buffer: to the loop, or counted as bad and back to the device. Not FOVEA_OK: streaming
 * is broken. */
static enum fovea_status use_buffer(struct fovea_source *source,
                                    const struct fv_live_buffer *buffer, int free,
                                    struct fovea_error *error)
{
    struct slot *slot = &source->slots[free];
    count(&source->tallies.dropped, fv_order_count(&source->order, &buffer->stamp));
    enum fovea_status status =
        fv_live_picture_take(&source->pictures, (uint32_t)free, buffer, error);
    if (status == FOVEA_OK) status = fill_order(source, buffer, slot, error);
    const bool good = status == FOVEA_OK;
    slot->buffer = buffer->index;
    if (good) fv_live_picture_images(&source->pictures, (uint32_t)free, slot->frame.images);
    if (good && source->ops->seen != NULL)
        source->ops->seen(source->device, &slot->frame.images[0]);
    if (good) hand_over(source, free);
    if (good && source->pictures.jpeg == NULL) return FOVEA_OK;
    if (!good) {
        count(&source->tallies.damaged, 1);
        fv_complaints_add(&source->complaints, DAMAGED, error);
    }
    error->text[0] = '\0';
    status = source->ops->give(source->device, buffer->index, error);
    if (status != FOVEA_OK || good || !fv_recovery_bad(&source->recovery)) return status;
    return fovea_error_set(error, FOVEA_ERROR_SYSTEM,
                           "%s: found %u damaged frames in a row: the camera is set up again",
                           source->uri, source->recovery.times.bad_frames);
}

/* Wait for a buffer, at most until it is time to give up waiting. */
static void stream(struct fovea_source *source)
{
    struct fovea_error error = {.text = ""};
    struct fv_live_buffer buffer;
    const int64_t begin_ns = now_ns();
    enum fovea_status status = take_back(source, &error);
    const int slot = free_slot(source);
    if (status == FOVEA_OK && slot < 0) { /* the loop has them all */
        pause_until(source, begin_ns + 100000000);
        fv_recovery_excused(&source->recovery, now_ns());
        show(source);
        return;
    }
    if (status == FOVEA_OK)
        status = source->ops->take(source->device, begin_ns + 100000000, source->wake_fd, &buffer,
                                   &error);
    if (status == FOVEA_OK) status = use_buffer(source, &buffer, slot, &error);
    if (status == FOVEA_AGAIN && fv_recovery_waited_enough(&source->recovery, now_ns()))
        status = fovea_error_set(&error, FOVEA_ERROR_SYSTEM,
                                 "%s: no frame for %.1f s: the camera is set up again", source->uri,
                                 (double)(now_ns() - source->recovery.view.mark_ns) * 1e-9);
    if (status != FOVEA_OK && status != FOVEA_AGAIN) broken(source, status, &error);
}

/* Set the control that a request names. */
static void serve_control_request(struct fovea_source *source)
{
    struct fovea_error error = {.text = ""};
    enum fovea_source_control control;
    double value;
    if (!fv_control_request_take(&source->request, &control, &value)) return;
    const enum fovea_status status =
        source->set_up
            ? source->ops->control(source->device, control, value, source->quit_fd, &error)
            : fovea_error_set(&error, FOVEA_GONE, "%s: the camera is away", source->uri);
    fv_control_request_answer(&source->request, status, &error);
}

static void *run(void *argument)
{
    struct fovea_source *source = argument;
    while (!quitting(source)) {
        serve_control_request(source);
        if (fv_recovery_streams(&source->recovery)) {
            stream(source);
        } else if (now_ns() < source->recovery.next_ns) {
            struct fovea_error unused;
            take_back(source, &unused);
            pause_until(source, source->recovery.next_ns);
        } else {
            try_set_up(source);
        }
    }
    if (source->set_up) source->ops->tear_down(source->device);
    source->set_up = false;
    return NULL;
}

/* ---- open and close -------------------------------------------------------------------------- */

enum fovea_status fv_live_selection(const char *scheme,
                                    const struct fovea_source_selection *selection,
                                    struct fovea_error *error)
{
    if (selection->start == 0 && selection->step == 1 && !selection->reverse) return FOVEA_OK;
    const bool reverse = selection->start == 0 && selection->step == 1;
    return fovea_error_set(
        error, reverse ? FOVEA_ERROR_UNSUPPORTED : FOVEA_ERROR_ARGUMENT,
        "%s: %s: found one, expected none: a camera gives its frames as they come", scheme,
        reverse                ? "reverse"
        : selection->step != 1 ? "step"
                               : "start");
}

static void release(struct fovea_source *source)
{
    source->ops->close(source->device);
    if (source->wake_fd >= 0) close(source->wake_fd);
    if (source->quit_fd >= 0) close(source->quit_fd);
    fv_complaints_close(&source->complaints);
    fv_control_request_close(&source->request);
    fv_live_pictures_close(&source->pictures);
    free(source);
}

enum fovea_status fv_live_open(const struct fv_live_ops *ops, void *device,
                               const struct fv_live_setup *setup,
                               const struct fovea_source_selection *selection,
                               struct fovea_source **out, struct fovea_error *error)
{
    struct fovea_source *source;
    if (posix_memalign((void **)&source, 64, sizeof *source) != 0) {
        ops->close(device);
        return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "%s: out of memory", setup->uri);
    }
    memset(source, 0, sizeof *source);
    source->ops = ops;
    source->device = device;
    source->info = setup->info;
    source->info.live = true;
    source->info.rig.camera_count = 1;
    source->info.frame_count = selection->frames;
    source->info.heap_bytes += sizeof *source;
    source->frames_max = selection->frames;
    source->held_max = fv_source_frames_held(selection);
    source->readout_ns = setup->readout_ns;
    source->info.rig.cameras[0].has_readout = setup->readout_ns >= 0;
    source->info.rig.cameras[0].readout_ns = setup->readout_ns < 0 ? 0 : setup->readout_ns;
    snprintf(source->uri, sizeof source->uri, "%s", setup->uri);
    if (setup->times != NULL)
        source->times = *setup->times;
    else
        fv_recovery_times_default(&source->times, setup->info.rate_hz);
    fv_complaints_open(&source->complaints);
    fv_control_request_open(&source->request);
    source->wake_fd = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
    source->quit_fd = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
    enum fovea_status status = FOVEA_OK;
    if (source->wake_fd < 0 || source->quit_fd < 0)
        status = fovea_error_set(error, FOVEA_ERROR_SYSTEM, "%s: no eventfd: %s", source->uri,
                                 strerror(errno));
    if (status == FOVEA_OK)
        status = fv_live_pictures_open(&source->pictures, source->uri, setup, &source->info, error);
    source->slot_count = source->pictures.count;
    for (uint32_t i = 0; i < source->slot_count; i++)
        source->slots[i].frame.image_count = source->info.rig.camera_count;
    if (status != FOVEA_OK) {
        release(source);
        return status;
    }
    *out = source;
    return FOVEA_OK;
}

void fv_live_close(struct fovea_source *source)
{
    fv_live_stop(source);
    release(source);
}

const struct fovea_source_info *fv_live_info(const struct fovea_source *source)
{
    return &source->info;
}

/* ---- start and stop -------------------------------------------------------------------------- */

enum fovea_status fv_live_start(struct fovea_source *source, struct fovea_error *error)
{
    uint64_t quit;
    if (source->started)
        return fovea_error_set(error, FOVEA_ERROR_ARGUMENT, "%s: started already", source->uri);
    memset(&source->ready, 0, sizeof source->ready);
    memset(&source->free, 0, sizeof source->free);
    memset(source->held, 0, sizeof source->held);
    memset(&source->tallies, 0, sizeof source->tallies);
    for (uint32_t i = 0; i < FV_LIVE_BUFFERS_MAX; i++)
        source->slot_free[i] = i < source->slot_count;
    source->held_count = source->out = 0;
    source->delivered = 0;
    source->scheduled = false;
    atomic_store(&source->quit, false);
    if (read(source->quit_fd, &quit, sizeof quit) < 0) quit = 0; /* it was not stopped before */
    fv_recovery_start(&source->recovery, &source->times, now_ns());
    fv_order_start(&source->order, source->readout_ns);
    show(source);
    sem_init(&source->ready_count, 0, 0);
    const int failed = fv_thread_start(&source->thread, run, source);
    if (failed != 0) {
        sem_destroy(&source->ready_count);
        return fovea_error_set(error, FOVEA_ERROR_SYSTEM,
                               "%s: the camera thread cannot be started: %s", source->uri,
                               strerror(failed));
    }
    source->started = true;
    return FOVEA_OK;
}

static void ring(int fd)
{
    const uint64_t one = 1;
    if (write(fd, &one, sizeof one) < 0) return; /* full: it rings already */
}

void fv_live_stop(struct fovea_source *source)
{
    if (!source->started) return;
    atomic_store(&source->quit, true);
    ring(source->wake_fd);
    ring(source->quit_fd);
    pthread_join(source->thread, NULL);
    sem_destroy(&source->ready_count);
    source->started = false;
}

enum fovea_status fv_live_control(struct fovea_source *source, enum fovea_source_control control,
                                  double value, struct fovea_error *error)
{
    if (source->started)
        return fv_control_request_ask(&source->request, source->uri, source->wake_fd, control,
                                      value, error);
    return source->ops->control(source->device, control, value, -1, error);
}

/* ---- loop thread ----------------------------------------------------------------------------- */

/* The camera thread is worth as much as the one that waits for it, unless the process was started
 * so that only the thread that it came with is real-time. */
static void take_over_scheduling(struct fovea_source *source)
{
    struct sched_param parameter;
    int policy = sched_getscheduler(0);
    source->scheduled = true;
    if (policy < 0 || (policy & SCHED_RESET_ON_FORK) != 0) return;
    if (pthread_getschedparam(pthread_self(), &policy, &parameter) == 0)
        pthread_setschedparam(source->thread, policy, &parameter);
}

static bool finished(const struct fovea_source *source)
{
    return source->frames_max > 0 && source->delivered >= source->frames_max;
}

enum fovea_status fv_live_dequeue(struct fovea_source *source, int64_t deadline_ns,
                                  struct fovea_frame *frame)
{
    uint8_t slot;
    if (!source->started || finished(source)) return FOVEA_END;
    if (!source->scheduled) take_over_scheduling(source);
    if (source->held_count >= source->held_max) return FOVEA_AGAIN;
    if (!fv_thread_take(&source->ready_count, deadline_ns) ||
        !fv_slot_ring_pop(&source->ready, &slot))
        return fv_live_state(source) == FOVEA_SOURCE_GONE ? FOVEA_GONE : FOVEA_AGAIN;
    source->held[slot] = true;
    source->held_count++;
    source->delivered++;
    *frame = source->slots[slot].frame;
    return FOVEA_OK;
}

void fv_live_requeue(struct fovea_source *source, const struct fovea_frame *frame)
{
    if (!source->started || frame->slot >= source->slot_count || !source->held[frame->slot]) return;
    source->held[frame->slot] = false;
    source->held_count--;
    fv_slot_ring_push(&source->free, (uint8_t)frame->slot);
    ring(source->wake_fd);
}

void fv_live_counts(const struct fovea_source *source, struct fovea_source_counts *counts)
{
    *counts = (struct fovea_source_counts){
        .delivered = source->delivered,
        .damaged = atomic_load_explicit(&source->tallies.damaged, memory_order_relaxed),
        .dropped = atomic_load_explicit(&source->tallies.dropped, memory_order_relaxed),
        .recovered = atomic_load_explicit(&source->tallies.recovered, memory_order_relaxed),
    };
}

enum fovea_source_state fv_live_state(const struct fovea_source *source)
{
    if (finished(source)) return FOVEA_SOURCE_ENDED;
    struct fv_recovery_view view;
    view.phase = (enum fv_recovery_phase)atomic_load_explicit(&source->phase, memory_order_acquire);
    view.mark_ns = atomic_load_explicit(&source->mark_ns, memory_order_relaxed);
    return fv_recovery_state(&source->times, view, now_ns());
}

bool fv_live_takes_device(const char *address)
{
    (void)address;
    return true;
}

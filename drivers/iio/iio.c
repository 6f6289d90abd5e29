#include "iio.h"

#include <errno.h>
#include <poll.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include "../clock.h"
#include "../complaints.h"
#include "../live/recovery.h"
#include "../thread.h"
#include "device.h"
#include "support/aligned.h"

enum { RING_SAMPLES = 2048, READ_BYTES = 8192 };

static const struct fv_recovery_times times = {
    .late_ns = 100000000,
    .stalled_ns = 500000000, /* without a sample, which is said */
    .restart_ns = 2000000000,
    .first_ns = 2000000000,
    .absent_ns = 50000000,
    .backoff_min_ns = 50000000,
    .backoff_max_ns = 1000000000,
    .bad_frames = 1,
};

enum complaint { AWAY, HANGS, BACK, NOTICE, COMPLAINTS };

struct fv_iio {
    struct fv_iio_device device;
    struct fv_iio_info info;
    pthread_t thread;
    bool started;
    int quit_fd;
    struct fv_complaints complaints;
    void (*tap)(void *context, const struct fovea_imu_sample *sample);
    void *tap_context;

    /* A ring of samples: `head` is the thread's, `tail` the loop's. */
    _Alignas(64) _Atomic uint64_t head;
    _Alignas(64) _Atomic uint64_t tail;
    struct fovea_imu_sample samples[RING_SAMPLES];
    _Atomic uint64_t dropped, returns;

    /* The thread's. */
    struct fv_recovery recovery;
    bool silent; /* and it was said */
    size_t held; /* bytes of a scan that is not whole */
    uint8_t data[READ_BYTES];
};

/* ---- opening --------------------------------------------------------------------------------- */

enum fovea_status fv_iio_open(const char *name, double rate_hz, struct fv_iio **iio,
                              struct fovea_error *error)
{
    const char *root = getenv("FOVEA_IIO_ROOT");
    if (name[0] == '\0' || strlen(name) >= FV_IIO_NAME_BYTES || strchr(name, '/') != NULL)
        return fovea_error_set(
            error, FOVEA_ERROR_INPUT,
            "imu: iio: found '%.64s', expected the name of a device, 1 to %d bytes", name,
            FV_IIO_NAME_BYTES - 1);
    struct fv_iio *opened = fv_aligned_zeroed(sizeof *opened);
    if (opened == NULL) return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "imu: out of memory");
    struct fv_iio_device *device = &opened->device;
    snprintf(device->root, sizeof device->root, "%s", root != NULL ? root : "");
    snprintf(device->name, sizeof device->name, "%s", name);
    device->asked_hz = rate_hz;
    device->fd = opened->quit_fd = -1;
    enum fovea_status status = fv_iio_device_set_up(device, error);
    if (status != FOVEA_OK) {
        free(opened);
        return status == FOVEA_GONE ? FOVEA_ERROR_INPUT : status;
    }
    opened->info.rate_hz = device->rate_hz;
    opened->info.gyro_range = fv_iio_scan_range(&device->scan, FV_IIO_GYRO);
    opened->info.acceleration_range = fv_iio_scan_range(&device->scan, FV_IIO_ACCELERATION);
    fv_iio_device_tear_down(device);
    fv_complaints_open(&opened->complaints);
    if (error != NULL && error->text[0] != '\0')
        fv_complaints_add(&opened->complaints, NOTICE, error);
    *iio = opened;
    return FOVEA_OK;
}

const struct fv_iio_info *fv_iio_info(const struct fv_iio *iio)
{
    return &iio->info;
}

/* ---- the thread ------------------------------------------------------------------------------ */

static const char away[] = "is gone; it is searched for";

static void complain(struct fv_iio *iio, enum complaint kind, const char *what)
{
    struct fovea_error line;
    fovea_error_set(&line, FOVEA_OK, "imu: iio:%s: %s", iio->device.name, what);
    fv_complaints_add(&iio->complaints, (int)kind, &line);
}

/* Until a time. False: it is to end. */
static bool pause_until(const struct fv_iio *iio, int64_t until_ns)
{
    struct pollfd quit = {.fd = iio->quit_fd, .events = POLLIN};
    const int64_t left_ns = until_ns - fv_clock_ns(CLOCK_MONOTONIC);
    return poll(&quit, 1, left_ns > 0 ? (int)((left_ns + 999999) / 1000000) : 0) <= 0;
}

static void hand_over(struct fv_iio *iio, const uint8_t *scan, int64_t offset_ns)
{
    const uint64_t head = atomic_load_explicit(&iio->head, memory_order_relaxed);
    struct fovea_imu_sample sample;
    fv_iio_scan_read(&iio->device.scan, scan, &sample);
    if (__builtin_add_overflow(sample.stamp_ns, offset_ns, &sample.stamp_ns))
        sample.stamp_ns = INT64_MAX; /* off the clock, which the step says */
    if (iio->tap != NULL) iio->tap(iio->tap_context, &sample);
    if (head - atomic_load_explicit(&iio->tail, memory_order_acquire) == RING_SAMPLES) {
        atomic_fetch_add_explicit(&iio->dropped, 1, memory_order_relaxed);
        return;
    }
    iio->samples[head % RING_SAMPLES] = sample;
    atomic_store_explicit(&iio->head, head + 1, memory_order_release);
}

/* Read what there is. False: the sensor is away. */
static bool take(struct fv_iio *iio)
{
    const uint32_t size = iio->device.scan.bytes;
    const clockid_t clock = iio->device.clock;
    const ssize_t bytes = read(iio->device.fd, iio->data + iio->held, sizeof iio->data - iio->held);
    if (bytes < 0) return errno == EAGAIN || errno == EINTR;
    if (bytes == 0) return false;
    const int64_t now_ns = fv_clock_ns(CLOCK_MONOTONIC), offset_ns = -fv_clock_ahead_ns(clock);
    const size_t held = iio->held + (size_t)bytes;
    size_t at = 0;
    for (; held - at >= size; at += size)
        hand_over(iio, iio->data + at, offset_ns);
    memmove(iio->data, iio->data + at, held - at);
    iio->held = held - at;
    fv_recovery_good(&iio->recovery, now_ns);
    atomic_store_explicit(&iio->returns, iio->recovery.recovered, memory_order_relaxed);
    if (iio->silent) complain(iio, BACK, "gives samples again");
    iio->silent = false;
    fv_complaints_forget(&iio->complaints, AWAY, HANGS);
    return true;
}

static void broken(struct fv_iio *iio, enum fovea_status status)
{
    fv_iio_device_tear_down(&iio->device);
    fv_recovery_broken(&iio->recovery, status, fv_clock_ns(CLOCK_MONOTONIC));
}

static void look_for(struct fv_iio *iio)
{
    struct fovea_error error = {.text = ""};
    const enum fovea_status status = fv_iio_device_set_up(&iio->device, &error);
    fv_recovery_tried(&iio->recovery, status, fv_clock_ns(CLOCK_MONOTONIC));
    iio->held = 0;
    if (status == FOVEA_GONE)
        complain(iio, AWAY, away);
    else if (status != FOVEA_OK)
        fv_complaints_add(&iio->complaints, AWAY, &error);
}

/* A sensor that gives nothing is named, and after a while started anew. */
static void watch(struct fv_iio *iio)
{
    const int64_t now_ns = fv_clock_ns(CLOCK_MONOTONIC);
    if (!iio->silent &&
        fv_recovery_state(&times, iio->recovery.view, now_ns) == FOVEA_SOURCE_STALLED) {
        iio->silent = true;
        complain(iio, HANGS, "is there, but gives no samples");
        fv_complaints_forget(&iio->complaints, BACK, BACK);
    }
    if (fv_recovery_waited_enough(&iio->recovery, now_ns)) broken(iio, FOVEA_ERROR_SYSTEM);
}

/* Wait for samples, and hand them over. False: it is to end. */
static bool stream(struct fv_iio *iio)
{
    struct pollfd fds[2] = {{.fd = iio->quit_fd, .events = POLLIN},
                            {.fd = iio->device.fd, .events = POLLIN}};
    (void)poll(fds, 2, 100);
    if (fds[0].revents != 0) return false;
    bool there = (fds[1].revents & (POLLERR | POLLNVAL)) == 0;
    if ((fds[1].revents & (POLLIN | POLLHUP)) == POLLHUP)
        there = false;
    else /* also when the wait is over: of a device that is gone poll says nothing */
        there = take(iio) && there;
    if (there) {
        watch(iio);
        return true;
    }
    broken(iio, FOVEA_GONE);
    complain(iio, AWAY, away);
    fv_complaints_forget(&iio->complaints, BACK, BACK);
    iio->silent = true;
    return true;
}

static void *run(void *context)
{
    struct fv_iio *iio = context;
    bool on = true;
    fv_recovery_start(&iio->recovery, &times, fv_clock_ns(CLOCK_MONOTONIC));
    while (on) {
        if (fv_recovery_streams(&iio->recovery)) {
            on = stream(iio);
        } else {
            on = pause_until(iio, iio->recovery.next_ns);
            if (on) look_for(iio);
        }
    }
    return NULL;
}

void fv_iio_tap(struct fv_iio *iio,
                void (*see)(void *context, const struct fovea_imu_sample *sample), void *context)
{
    iio->tap = see;
    iio->tap_context = context;
}

enum fovea_status fv_iio_start(struct fv_iio *iio, struct fovea_error *error)
{
    iio->quit_fd = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
    const int failed = iio->quit_fd < 0 ? errno : fv_thread_start(&iio->thread, run, iio);
    iio->started = failed == 0;
    if (iio->started) return FOVEA_OK;
    return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "imu: iio:%s: no thread to read it: %s",
                           iio->device.name, strerror(failed));
}

void fv_iio_close(struct fv_iio *iio)
{
    const uint64_t one = 1;
    if (iio == NULL) return;
    if (iio->started && write(iio->quit_fd, &one, sizeof one) == (ssize_t)sizeof one)
        pthread_join(iio->thread, NULL);
    if (iio->quit_fd >= 0) close(iio->quit_fd);
    if (iio->started && fv_recovery_streams(&iio->recovery)) fv_iio_device_tear_down(&iio->device);
    fv_complaints_close(&iio->complaints);
    free(iio);
}

/* ---- the loop -------------------------------------------------------------------------------- */

const struct fovea_imu_sample *fv_iio_peek(struct fv_iio *iio)
{
    const uint64_t tail = atomic_load_explicit(&iio->tail, memory_order_relaxed);
    return tail == atomic_load_explicit(&iio->head, memory_order_acquire)
               ? NULL
               : &iio->samples[tail % RING_SAMPLES];
}

void fv_iio_release(struct fv_iio *iio)
{
    atomic_fetch_add_explicit(&iio->tail, 1, memory_order_release);
}

void fv_iio_counts(const struct fv_iio *iio, struct fv_iio_counts *counts)
{
    counts->samples = atomic_load_explicit(&iio->head, memory_order_relaxed);
    counts->dropped = atomic_load_explicit(&iio->dropped, memory_order_relaxed);
    counts->returns = atomic_load_explicit(&iio->returns, memory_order_relaxed);
}

enum fovea_status fv_iio_complaint(struct fv_iio *iio, struct fovea_error *line)
{
    return fv_complaints_take(&iio->complaints, line);
}

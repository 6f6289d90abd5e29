#include "app/run/service.h"

#include <errno.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "drivers/clock.h"
#include "drivers/thread.h"
#include "support/say.h"

static const int64_t unguarded_ns = 500000000; /* between looks where no watchdog is asked for */

/* False: the manager's queue is full, or there is none. That is no reason to stop. */
static bool tell(const struct fv_service *service, const char *text)
{
    return sendto(service->socket, text, strlen(text), MSG_NOSIGNAL | MSG_DONTWAIT,
                  (const struct sockaddr *)&service->address, service->address_bytes) >= 0;
}

static bool tell_state(const struct fv_service *service, const char *state)
{
    char text[96];
    snprintf(text, sizeof text, "STATUS=pose: %s", state);
    return tell(service, text);
}

/* Looks come faster until the manager knows that the loop runs. */
static int64_t wait_ns(const struct fv_service *service, bool ready)
{
    const int64_t soon_ns = 10000000;
    return ready || service->period_ns < soon_ns ? service->period_ns : soon_ns;
}

static void *serve(void *context)
{
    struct fv_service *service = context;
    uint64_t seen = 0;
    const char *told = NULL;
    bool ready = false, end = false;
    do {
        end = fv_thread_take(&service->end, fv_clock_ns(CLOCK_MONOTONIC) + wait_ns(service, ready));
        const uint64_t beats = atomic_load(service->beats);
        const char *state = atomic_load(&service->state);
        if (!ready && beats != 0) ready = tell(service, "READY=1");
        if (beats != seen && service->guarded) (void)tell(service, "WATCHDOG=1");
        if (state != told && state != NULL && tell_state(service, state)) told = state;
        seen = beats;
    } while (!end); /* a short run is ready before it stops */
    return NULL;
}

/* "/run/..." or "@abstract". */
static bool address_read(struct fv_service *service, const char *name)
{
    const size_t length = strlen(name);
    if (length < 2 || (name[0] != '/' && name[0] != '@') ||
        length >= sizeof service->address.sun_path) {
        fv_say("fovea run: NOTIFY_SOCKET: found \"%.100s\", expected a path of at most %zu bytes",
               name, sizeof service->address.sun_path - 1);
        return false;
    }
    service->address.sun_family = AF_UNIX;
    memcpy(service->address.sun_path, name, length + 1);
    if (name[0] == '@') service->address.sun_path[0] = '\0';
    service->address_bytes =
        (socklen_t)(offsetof(struct sockaddr_un, sun_path) + length + (name[0] == '/'));
    return true;
}

/* The watchdog's period, when it is meant for this process. */
static void period_read(struct fv_service *service)
{
    const char *text = getenv("WATCHDOG_USEC"), *of = getenv("WATCHDOG_PID");
    char *end = NULL;
    service->period_ns = unguarded_ns;
    if (text == NULL || (of != NULL && strtol(of, NULL, 10) != (long)getpid())) return;
    const long long us = strtoll(text, &end, 10);
    if (end == text || *end != '\0' || us < 1000 || us > 1000000000000) {
        fv_say("fovea run: WATCHDOG_USEC: found \"%.40s\", expected microseconds from 1000", text);
        return;
    }
    service->guarded = true;
    if (us * 1000 / 3 < service->period_ns) service->period_ns = us * 1000 / 3;
}

const char *fv_service_manager(void)
{
    const char *name = getenv("NOTIFY_SOCKET");
    return name != NULL && name[0] != '\0' ? name : NULL;
}

void fv_service_open(struct fv_service *service, const _Atomic uint64_t *beats)
{
    const char *name = fv_service_manager();
    memset(service, 0, sizeof *service);
    service->beats = beats;
    service->socket = -1;
    if (name == NULL || !address_read(service, name)) return;
    period_read(service);
    service->socket = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    sem_init(&service->end, 0, 0);
    const int failed =
        service->socket < 0 ? errno : fv_thread_start(&service->thread, serve, service);
    service->running = failed == 0;
    if (failed != 0) fv_say("fovea run: NOTIFY_SOCKET: %s", strerror(failed));
}

void fv_service_state(struct fv_service *service, const char *state)
{
    atomic_store(&service->state, state);
}

void fv_service_reloading(struct fv_service *service)
{
    char text[64];
    if (!service->running) return;
    snprintf(text, sizeof text, "RELOADING=1\nMONOTONIC_USEC=%lld",
             (long long)(fv_clock_ns(CLOCK_MONOTONIC) / 1000));
    tell(service, text);
}

void fv_service_ready(struct fv_service *service)
{
    if (service->running) tell(service, "READY=1");
}

void fv_service_close(struct fv_service *service)
{
    if (service->running) {
        sem_post(&service->end);
        pthread_join(service->thread, NULL);
        tell(service, "STOPPING=1");
    }
    if (service->socket >= 0) close(service->socket);
    service->socket = -1;
    service->running = false;
}

#include "support/stall.h"

#include <fcntl.h>
#include <pthread.h>
#include <stdio.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;
static struct fv_stall calls[FV_STALL_CALLS_MAX];
static uint64_t last_id;
static int64_t last_move_ns;

static int64_t now_ns(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec * 1000000000 + now.tv_nsec;
}

static int64_t cpu_ns_of(clockid_t clock)
{
    struct timespec now;
    if (clock_gettime(clock, &now) != 0) return -1;
    return (int64_t)now.tv_sec * 1000000000 + now.tv_nsec;
}

/* What a thread of this program does, as proc(5) names it: R, it runs, or would if there were a
 * processor for it; D, it waits for a disk. ?: not known, or it is the one that asks. */
static char state_of(int32_t thread)
{
    char path[64], text[256];
    if (thread == gettid()) return '?';
    snprintf(path, sizeof path, "/proc/self/task/%d/stat", (int)thread);
    const int fd = open(path, O_RDONLY | O_CLOEXEC);
    if (fd < 0) return '?';
    const ssize_t bytes = read(fd, text, sizeof text - 1);
    close(fd);
    if (bytes <= 0) return '?';
    text[bytes] = 0;
    const char *name_end = strrchr(text, ')'); /* its number, (name), its state */
    return name_end != NULL && name_end[1] == ' ' ? name_end[2] : '?';
}

/* The call is fresh from now on; with the lock held. */
static void renew(struct fv_stall *call)
{
    call->since_ns = now_ns();
    call->cpu_ns = cpu_ns_of(call->cpu);
    call->disk = false;
}

static void see(struct fv_stall *call)
{
    const int64_t cpu_ns = call->cpu_ns < 0 ? -1 : cpu_ns_of(call->cpu);
    const char state = state_of(call->thread);
    if ((cpu_ns >= 0 && cpu_ns - call->cpu_ns >= FV_STALL_COMPUTES_NS) || state == 'R') renew(call);
    if (state == 'D') call->disk = true;
}

int fv_stall_enter(const char *name)
{
    int place = 0;
    pthread_mutex_lock(&lock);
    while (place < FV_STALL_CALLS_MAX && calls[place].id != 0)
        place++;
    if (place < FV_STALL_CALLS_MAX) {
        calls[place].id = ++last_id;
        calls[place].thread = gettid();
        const bool timed = pthread_getcpuclockid(pthread_self(), &calls[place].cpu) == 0;
        renew(&calls[place]);
        if (!timed) calls[place].cpu_ns = -1;
        snprintf(calls[place].name, sizeof calls[place].name, "%s", name);
    }
    pthread_mutex_unlock(&lock);
    return place < FV_STALL_CALLS_MAX ? place : -1;
}

void fv_stall_leave(int place)
{
    pthread_mutex_lock(&lock);
    if (place >= 0) calls[place].id = 0;
    pthread_mutex_unlock(&lock);
}

void fv_stall_move(int place)
{
    clockid_t mine;
    const bool known = pthread_getcpuclockid(pthread_self(), &mine) == 0;
    pthread_mutex_lock(&lock);
    last_move_ns = now_ns();
    for (int i = 0; i < FV_STALL_CALLS_MAX; i++)
        if (calls[i].id != 0 && (i == place || (place < 0 && known && calls[i].cpu == mine)))
            renew(&calls[i]);
    pthread_mutex_unlock(&lock);
}

bool fv_stall_longest(struct fv_stall *call, int64_t *moved_ns)
{
    const struct fv_stall *longest = NULL;
    pthread_mutex_lock(&lock);
    for (int i = 0; i < FV_STALL_CALLS_MAX; i++) {
        if (calls[i].id == 0) continue;
        see(&calls[i]);
        if (longest == NULL || calls[i].since_ns < longest->since_ns) longest = &calls[i];
    }
    if (longest != NULL) *call = *longest;
    *moved_ns = last_move_ns;
    pthread_mutex_unlock(&lock);
    return longest != NULL;
}

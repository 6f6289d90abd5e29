#include "app/run/signals.h"

#include <poll.h>
#include <pthread.h>
#include <signal.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "drivers/clock.h"
#include "drivers/thread.h"
#include "support/say.h"
#include "support/stall.h"

static const int ending[] = {SIGINT, SIGTERM, SIGHUP, SIGXCPU};
enum { ENDING_COUNT = sizeof ending / sizeof *ending, LINE_BYTES = 1024, LOOK_MS = 50 };

static struct fv_signals signals;
static sigset_t waited_for;
static atomic_bool opened;
static clockid_t opening_cpu;         /* processor time of the thread that opens */
static volatile sig_atomic_t strayed; /* came to a thread of a library that blocks none */

struct watch {
    int first; /* the signal that ends the run; 0: none came */
    int64_t first_ns;
    struct fv_stall reported; /* the stalled call of the last line; id 0: it has gone on */
    int64_t opening_cpu_ns;   /* of opening_cpu, when it was last seen to compute */
    int idle_looks;           /* at what is being opened since then, or since the signal */
    int looks;                /* likewise since the signal */
};

static void handle(int number)
{
    strayed = number;
}

/* stderr may be the pipe that stalls, and its lock be held: never wait for either. */
static void line(const char *text)
{
    char whole[LINE_BYTES + 2];
    struct pollfd terminal = {.fd = STDERR_FILENO, .events = POLLOUT};
    snprintf(whole, sizeof whole - 1, "%s", text);
    fv_say_clean(whole);
    const size_t bytes = strlen(whole);
    whole[bytes] = '\n';
    if (poll(&terminal, 1, 0) == 1 && (terminal.revents & POLLOUT) != 0 &&
        write(STDERR_FILENO, whole, bytes + 1) < 0)
        return;
}

static void end_by(int number)
{
    sigset_t this;
    sigemptyset(&this);
    sigaddset(&this, number);
    signal(number, SIG_DFL);
    raise(number);
    pthread_sigmask(SIG_UNBLOCK, &this, NULL);
    _exit(FV_EXIT_FAILED);
}

/* "...: lost are ..." where something is. */
static void end_line(const char *why)
{
    char lost[LINE_BYTES / 2] = "", text[LINE_BYTES];
    if (atomic_load(&opened)) signals.lost(signals.context, lost, sizeof lost);
    snprintf(text, sizeof text, "fovea run: %s%s%s", why, lost[0] != '\0' ? ": lost: " : "", lost);
    line(text);
}

static void take(struct watch *watch, int number, int64_t now)
{
    const bool second = watch->first != 0 && number == SIGINT &&
                        now - watch->first_ns >= FV_SIGNALS_TWICE_MS * 1000000LL;
    if (second) {
        end_line("a second signal ended it at once");
        end_by(number);
    }
    if (number == SIGHUP && signals.reload != NULL) {
        atomic_store(signals.reload, true);
        return;
    }
    if (watch->first != 0) return;
    watch->first = number;
    watch->first_ns = now;
    atomic_store(signals.stop, true);
}

static double seconds(int64_t ns)
{
    return (double)ns * 1e-9;
}

/* Say once that a call stalls, and that it has gone on. */
static void report(struct watch *watch, const struct fv_stall *call, int64_t now)
{
    char text[LINE_BYTES];
    const bool stalls = call->id != 0 && now - call->since_ns >= FV_SIGNALS_STALL_MS * 1000000LL;
    if (watch->reported.id != 0 &&
        (watch->reported.id != call->id || watch->reported.since_ns != call->since_ns)) {
        snprintf(text, sizeof text, "%s: goes on after %.1f s", watch->reported.name,
                 seconds(now - watch->reported.since_ns));
        line(text);
        watch->reported.id = 0;
    }
    if (!stalls || watch->reported.id != 0) return;
    watch->reported = *call;
    snprintf(text, sizeof text, "%s: has taken nothing for %.1f s: its disk or pipe stalls",
             call->name, seconds(now - call->since_ns));
    line(text);
}

static void end_stalled(const struct watch *watch, const struct fv_stall *call, int64_t now)
{
    char why[LINE_BYTES / 2];
    snprintf(why, sizeof why, "ended %.1f s after %s, since %.200s has stalled for %.1f s",
             seconds(now - watch->first_ns), strsignal(watch->first), call->name,
             seconds(now - call->since_ns));
    end_line(why);
    _exit(FV_EXIT_FAILED);
}

/* Whether what is being opened when the signal comes has had its time. What computes goes on, but
 * not for ever: it may ask again and again for what never comes. Time in which this program has no
 * processor is no time of it: looks are counted. */
static bool opening_hangs(struct watch *watch)
{
    const int64_t cpu_ns = fv_clock_ns(opening_cpu);
    if (atomic_load(&opened)) return false;
    watch->idle_looks++;
    watch->looks = watch->first == 0 ? 0 : watch->looks + 1;
    if (watch->first == 0 || cpu_ns - watch->opening_cpu_ns >= FV_STALL_COMPUTES_NS) {
        watch->opening_cpu_ns = cpu_ns;
        watch->idle_looks = 0;
    }
    return watch->idle_looks * LOOK_MS >= FV_SIGNALS_PATIENCE_MS ||
           watch->looks * LOOK_MS >= FV_SIGNALS_DISK_MS;
}

static void look(struct watch *watch, int64_t now)
{
    const int64_t patience_ns = FV_SIGNALS_PATIENCE_MS * 1000000LL;
    struct fv_stall call = {0};
    int64_t moved_ns;
    const bool waits = fv_stall_longest(&call, &moved_ns);
    report(watch, &call, now);
    const bool hangs = opening_hangs(watch);
    if (watch->first == 0 || now - watch->first_ns < patience_ns) return;
    const int64_t call_ns = call.disk ? FV_SIGNALS_DISK_MS * 1000000LL : patience_ns;
    if (waits && now - call.since_ns >= call_ns && now - moved_ns >= call_ns)
        end_stalled(watch, &call, now);
    if (hangs) end_by(watch->first);
}

static void *wait_for_them(void *context)
{
    struct watch watch = {0};
    (void)context;
    for (;;) {
        const struct timespec pause = {.tv_nsec = LOOK_MS * 1000000};
        int number = sigtimedwait(&waited_for, NULL, &pause);
        if (number < 0) {
            number = strayed;
            strayed = 0;
        }
        const int64_t now = fv_clock_ns(CLOCK_MONOTONIC);
        if (number > 0) take(&watch, number, now);
        look(&watch, now);
    }
    return NULL;
}

enum fovea_status fv_signals_watch(const struct fv_signals *wanted, struct fovea_error *error)
{
    const struct sigaction action = {.sa_handler = handle, .sa_flags = SA_RESTART};
    struct sigaction before;
    pthread_t thread;
    signals = *wanted;
    if (pthread_getcpuclockid(pthread_self(), &opening_cpu) != 0)
        opening_cpu = CLOCK_PROCESS_CPUTIME_ID;
    sigemptyset(&waited_for);
    for (int i = 0; i < ENDING_COUNT; i++) {
        sigaction(ending[i], NULL, &before);
        if (ending[i] == SIGHUP && before.sa_handler == SIG_IGN) continue; /* nohup */
        sigaction(ending[i], &action, NULL);
        sigaddset(&waited_for, ending[i]);
    }
    signal(SIGPIPE, SIG_IGN);
    signal(SIGUSR1, SIG_IGN);
    signal(SIGUSR2, SIG_IGN);
    pthread_sigmask(SIG_BLOCK, &waited_for, NULL);
    const int failed = fv_thread_start(&thread, wait_for_them, NULL);
    if (failed != 0)
        return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "no thread to wait for signals: %s",
                               strerror(failed));
    pthread_detach(thread);
    return FOVEA_OK;
}

void fv_signals_opened(void)
{
    atomic_store(&opened, true);
}

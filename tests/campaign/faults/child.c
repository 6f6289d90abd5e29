#include "child.h"

#include <dirent.h>
#include <errno.h>
#include <poll.h>
#include <signal.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include "play.h"

/* Processor time of all threads in ticks; `asleep`: none of them runs, or waits for a processor or
 * a disk. */
static unsigned long ticks_of(pid_t pid, bool *asleep)
{
    char path[64], line[512];
    unsigned long sum = 0;
    (void)snprintf(path, sizeof path, "/proc/%d/task", (int)pid);
    DIR *folder = opendir(path);
    *asleep = folder != NULL;
    for (const struct dirent *entry; folder != NULL && (entry = readdir(folder)) != NULL;) {
        char stat[384];
        if (entry->d_name[0] == '.') continue;
        (void)snprintf(stat, sizeof stat, "%s/%s/stat", path, entry->d_name);
        FILE *file = fopen(stat, "r");
        if (file == NULL) continue;
        const char *behind = fgets(line, sizeof line, file) ? strrchr(line, ')') : NULL;
        char state = 'R';
        unsigned long user = 0, system = 0;
        if (behind == NULL ||
            sscanf(behind + 1, " %c %*s %*s %*s %*s %*s %*s %*s %*s %*s %*s %lu %lu", &state, &user,
                   &system) != 3 ||
            state != 'S')
            *asleep = false;
        sum += user + system;
        fclose(file);
    }
    if (folder != NULL) closedir(folder);
    return sum;
}

bool faults_sleeps(struct faults_sleep *sleep, bool asleep, unsigned long ticks, long per_look)
{
    if (!asleep) sleep->asleep_for = 0;
    if (!asleep) return false;
    if (sleep->asleep_for == 0) sleep->from = ticks;
    if (++sleep->asleep_for <= FAULTS_ASLEEP_S) return false;
    sleep->asleep_for = 0;
    return 100 * (ticks - sleep->from) <= (unsigned long)(FAULTS_ASLEEP_S * per_look);
}

struct child {
    pid_t pid;
    int from; /* what it writes; -1: it has closed that */
    int look_ms;
    uint8_t *result;
    size_t got, bytes;
    int status;
};

/* Take what the child has written. */
static void take(struct child *child)
{
    uint8_t beyond;
    uint8_t *to = child->got < child->bytes ? child->result + child->got : &beyond;
    const size_t room = child->got < child->bytes ? child->bytes - child->got : 1;
    const ssize_t more = read(child->from, to, room);
    if (more > 0 && child->got < child->bytes) child->got += (size_t)more;
    if (more > 0 || (more < 0 && errno == EINTR)) return;
    close(child->from);
    child->from = -1;
}

/* Until the child has ended. False: it sleeps for ever, and was killed. */
static bool watch(struct child *child)
{
    enum { SHORT_MS = 10 };
    const long per_look = sysconf(_SC_CLK_TCK) * child->look_ms / 1000;
    struct faults_sleep sleep = {0};
    int waited_ms = 0;
    while (waitpid(child->pid, &child->status, WNOHANG) == 0) {
        /* Whatever has closed its end of the pipe is about to be gone. */
        const int wait_ms =
            child->from < 0 && SHORT_MS < child->look_ms ? SHORT_MS : child->look_ms;
        struct pollfd wait = {.fd = child->from, .events = POLLIN};
        const int ready = poll(&wait, 1, wait_ms);
        if (ready > 0) take(child);
        if (ready != 0) continue;
        waited_ms += wait_ms;
        if (waited_ms < child->look_ms) continue;
        waited_ms = 0;
        bool asleep;
        const unsigned long ticks = ticks_of(child->pid, &asleep);
        if (!faults_sleeps(&sleep, asleep, ticks, per_look)) continue;
        kill(child->pid, SIGKILL);
        while (waitpid(child->pid, &child->status, 0) < 0 && errno == EINTR) {
        }
        return false;
    }
    while (child->from >= 0)
        take(child);
    return true;
}

_Noreturn static void be_child(void (*work)(const void *argument, void *result),
                               const void *argument, size_t bytes, int to)
{
    const struct rlimit limit = {FAULTS_CPU_S, FAULTS_CPU_S + 10};
    void *result = calloc(1, bytes);
    if (result == NULL || setrlimit(RLIMIT_CPU, &limit)) faults_die("no memory");
    work(argument, result);
    for (size_t sent = 0; sent < bytes;) {
        const ssize_t more = write(to, (const char *)result + sent, bytes - sent);
        if (more <= 0) faults_die("the result cannot be written");
        sent += (size_t)more;
    }
    free(result);
    exit(0);
}

enum faults_end faults_in_child(void (*work)(const void *argument, void *result),
                                const void *argument, void *result, size_t bytes, int look_ms)
{
    int ends[2];
    struct child child = {.bytes = bytes, .look_ms = look_ms, .result = malloc(bytes)};
    fflush(NULL);
    if (child.result == NULL || pipe(ends)) faults_die("no memory, or no pipe");
    child.pid = fork();
    if (child.pid < 0) faults_die("no process");
    if (child.pid == 0) {
        close(ends[0]);
        be_child(work, argument, bytes, ends[1]);
    }
    close(ends[1]);
    child.from = ends[0];
    const bool hangs = !watch(&child);
    if (child.from >= 0) close(child.from);
    const int status = child.status;
    const bool too_long = WIFSIGNALED(status) && WTERMSIG(status) == SIGXCPU,
               well = !hangs && child.got == bytes && status == 0;
    if (well) memcpy(result, child.result, bytes);
    free(child.result);
    if (hangs) printf("  HANG: all threads slept for %d looks\n", FAULTS_ASLEEP_S);
    if (too_long) printf("  HANG: more than %d s of processor time\n", FAULTS_CPU_S);
    if (hangs || too_long) return FAULTS_HANG;
    if (well) return FAULTS_WELL;
    if (WIFSIGNALED(status))
        printf("  CRASH: ended by signal %d (%s)\n", WTERMSIG(status), strsignal(WTERMSIG(status)));
    else
        printf("  CRASH: ended with status %d\n", WEXITSTATUS(status));
    return FAULTS_CRASH;
}

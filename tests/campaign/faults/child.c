#include "child.h"

#include <dirent.h>
#include <errno.h>
#include <poll.h>
#include <signal.h>
#include <stdbool.h>
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

/* Read the result as it comes; false: it did not come whole. `hangs`: the child sleeps for ever. */
static bool take_result(int from, pid_t pid, void *result, size_t bytes, bool *hangs)
{
    size_t got = 0;
    unsigned long before = 0;
    int asleep_for = 0;
    while (got < bytes && !*hangs) {
        struct pollfd wait = {.fd = from, .events = POLLIN};
        const int ready = poll(&wait, 1, 1000);
        if (ready < 0 && errno != EINTR) return false;
        if (ready <= 0) {
            bool asleep;
            const unsigned long ticks = ticks_of(pid, &asleep);
            asleep_for = asleep && ticks == before ? asleep_for + 1 : 0;
            before = ticks;
            *hangs = asleep_for >= FAULTS_ASLEEP_S;
            continue;
        }
        const ssize_t more = read(from, (char *)result + got, bytes - got);
        if (more <= 0) return false;
        got += (size_t)more;
    }
    return !*hangs;
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
                                const void *argument, void *result, size_t bytes)
{
    int ends[2], status = 0;
    bool hangs = false;
    void *found = malloc(bytes);
    fflush(NULL);
    if (found == NULL || pipe(ends)) faults_die("no memory, or no pipe");
    const pid_t pid = fork();
    if (pid < 0) faults_die("no process");
    if (pid == 0) {
        close(ends[0]);
        be_child(work, argument, bytes, ends[1]);
    }
    close(ends[1]);
    const bool whole = take_result(ends[0], pid, found, bytes, &hangs);
    if (hangs) kill(pid, SIGKILL);
    close(ends[0]);
    while (waitpid(pid, &status, 0) < 0 && errno == EINTR) {
    }
    const bool too_long = WIFSIGNALED(status) && WTERMSIG(status) == SIGXCPU;
    if (whole && status == 0) memcpy(result, found, bytes);
    free(found);
    if (hangs) printf("  HANG: all threads slept for %d s\n", FAULTS_ASLEEP_S);
    if (too_long) printf("  HANG: more than %d s of processor time\n", FAULTS_CPU_S);
    if (hangs || too_long) return FAULTS_HANG;
    if (whole && status == 0) return FAULTS_WELL;
    if (WIFSIGNALED(status))
        printf("  CRASH: ended by signal %d (%s)\n", WTERMSIG(status), strsignal(WTERMSIG(status)));
    else
        printf("  CRASH: ended with status %d\n", WEXITSTATUS(status));
    return FAULTS_CRASH;
}

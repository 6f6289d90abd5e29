#include "child.h"

#include <fcntl.h>
#include <sched.h>
#include <signal.h>
#include <spawn.h>
#include <unistd.h>

#include "protocol.h"

extern char **environ;

/* Whether a child of this thread would be real-time. Under the service it is not, as the service
 * manager asked for that, and a call that changes it is forbidden there. */
static bool inherits_real_time(void)
{
    const int policy = sched_getscheduler(0);
    return policy >= 0 && policy != SCHED_OTHER && (policy & SCHED_RESET_ON_FORK) == 0;
}

/* Signals of the terminal are for the runtime; everything else is as in a program just started. */
static void set_attributes(posix_spawnattr_t *attributes)
{
    static const int mine[] = {SIGINT, SIGTERM, SIGHUP, SIGQUIT, SIGPIPE};
    const struct sched_param ordinary = {.sched_priority = 0};
    sigset_t blocked, reset;
    sigemptyset(&blocked);
    for (size_t i = 0; i < sizeof mine / sizeof mine[0]; i++)
        sigaddset(&blocked, mine[i]);
    sigfillset(&reset);
    posix_spawnattr_setsigmask(attributes, &blocked);
    posix_spawnattr_setsigdefault(attributes, &reset);
    posix_spawnattr_setschedpolicy(attributes, SCHED_OTHER);
    posix_spawnattr_setschedparam(attributes, &ordinary);
    posix_spawnattr_setflags(attributes,
                             (short)(POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF |
                                     (inherits_real_time() ? POSIX_SPAWN_SETSCHEDULER : 0)));
}

int fv_libcamera_spawn(const char *path, int socket, pid_t *pid)
{
    char name[] = FV_LIBCAMERA_PROGRAM;
    char *arguments[] = {name, NULL};
    posix_spawn_file_actions_t files;
    posix_spawnattr_t attributes;
    posix_spawn_file_actions_init(&files);
    posix_spawnattr_init(&attributes);
    set_attributes(&attributes);
    posix_spawn_file_actions_addopen(&files, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
    posix_spawn_file_actions_adddup2(&files, STDERR_FILENO, STDOUT_FILENO);
    posix_spawn_file_actions_adddup2(&files, socket, FV_LIBCAMERA_SOCKET);
    posix_spawn_file_actions_addclosefrom_np(&files, FV_LIBCAMERA_SOCKET + 1);
    const int failure = posix_spawn(pid, path, &files, &attributes, arguments, environ);
    posix_spawnattr_destroy(&attributes);
    posix_spawn_file_actions_destroy(&files);
    return failure;
}

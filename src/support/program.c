#include "support/program.h"

#include <signal.h>
#include <spawn.h>
#include <stdint.h>
#include <string.h>
#include <unistd.h>

extern char **environ;

bool fv_program_beside(const char *name, char *path, size_t bytes)
{
    const ssize_t length = readlink("/proc/self/exe", path, bytes - 1);
    if (length <= 0) return false;
    path[length] = '\0';
    char *last = strrchr(path, '/');
    if (last == NULL || (size_t)(last + 1 - path) + strlen(name) >= bytes) return false;
    strcpy(last + 1, name);
    return access(path, X_OK) == 0;
}

static void set_attributes(posix_spawnattr_t *attributes)
{
    struct sigaction hangup;
    sigset_t none, all;
    sigemptyset(&none);
    sigfillset(&all);
    if (sigaction(SIGHUP, NULL, &hangup) == 0 && hangup.sa_handler == SIG_IGN)
        sigdelset(&all, SIGHUP);
    posix_spawnattr_setsigmask(attributes, &none);
    posix_spawnattr_setsigdefault(attributes, &all);
    posix_spawnattr_setflags(attributes, POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF);
}

int fv_program_start(const char *path, const char *const *words, pid_t *process)
{
    posix_spawnattr_t attributes;
    posix_spawn_file_actions_t files;
    int failed = posix_spawnattr_init(&attributes);
    if (failed != 0) return failed;
    set_attributes(&attributes);
    failed = posix_spawn_file_actions_init(&files);
    if (failed == 0) {
        posix_spawn_file_actions_addclosefrom_np(&files, STDERR_FILENO + 1);
        failed = posix_spawn(process, path, &files, &attributes, (char *const *)(uintptr_t)words,
                             environ);
        posix_spawn_file_actions_destroy(&files);
    }
    posix_spawnattr_destroy(&attributes);
    return failed;
}

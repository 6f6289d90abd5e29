#include "app/signals.h"

#include <pthread.h>
#include <stdbool.h>
#include <stddef.h>

static atomic_bool *stopping;
static atomic_bool opened;

static void handle(int number)
{
    if (atomic_load(&opened)) {
        atomic_store(stopping, true);
        return;
    }
    signal(number, SIG_DFL);
    raise(number);
}

void fv_signals_prepare(atomic_bool *stop)
{
    const struct sigaction action = {.sa_handler = handle, .sa_flags = SA_RESTART};
    sigset_t loop_ended;
    stopping = stop;
    sigaction(SIGINT, &action, NULL);
    sigaction(SIGTERM, &action, NULL);
    signal(SIGPIPE, SIG_IGN);
    sigemptyset(&loop_ended);
    sigaddset(&loop_ended, SIGUSR1);
    pthread_sigmask(SIG_BLOCK, &loop_ended, NULL);
}

void fv_signals_block(sigset_t *set)
{
    sigemptyset(set);
    sigaddset(set, SIGINT);
    sigaddset(set, SIGTERM);
    sigaddset(set, SIGUSR1);
    pthread_sigmask(SIG_BLOCK, set, NULL);
    atomic_store(&opened, true);
}

#include "app/signals.h"

#include <pthread.h>
#include <stdbool.h>
#include <stddef.h>
#include <unistd.h>

static atomic_bool *stopping;
static atomic_bool opened;
static volatile sig_atomic_t first; /* the signal that came while things are opened */

static void handle(int number)
{
    const bool late = number == SIGALRM;
    if (atomic_load(&opened) || (!late && !atomic_exchange(stopping, true))) {
        atomic_store(stopping, true);
        first = number;
        if (!atomic_load(&opened)) alarm(FV_SIGNALS_PATIENCE_S);
        return;
    }
    number = late ? first : number;
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
    sigaction(SIGALRM, &action, NULL);
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
    alarm(0);
}

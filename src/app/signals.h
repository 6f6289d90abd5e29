/* What SIGINT and SIGTERM do to a run. While it opens things, which may take for ever, they end the program; afterwards
 * the thread that watches the loop waits for them and ends the loop. SIGUSR1 is the loop's sign that it has ended. */
#ifndef FOVEA_APP_SIGNALS_H
#define FOVEA_APP_SIGNALS_H

#include <signal.h>
#include <stdatomic.h>

/* Before anything is opened and before any thread is started. `stop` is set by a signal that comes after
 * fv_signals_block to a thread of a library, which may block none. */
void fv_signals_prepare(atomic_bool *stop);

/* When all is open: the set that sigtimedwait shall wait for, blocked for this thread and those that it starts. */
void fv_signals_block(sigset_t *set);

#endif

/* What SIGINT and SIGTERM do to a run. The thread that watches the loop waits for them and ends the
 * loop. One that comes while things are still opened lets that finish, and the loop ends before its
 * first frame; but opening may take for ever, so it ends the program when that is not done after
 * FV_SIGNALS_PATIENCE_S, and so does a second one. SIGUSR1 is the loop's sign that it has ended. */
#ifndef FOVEA_APP_SIGNALS_H
#define FOVEA_APP_SIGNALS_H

#include <signal.h>
#include <stdatomic.h>

enum { FV_SIGNALS_PATIENCE_S = 5 };

/* Before anything is opened and before any thread is started. `stop` is set by a signal that comes
 * before fv_signals_block, and by one that comes later to a thread of a library, which may block
 * none. Takes SIGALRM. */
void fv_signals_prepare(atomic_bool *stop);

/* When all is open: the set that sigtimedwait shall wait for, blocked for this thread and those
 * that it starts. */
void fv_signals_block(sigset_t *set);

#endif

/* How signals end a run. A thread of its own waits for them and for calls that stall, since any
 * other thread may be stuck in a write.
 *
 * SIGHUP sets `reload`, where there is one. SIGINT, SIGTERM, SIGXCPU, and SIGHUP where there is
 * none (and not under nohup), set `stop`: the loop ends after its frame, the map is saved, the
 * recording closed. A SIGINT that comes FV_SIGNALS_TWICE_MS or more after the first signal ends the
 * program at once, by that signal; earlier it counts as the same (timeout(1) sends it twice).
 * SIGUSR1, SIGUSR2 and SIGPIPE are ignored.
 *
 * A call of support/stall.h that has waited for FV_SIGNALS_STALL_MS is named in a line on stderr.
 * After a signal, when one has waited for FV_SIGNALS_PATIENCE_MS, or for a disk for
 * FV_SIGNALS_DISK_MS, and nothing else was written in that time, the program ends with
 * FV_EXIT_FAILED and a line that says what is lost. What is still being opened
 * when the signal comes may go on while it computes, for FV_SIGNALS_DISK_MS at most, and otherwise
 * for FV_SIGNALS_PATIENCE_MS; then the signal ends the program. Time in which this program has no
 * processor does not count. */
#ifndef FOVEA_APP_RUN_SIGNALS_H
#define FOVEA_APP_RUN_SIGNALS_H

#include <stdatomic.h>
#include <stddef.h>

#include "fovea/status.h"

enum {
    FV_SIGNALS_TWICE_MS = 200,
    FV_SIGNALS_STALL_MS = 1000,
    FV_SIGNALS_PATIENCE_MS = 2000,
    FV_SIGNALS_DISK_MS = 15000
};

/* Called on the watching thread while others are stuck: no heap, no stdio, no lock. */
struct fv_signals {
    atomic_bool *stop;
    /* Name in `text` what is lost when the run ends now; "" when nothing is. */
    void (*lost)(const void *context, char *text, size_t bytes);
    const void *context;
    atomic_bool *reload; /* NULL: SIGHUP ends the run */
};

/* Before anything is opened, on the thread that opens, and before any other thread is started,
 * which all inherit what is blocked here; once in a process. `signals` stays the caller's and lives
 * as long as the process.
 */
enum fovea_status fv_signals_watch(const struct fv_signals *signals, struct fovea_error *error);

/* All is open: from now on a signal ends a run. */
void fv_signals_opened(void);

#endif

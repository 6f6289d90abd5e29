#include "support/progress.h"

#include <inttypes.h>
#include <stdio.h>
#include <time.h>

#include "support/say.h"

static int64_t now_ns(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec * 1000000000 + now.tv_nsec;
}

void fv_progress_begin(struct fv_progress *progress, const char *what)
{
    *progress = (struct fv_progress){.what = what, .terminal = fv_say_terminal()};
}

void fv_progress_show(struct fv_progress *progress, uint64_t frames, double fraction)
{
    enum { SHORTEST_NS = 200000000 };
    if (!progress->terminal) return;
    const int64_t now = now_ns(), passed = now - progress->shown_ns;
    if (progress->shown_ns != 0 && passed < SHORTEST_NS) return;
    char percent[32] = "", rate[32] = "";
    if (fraction >= 0.0) snprintf(percent, sizeof percent, "  %.0f %%", 100.0 * fraction);
    if (progress->shown_ns != 0)
        snprintf(rate, sizeof rate, "  %.0f Hz",
                 (double)(frames - progress->frames) * 1e9 / (double)passed);
    fv_say_status("%s  frame %" PRIu64 "%s%s", progress->what, frames, percent, rate);
    progress->shown_ns = now;
    progress->frames = frames;
}

void fv_progress_end(struct fv_progress *progress)
{
    if (progress->terminal) fv_say_status("%s", "");
}

/* fovea compare: where two runs on the same inputs became different. */
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "app/config/options.h"
#include "app/watch/bus.h"
#include "app/watch/commands.h"
#include "app/watch/pairs.h"
#include "drivers/clock.h"
#include "support/say.h"

enum { HELD_BYTES_MAX = 64 << 20 }; /* of each run: an hour at 30 Hz */

struct side {
    struct fv_pairs *pairs;
    int run;
};

static void take(void *context, const struct fv_received *received)
{
    const struct side *side = context;
    fv_pairs_take(side->pairs, side->run, received->data, received->bytes);
}

/* Hear both until it is done, or told to end, or for `timeout_s` no two were compared. True: so
 * long was the silence. */
static bool hear(struct fv_bus *bus, struct fv_pairs *pairs, char **prefixes, uint64_t timeout_s)
{
    const int64_t timeout_ns = (int64_t)timeout_s * FV_SECOND_NS;
    int64_t until_ns = fv_clock_ns(CLOCK_MONOTONIC) + timeout_ns;
    uint64_t iterations = 0;
    while (!fv_pairs_done(pairs) && !fv_bus_ended()) {
        if (fv_clock_ns(CLOCK_MONOTONIC) >= until_ns) return true;
        fv_bus_wait(bus, until_ns);
        const uint64_t now = fv_pairs_found(pairs, prefixes, false).iterations;
        if (now != iterations) until_ns = fv_clock_ns(CLOCK_MONOTONIC) + timeout_ns;
        iterations = now;
    }
    return false;
}

/* Two runs that are heard, until they differ, `iterations` were equal, the end, or silence. */
static enum fovea_status live(struct fv_bus *bus, char **prefixes, uint64_t iterations,
                              uint64_t timeout_s, struct fv_compared *compared,
                              struct fovea_error *error)
{
    struct fv_receiver_channel rows[2];
    struct side sides[2];
    struct fv_pairs *pairs = fv_pairs_open(HELD_BYTES_MAX, iterations);
    if (pairs == NULL) return fovea_error_set(error, FOVEA_ERROR_MEMORY, "no memory");
    enum fovea_status status = FOVEA_OK;
    for (int i = 0; i < 2 && status == FOVEA_OK; i++) {
        char channel[128];
        snprintf(channel, sizeof channel, "%.100s_LOCKSTEP", prefixes[i]);
        status = fv_bus_row(channel, &rows[i], error);
        sides[i] = (struct side){pairs, i};
        rows[i].take = take;
        rows[i].context = &sides[i];
    }
    if (status == FOVEA_OK) status = fv_bus_open(bus, rows, 2, error);
    if (status == FOVEA_OK) {
        const bool silent = hear(bus, pairs, prefixes, timeout_s);
        fv_bus_close(bus);
        *compared = fv_pairs_found(pairs, prefixes, silent);
        fv_say_clean(compared->stage);
        fv_say_clean(compared->message);
    }
    fv_pairs_close(pairs);
    return status;
}

static enum fv_exit report(const struct fv_compared *compared, const char *a, const char *b)
{
    const bool equal = compared->iterations > 0 && !compared->incomplete;
    if (!compared->different) {
        printf("equal: %" PRIu64 " iterations, %" PRIu64 " of them with hashes of the state%s%s\n",
               compared->iterations, compared->hashed, compared->ended[0] != '\0' ? "; " : "",
               compared->ended);
        return equal ? FV_EXIT_OK : FV_EXIT_FAILED;
    }
    printf("different: %s from %s at frame %" PRId64 " (iteration %" PRIu64 ", stamp %" PRId64
           " ns), after %" PRIu64 " equal iterations",
           b, a, compared->sequence, compared->iteration, compared->stamp_ns, compared->iterations);
    if (compared->unseen > 0)
        printf("; iterations %" PRIu64 " to %" PRIu64 " were not seen of both, so what differed "
               "first is not known; at this one",
               compared->iteration - compared->unseen, compared->iteration - 1);
    const char *word = compared->unseen > 0 ? "" : "first ";
    if (compared->inputs[0] != '\0')
        printf(": inputs: %s\n", compared->inputs);
    else
        printf(": equal inputs; %sstage: %s; %smessage: %s\n", word,
               compared->stage[0] != '\0' ? compared->stage : "none that is known", word,
               compared->message[0] != '\0' ? compared->message : "none");
    return FV_EXIT_FAILED;
}

static bool is_file(const char *path)
{
    struct stat status;
    return stat(path, &status) == 0 && !S_ISDIR(status.st_mode);
}

int fv_command_compare(int argc, char **argv)
{
    struct fv_bus bus = {0};
    uint64_t iterations = 0, timeout_s = 10;
    bool heard = false;
    const struct fv_option options[] = {
        {"live", NULL, FV_OPTION_FLAG, &heard,
         "A and B are the channel_prefix of two runs that are heard, each with lockstep_every"},
        {"iterations", "N", FV_OPTION_POSITIVE, &iterations,
         "with --live: end when N of them were equal"},
        {"timeout", "SECONDS", FV_OPTION_POSITIVE, &timeout_s,
         "with --live: end when no two iterations could be compared for so long (default 10)"},
        FV_BUS_OPTIONS(bus),
        {0},
    };
    struct fv_compared compared = {0};
    struct fovea_error error = {0};
    int first;
    const enum fv_options_result result =
        fv_options_parse(options, "A B", 2, 2, argc, argv, &first);
    if (result != FV_OPTIONS_READ) return result == FV_OPTIONS_HELP ? FV_EXIT_OK : FV_EXIT_WRONG;
    if (timeout_s > 1000000) timeout_s = 1000000;
    char **sides = argv + first;
    if (heard && is_file(sides[0]))
        return fv_say_wrong("fovea compare: found the file %s with --live, expected a prefix of "
                            "channels such as FOVEA",
                            sides[0]);
    const enum fovea_status status =
        heard ? live(&bus, sides, iterations, timeout_s, &compared, &error)
              : fv_compare_recordings(sides[0], sides[1], &compared, &error);
    if (status == FOVEA_ERROR_INPUT && compared.iterations > 0)
        return fv_say_wrong("fovea compare: %s; %" PRIu64 " iterations before were equal",
                            error.text, compared.iterations);
    if (status != FOVEA_OK)
        return status == FOVEA_ERROR_INPUT ? fv_say_wrong("fovea compare: %s", error.text)
                                           : fv_say_failed("fovea compare: %s", error.text);
    return report(&compared, sides[0], sides[1]);
}

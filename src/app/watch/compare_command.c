/* fovea compare: where two runs on the same inputs became different. */
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "app/config/options.h"
#include "app/watch/bus.h"
#include "app/watch/commands.h"
#include "app/watch/compare.h"
#include "drivers/clock.h"
#include "message/fields.h"
#include "support/say.h"

#include "fovea_lockstep_t.h"

enum { WAITING_MAX = 256, LOCKSTEP_BYTES_MAX = 16384 };

/* Messages of one run that the other has not sent yet, the oldest overwritten first. */
struct board {
    struct pair *pair;
    uint64_t count;
    struct waiting {
        int64_t iteration, stamp_ns, sequence;
        uint32_t bytes; /* 0: free */
        uint8_t data[LOCKSTEP_BYTES_MAX];
    } waiting[WAITING_MAX];
};

struct pair {
    struct board boards[2];
    uint64_t unheard;  /* iterations of one run that were given up: the other's did not come */
    int64_t paired_ns; /* when two were compared last */
    struct fv_compared compared;
};

static void take(void *context, const struct fv_received *received)
{
    struct board *board = context, *other = &board->pair->boards[board == board->pair->boards];
    struct fv_compared *compared = &board->pair->compared;
    const char *problem;
    size_t at;
    fovea_lockstep_t message;
    if (compared->different || received->bytes > LOCKSTEP_BYTES_MAX ||
        !fv_message_check("fovea.lockstep_t", received->data, received->bytes, &problem, &at) ||
        fovea_lockstep_t_decode(received->data, 0, (int)received->bytes, &message) < 0)
        return;
    const int64_t iteration = message.iteration, stamp_ns = message.stamp.time_ns,
                  sequence = message.stamp.sequence;
    fovea_lockstep_t_decode_cleanup(&message);
    for (int i = 0; i < WAITING_MAX; i++) {
        struct waiting *partner = &other->waiting[i];
        if (partner->bytes == 0 || partner->iteration != iteration) continue;
        const bool first = board == board->pair->boards;
        if (partner->stamp_ns != stamp_ns)
            snprintf(compared->inputs, sizeof compared->inputs,
                     "stamp.time_ns: found %" PRId64 ", expected %" PRId64,
                     first ? partner->stamp_ns : stamp_ns, first ? stamp_ns : partner->stamp_ns);
        board->pair->paired_ns = fv_clock_ns(CLOCK_MONOTONIC);
        compared->different = partner->stamp_ns != stamp_ns;
        compared->different |= !fv_compare_lockstep(
            first ? received->data : partner->data, first ? received->bytes : partner->bytes,
            first ? partner->data : received->data, first ? partner->bytes : received->bytes,
            compared);
        partner->bytes = 0;
        compared->iteration = (uint64_t)iteration;
        compared->sequence = sequence;
        compared->stamp_ns = stamp_ns;
        compared->iterations += !compared->different;
        compared->hashed = compared->iterations;
        return;
    }
    struct waiting *place = &board->waiting[board->count++ % WAITING_MAX];
    board->pair->unheard += place->bytes != 0;
    *place = (struct waiting){.iteration = iteration, .stamp_ns = stamp_ns, .sequence = sequence};
    place->bytes = received->bytes;
    memcpy(place->data, received->data, received->bytes);
}

/* What one run sent and the other did not: a message that was lost on the way, or a run that has
 * ended, or stands. The last iteration may be on its way. */
static void tell_unheard(const struct pair *pair, char **prefixes, struct fv_compared *compared)
{
    uint64_t waiting[2] = {0, 0};
    for (int board = 0; board < 2; board++)
        for (int i = 0; i < WAITING_MAX; i++)
            waiting[board] += pair->boards[board].waiting[i].bytes != 0;
    const int other = waiting[1] > waiting[0] ? 0 : 1; /* that said less */
    const uint64_t unheard = pair->unheard + waiting[1 - other];
    if (!compared->different && unheard > 1)
        snprintf(compared->ended, sizeof compared->ended,
                 "%" PRIu64 " were not compared, since %.100s did not send them", unheard,
                 prefixes[other]);
}

/* Two runs that are heard, until they differ, `iterations` were equal, the end, or silence. */
static enum fovea_status live(struct fv_bus *bus, char **prefixes, uint64_t iterations,
                              uint64_t timeout_s, struct fv_compared *compared,
                              struct fovea_error *error)
{
    struct fv_receiver_channel rows[2];
    struct pair *pair = calloc(1, sizeof *pair);
    if (pair == NULL) return fovea_error_set(error, FOVEA_ERROR_MEMORY, "no memory");
    enum fovea_status status = FOVEA_OK;
    for (int i = 0; i < 2 && status == FOVEA_OK; i++) {
        char channel[128];
        snprintf(channel, sizeof channel, "%.100s_LOCKSTEP", prefixes[i]);
        pair->boards[i].pair = pair;
        status = fv_bus_row(channel, &rows[i], error);
        rows[i].take = take;
        rows[i].context = &pair->boards[i];
    }
    if (status == FOVEA_OK) status = fv_bus_open(bus, rows, 2, error);
    if (status == FOVEA_OK) {
        const int64_t timeout_ns = (int64_t)timeout_s * FV_SECOND_NS;
        pair->paired_ns = fv_clock_ns(CLOCK_MONOTONIC);
        while (!pair->compared.different && !fv_bus_ended() &&
               (iterations == 0 || pair->compared.iterations < iterations) &&
               fv_clock_ns(CLOCK_MONOTONIC) < pair->paired_ns + timeout_ns &&
               fv_bus_wait(bus, pair->paired_ns + timeout_ns) > 0) {
        }
        fv_bus_close(bus);
        *compared = pair->compared;
        tell_unheard(pair, prefixes, compared);
        fv_say_clean(compared->stage);
        fv_say_clean(compared->message);
    }
    free(pair);
    return status;
}

static enum fv_exit report(const struct fv_compared *compared, const char *a, const char *b)
{
    if (!compared->different) {
        printf("equal: %" PRIu64 " iterations, %" PRIu64 " of them with hashes of the state%s%s\n",
               compared->iterations, compared->hashed, compared->ended[0] != '\0' ? "; " : "",
               compared->ended);
        return compared->iterations > 0 && compared->ended[0] == '\0' ? FV_EXIT_OK : FV_EXIT_FAILED;
    }
    printf("different: %s from %s at frame %" PRId64 " (iteration %" PRIu64 ", stamp %" PRId64
           " ns), after %" PRIu64 " equal iterations: ",
           b, a, compared->sequence, compared->iteration, compared->stamp_ns, compared->iterations);
    if (compared->inputs[0] != '\0')
        printf("inputs: %s\n", compared->inputs);
    else
        printf("equal inputs; first stage: %s; first message: %s\n",
               compared->stage[0] != '\0' ? compared->stage : "none that is known",
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
         "with --live: end when nothing has come for so long (default 10)"},
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
    if (status != FOVEA_OK)
        return status == FOVEA_ERROR_INPUT ? fv_say_wrong("fovea compare: %s", error.text)
                                           : fv_say_failed("fovea compare: %s", error.text);
    return report(&compared, sides[0], sides[1]);
}

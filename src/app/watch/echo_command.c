/* fovea echo: the messages of channels, one line of JSON each. */
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "app/config/options.h"
#include "app/watch/bus.h"
#include "app/watch/commands.h"
#include "drivers/clock.h"
#include "fovea/fields.h"
#include "message/message.h"
#include "support/say.h"
#include "support/json.h"

struct echo {
    uint64_t count_max; /* 0: without limit */
    uint64_t count;
    char *text; /* of a message; grows */
    size_t capacity;
    bool no_memory;
};

/* The message as JSON in echo->text; false: it is none, or there is no memory. */
static bool to_json(struct echo *echo, const struct fv_received *received,
                    struct fovea_error *error)
{
    size_t length = 0;
    for (;;) {
        if (fovea_message_json(received->data, received->bytes, echo->text, echo->capacity, &length,
                               error) != FOVEA_OK)
            return false;
        if (length < echo->capacity) return true;
        char *larger = realloc(echo->text, 2 * length);
        if (larger == NULL) {
            echo->no_memory = true;
            return false;
        }
        echo->text = larger;
        echo->capacity = 2 * length;
    }
}

static void take(void *context, const struct fv_received *received)
{
    struct echo *echo = context;
    struct fovea_error error = {0};
    if (echo->count_max > 0 && echo->count == echo->count_max) return;
    const bool whole = to_json(echo, received, &error);
    if (echo->no_memory) return;
    echo->count++;
    fputs("{\"channel\":", stdout);
    fv_json_text(stdout, received->channel);
    printf(",\"utime\":%" PRId64 ",\"host\":%s,\"bytes\":%" PRIu32 ",\"message\":%s",
           fv_clock_ns(CLOCK_REALTIME) / 1000, received->from_host ? "true" : "false",
           received->bytes, whole ? echo->text : "null");
    if (!whole) {
        fputs(",\"problem\":", stdout);
        fv_json_text(stdout, error.text);
    }
    puts("}");
}

/* A message's bare name is no channel of a run, unless its channel_prefix is empty. */
static void say_prefix(const char *channel)
{
    char name[FV_MESSAGE_CHANNEL_BYTES];
    for (int kind = 0; kind < FV_MESSAGE_KIND_COUNT; kind++) {
        fv_message_channel("", (enum fv_message_kind)kind, name);
        if (strcmp(name, channel) != 0) continue;
        fv_message_channel("FOVEA", (enum fv_message_kind)kind, name);
        fv_say_note("fovea echo: %s: runs send %s, unless their channel_prefix is another", channel,
                    name);
    }
}

/* Until the count, the end, or silence for `timeout_s`. */
static void listen_to(struct fv_bus *bus, struct echo *echo, uint64_t timeout_s)
{
    const int64_t timeout_ns = (int64_t)timeout_s * FV_SECOND_NS;
    while ((echo->count_max == 0 || echo->count < echo->count_max) && !echo->no_memory) {
        const uint64_t before = echo->count;
        fv_bus_wait(bus, timeout_s > 0 ? fv_clock_ns(CLOCK_MONOTONIC) + timeout_ns : 0);
        if (fflush(stdout) != 0 || fv_bus_ended() || echo->count == before) break;
    }
}

static enum fv_exit verdict(const struct echo *echo)
{
    char wanted[32] = "";
    if (echo->no_memory) return fv_say_failed("fovea echo: no memory for a message");
    if (ferror(stdout)) return FV_EXIT_OK; /* fv_dispatch says so */
    if (fv_bus_ended() || (echo->count > 0 && echo->count >= echo->count_max)) return FV_EXIT_OK;
    if (echo->count_max > 0) snprintf(wanted, sizeof wanted, " of %" PRIu64, echo->count_max);
    return fv_say_failed("fovea echo: %" PRIu64 "%s messages came ('fovea check' says what keeps "
                         "messages back)",
                         echo->count, wanted);
}

int fv_command_echo(int argc, char **argv)
{
    struct fv_bus bus = {0};
    struct echo echo = {0};
    uint64_t timeout_s = 0;
    const struct fv_option options[] = {
        {"count", "N", FV_OPTION_POSITIVE, &echo.count_max, "end after N messages"},
        {"timeout", "SECONDS", FV_OPTION_POSITIVE, &timeout_s,
         "end when none has come for so long; the exit status is 1 when there was none, or fewer "
         "than --count"},
        FV_BUS_OPTIONS(bus),
        {0},
    };
    struct fv_receiver_channel rows[FV_RECEIVER_CHANNELS_MAX];
    struct fovea_error error;
    int first;
    const enum fv_options_result result =
        fv_options_parse(options, "CHANNEL...", 1, FV_RECEIVER_CHANNELS_MAX, argc, argv, &first);
    if (result != FV_OPTIONS_READ) return result == FV_OPTIONS_HELP ? FV_EXIT_OK : FV_EXIT_WRONG;
    if (timeout_s > 1000000) timeout_s = 1000000;
    enum fovea_status status = FOVEA_OK;
    for (int i = first; status == FOVEA_OK && i < argc; i++) {
        status = fv_bus_row(argv[i], &rows[i - first], &error);
        rows[i - first].take = take;
        if (status == FOVEA_OK) say_prefix(argv[i]);
        rows[i - first].context = &echo;
    }
    if (status == FOVEA_OK) status = fv_bus_open(&bus, rows, (uint32_t)(argc - first), &error);
    if (status != FOVEA_OK)
        return status == FOVEA_ERROR_INPUT ? fv_say_wrong("fovea echo: %s", error.text)
                                           : fv_say_failed("fovea echo: %s", error.text);
    listen_to(&bus, &echo, timeout_s);
    fv_bus_close(&bus);
    free(echo.text);
    return verdict(&echo);
}

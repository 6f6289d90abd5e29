/* fovea replay: run a recording again, and verify or publish what it gives. */
#include <inttypes.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>

#include "app/run/commands.h"
#include "support/files.h"
#include "app/config/options.h"
#include "app/record/replay.h"
#include "support/progress.h"
#include "support/say.h"
#include "app/config/setup.h"
#include "app/network/transport.h"
#include "drivers/clock.h"

struct sending {
    struct fv_transport *transport; /* NULL: nothing is sent */
    struct fv_progress progress;
    double recording_bytes; /* 0: not known */
    const struct fv_replay_result *result;
    bool paced, started;
    int64_t first_ns, begin_ns; /* stamp of the first step, and when its messages were sent */
};

static void send(void *context, int64_t now_ns, const struct fovea_outputs *outputs)
{
    struct sending *sending = context;
    fv_progress_show(&sending->progress, sending->result->frames,
                     sending->recording_bytes > 0.0
                         ? (double)sending->result->offset / sending->recording_bytes
                         : -1.0);
    if (sending->transport == NULL) return;
    if (!sending->started) {
        sending->first_ns = now_ns;
        sending->begin_ns = fv_clock_ns(CLOCK_MONOTONIC);
        sending->started = true;
        const struct fv_identity *identity = &sending->result->identity;
        if (identity->run_id != 0)
            fv_transport_repeat(sending->transport, identity->channel, identity->data,
                                identity->bytes);
    }
    int64_t wait_ns;
    if (sending->paced && !__builtin_sub_overflow(now_ns, sending->first_ns, &wait_ns)) {
        wait_ns -= fv_clock_ns(CLOCK_MONOTONIC) - sending->begin_ns;
        const struct timespec wait = fv_clock_timespec(wait_ns);
        if (wait_ns > 0 && wait_ns < 10 * FV_SECOND_NS) nanosleep(&wait, NULL);
    }
    while (!fv_transport_room(sending->transport, false))
        nanosleep(&(struct timespec){.tv_nsec = 1000000}, NULL);
    fv_transport_publish(sending->transport, outputs);
}

static void print_end(const struct fv_replay_result *result)
{
    static const char *const ends[] = {[FV_REPLAY_CUT_OFF] = "; the recording is cut off here",
                                       [FV_REPLAY_ENDED_EARLY] =
                                           "; the recording ended before its run: ",
                                       [FV_REPLAY_WHOLE] = ""};
    printf("%s%s\n", result->different ? "" : ends[result->end],
           !result->different && result->end == FV_REPLAY_ENDED_EARLY ? result->reason : "");
}

static enum fv_exit report(const char *path, bool verify, enum fovea_status status,
                           const struct fv_replay_result *result, const struct fovea_error *error)
{
    if (status != FOVEA_OK && result->steps == 0)
        return (fv_say("%s", error->text), fv_setup_exit(status));
    if (result->recorded_by[0] != '\0')
        printf("  recorded by %s; replayed with kernels %s\n", result->recorded_by,
               result->kernel_set != NULL ? result->kernel_set : "none");
    printf("  %" PRIu64 " frames, %" PRIu64 " steps, %" PRIu64 " works", result->frames,
           result->steps, result->works);
    print_end(result);
    if (verify)
        printf("  %" PRIu64 " messages (%" PRIu64
               " bytes) equal bit for bit, clock readings in %" PRIu64 " of them left out\n",
               result->messages_equal, result->bytes_equal, result->messages_with_readings);
    fflush(stdout);
    if (status != FOVEA_OK) return (fv_say("%s", error->text), fv_setup_exit(status));
    if (result->different)
        return verify ? fv_say_failed("%s", result->difference)
                      : (fv_say("%s", result->difference), FV_EXIT_OK);
    if (verify && result->messages_equal == 0)
        return fv_say_failed("%s: found no message to compare, so nothing is verified", path);
    if (verify && result->end == FV_REPLAY_CUT_OFF)
        return fv_say_failed(
            "%s: found no end of the recording after %" PRIu64
            " frames, expected one (..._RECORDING_END): what came after them is missing",
            path, result->frames);
    return FV_EXIT_OK;
}

int fv_command_replay(int argc, char **argv)
{
    bool verify = false, trust = false;
    const char *url = "", *rate = "real";
    const struct fv_option options[] = {
        {"verify", NULL, FV_OPTION_FLAG, &verify,
         "compare every message and name the first difference"},
        {"trust-state", NULL, FV_OPTION_FLAG, &trust,
         "replay a recording that began in the middle of its run (record_folder), from the state "
         "in it, which is taken as it is: only for recordings of your own robots"},
        {"lcm-url", "URL", FV_OPTION_TEXT, &url,
         "send the messages to this LCM URL, within this host"},
        {"rate", "max|real", FV_OPTION_TEXT, &rate, "pace of sending (default real)"},
        {0},
    };
    int first;
    struct fovea_error error = {0};
    struct fv_replay_result result;
    struct sending sending = {0};
    enum fv_options_result read = fv_options_parse(options, "FILE", 1, 1, argc, argv, &first);
    if (read != FV_OPTIONS_READ) return read == FV_OPTIONS_HELP ? FV_EXIT_OK : FV_EXIT_WRONG;
    if (strcmp(rate, "max") != 0 && strcmp(rate, "real") != 0)
        return fv_say_wrong("fovea replay: --rate: found \"%s\", expected max or real", rate);
    char log[FV_TRANSPORT_URL_BYTES];
    fv_transport_file(url, log);
    const struct fv_file written[] = {{"fovea replay: --lcm-url", log}, {0}},
                         recording[] = {{"the recording", argv[first]}, {0}};
    if (fv_files_apart(written, recording, &error) != FOVEA_OK)
        return fv_say_wrong("%s", error.text);
    sending.result = &result;
    sending.paced = strcmp(rate, "real") == 0;
    enum fovea_status status = fv_transport_open(url, 0, &sending.transport, &error);
    if (status != FOVEA_OK) return (fv_say("%s", error.text), fv_setup_exit(status));
    struct stat recorded;
    if (stat(argv[first], &recorded) == 0) sending.recording_bytes = (double)recorded.st_size;
    fv_progress_begin(&sending.progress, "replay");
    const unsigned how = (verify ? FV_REPLAY_STOPS : 0) | (trust ? FV_REPLAY_TRUSTS : 0);
    status = fv_replay(argv[first], how, send, &sending, &result, &error);
    fv_progress_end(&sending.progress);
    fv_transport_finish(sending.transport);
    uint64_t offered;
    const uint64_t lost = fv_transport_lost(sending.transport, &offered);
    const bool lasts = fv_transport_sync(sending.transport);
    fv_transport_close(sending.transport);
    const enum fv_exit end = report(argv[first], verify, status, &result, &error);
    if (lost == 0) return end == FV_EXIT_OK && !lasts ? FV_EXIT_FAILED : end;
    return fv_say_failed("%s: %" PRIu64 " of %" PRIu64 " messages could not be written", log, lost,
                         offered);
}

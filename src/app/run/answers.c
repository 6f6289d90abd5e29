#include "app/run/answers.h"

#include <stdio.h>
#include <string.h>

#include "drivers/clock.h"
#include "support/utf8.h"

#include "fovea_command_result_t.h"

enum { COMMANDS_PER_STEP = 32 };

static const char unnamed[] = "found no file for the map, expected one in map.save";

void fv_answers_open(struct fv_answers *answers, struct fv_transport *transport,
                     struct fv_feed *feed, const char *prefix, int64_t run_id)
{
    memset(answers, 0, sizeof *answers);
    answers->transport = transport;
    answers->feed = feed;
    answers->run_id = run_id;
    fv_message_channel(prefix, FV_MESSAGE_COMMAND_RESULT, answers->channel);
}

uint32_t fv_answer_encode(int64_t run_id, const struct fv_judged_command *command, int8_t result,
                          const char *reason, uint8_t data[FV_ANSWER_BYTES_MAX])
{
    char text[FV_ANSWER_REASON_BYTES];
    snprintf(text, sizeof text, "%s", reason);
    fv_utf8_cut(text);
    const fovea_command_result_t message = {.utime = fv_clock_ns(CLOCK_REALTIME) / 1000,
                                            .run_id = run_id,
                                            .id = command->id,
                                            .sender = command->sender,
                                            .commands = command->commands,
                                            .result = result,
                                            .reason = text};
    const int bytes = fovea_command_result_t_encode(data, 0, FV_ANSWER_BYTES_MAX, &message);
    return bytes > 0 ? (uint32_t)bytes : 0;
}

static void answer(const struct fv_answers *answers, const struct fv_judged_command *command,
                   int8_t result, const char *reason)
{
    uint8_t data[FV_ANSWER_BYTES_MAX];
    const uint32_t bytes = fv_answer_encode(answers->run_id, command, result, reason, data);
    if (bytes == 0) return;
    const struct fovea_message out = {answers->channel, data, bytes, true};
    fv_transport_put(answers->transport, &out);
    fv_feed_put(answers->feed, &out);
}

enum awaited { A_SAVE, A_RECORDING };

/* Answer those whose save or recording is among the first `ended`; the others stay, without gaps.
 */
static void answer_ended(struct fv_answers *answers, enum awaited awaited, uint32_t ended,
                         const char *failure)
{
    uint32_t kept = 0;
    for (uint32_t i = 0; i < answers->count; i++) {
        const struct fv_answers_waiting waiting = answers->waiting[i];
        const uint32_t number = awaited == A_SAVE ? waiting.save : waiting.recording;
        if (number == 0 || number > ended)
            answers->waiting[kept++] = waiting;
        else
            answer(answers, &waiting.command,
                   failure[0] == '\0' ? FOVEA_COMMAND_RESULT_T_RESULT_DONE
                                      : FOVEA_COMMAND_RESULT_T_RESULT_FAILED,
                   failure);
    }
    answers->count = kept;
}

static void answer_recorded(struct fv_answers *answers, const struct fv_recordings *recordings)
{
    const char *failure;
    const uint32_t ended = fv_recordings_ended(recordings, &failure);
    answer_ended(answers, A_RECORDING, ended, failure);
}

static void keep(struct fv_answers *answers, const struct fv_judged_command *command,
                 const struct fv_keeper *keeper)
{
    const uint32_t save = command->bits & FOVEA_COMMAND_SAVE ? fv_keeper_next(keeper) : 0;
    answers->waiting[answers->count++] = (struct fv_answers_waiting){*command, save, 0};
}

/* Such a command comes alone, and no step sees it. */
static void record(struct fv_answers *answers, const struct fv_judged_command *command,
                   struct fv_recordings *recordings)
{
    const char *refused = fv_recordings_ask(recordings, command->bits);
    if (refused != NULL)
        answer(answers, command, FOVEA_COMMAND_RESULT_T_RESULT_REFUSED, refused);
    else
        answers->waiting[answers->count++] =
            (struct fv_answers_waiting){*command, 0, recordings->asked};
}

uint32_t fv_answers_take(struct fv_answers *answers, const struct fv_keeper *keeper,
                         struct fv_recordings *recordings)
{
    const uint32_t either = FOVEA_COMMAND_PAUSE | FOVEA_COMMAND_RESUME;
    struct fv_judged_command command;
    const char *failure;
    uint32_t all = 0;
    const uint32_t ended = fv_keeper_ended(keeper, &failure);
    answer_ended(answers, A_SAVE, ended, failure);
    answer_recorded(answers, recordings);
    for (int i = 0; i < COMMANDS_PER_STEP && answers->count < FV_ANSWERS_WAITING_MAX; i++) {
        if (!fv_transport_command(answers->transport, &command)) break;
        if (command.verdict != FV_COMMAND_TAKEN) {
            answer(answers, &command, FOVEA_COMMAND_RESULT_T_RESULT_REFUSED,
                   fv_command_verdict_reason(command.verdict));
            continue;
        }
        if (command.bits & (FOVEA_COMMAND_RECORD | FOVEA_COMMAND_RECORD_STOP)) {
            record(answers, &command, recordings);
            continue;
        }
        if (command.bits & either) all &= ~either;
        all |= command.bits;
        keep(answers, &command, keeper);
    }
    return all;
}

/* Done, but for a save that no file was named for. */
static void answer_step(const struct fv_answers *answers, const struct fv_judged_command *command)
{
    const bool wants_save = (command->bits & FOVEA_COMMAND_SAVE) != 0;
    const bool saves_alone = (command->bits & ~(FOVEA_COMMAND_SAVE | FOVEA_COMMAND_OVERWRITE)) == 0;
    int8_t result = FOVEA_COMMAND_RESULT_T_RESULT_DONE;
    if (wants_save)
        result = saves_alone ? FOVEA_COMMAND_RESULT_T_RESULT_REFUSED
                             : FOVEA_COMMAND_RESULT_T_RESULT_FAILED;
    answer(answers, command, result, wants_save ? unnamed : "");
}

void fv_answers_step(struct fv_answers *answers)
{
    uint32_t kept = 0;
    for (uint32_t i = 0; i < answers->count; i++) {
        const struct fv_answers_waiting waiting = answers->waiting[i];
        if (waiting.save != 0 || waiting.recording != 0)
            answers->waiting[kept++] = waiting;
        else
            answer_step(answers, &waiting.command);
    }
    answers->count = kept;
}

void fv_answers_end(struct fv_answers *answers, const struct fv_keeper *keeper,
                    const struct fv_recordings *recordings, const char *failure)
{
    const char *earlier;
    struct fv_judged_command command;
    const uint32_t ended = fv_keeper_ended(keeper, &earlier);
    fv_answers_step(answers); /* those that wait for nothing else */
    answer_recorded(answers, recordings);
    answer_ended(answers, A_SAVE, ended, earlier);
    answer_ended(answers, A_SAVE, UINT32_MAX, failure != NULL ? failure : "");
    while (fv_transport_command(answers->transport, &command))
        answer(answers, &command, FOVEA_COMMAND_RESULT_T_RESULT_REFUSED,
               command.verdict != FV_COMMAND_TAKEN ? fv_command_verdict_reason(command.verdict)
                                                   : "the run has ended");
}

/* Logs: whatever the bytes are, a replay and a source that plays them end in order, without a read
 * or write out of bounds. The input is either a log as it is (first byte even), or edits to a good
 * recording: a cut, then triples of offset (3 bytes) and value; then the hashes of the header's
 * parts are made to fit, so that what is behind them is reached too. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

#include "app/record/replay.h"
#include "base/hash.h"
#include "common/short_run.h"
#include "drivers/table.h"
#include "fovea/source.h"
#include "support/text.h"
#include "message/fields.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes);
int LLVMFuzzerInitialize(int *argc, char ***argv);

static uint8_t *good;
static size_t good_bytes;
static int file;
static char path[64];

int LLVMFuzzerInitialize(int *argc, char ***argv)
{
    const struct short_run run = {
        .width = 64, .height = 64, .iterations = 12, .features = 150, .detect = true};
    (void)argc;
    (void)argv;
    file = memfd_create("log", 0);
    snprintf(path, sizeof path, "/proc/self/fd/%d", file);
    short_run_record(path, &run);
    struct fovea_error error;
    char *text;
    if (fv_text_read(path, 1 << 28, &text, &good_bytes, &error) != FOVEA_OK) abort();
    good = (uint8_t *)text;
    return 0;
}

static uint32_t read_big(const uint8_t *data)
{
    return (uint32_t)data[0] << 24 | (uint32_t)data[1] << 16 | (uint32_t)data[2] << 8 | data[3];
}

/* Make the hashes of the first event's parts fit their bytes, as far as it is a header. */
static void mend_hashes(uint8_t *log, size_t bytes)
{
    if (bytes < 28) return;
    size_t at = 28 + (size_t)read_big(log + 20), end = at + read_big(log + 24);
    const struct fovea_type *type =
        at < end && end <= bytes ? fv_message_type_of(log + at, end - at) : NULL;
    if (type == NULL || strcmp(type->name, "fovea.recording_t") != 0) return;
    struct fovea_fields walk;
    struct fovea_field leaf;
    uint8_t *hash = NULL;
    (void)fovea_fields_begin(&walk, log + at, end - at);
    while (fovea_fields_next(&walk, &leaf) == FOVEA_OK) {
        const char *dot = strrchr(leaf.path, '.');
        if (dot != NULL && strcmp(dot, ".hash") == 0) hash = log + at + leaf.offset;
        if (dot != NULL && strcmp(dot, ".data") == 0 && hash != NULL) {
            uint64_t fit = fv_hash(FV_HASH_START, leaf.data, leaf.bytes);
            for (int i = 0; i < 8; i++)
                hash[i] = (uint8_t)(fit >> (56 - 8 * i));
        }
    }
}

/* The log that an input stands for. */
static size_t make_log(const uint8_t *data, size_t bytes, uint8_t **log)
{
    if (data[0] % 2 == 0) {
        *log = malloc(bytes);
        memcpy(*log, data + 1, bytes - 1);
        return bytes - 1;
    }
    *log = malloc(good_bytes);
    memcpy(*log, good, good_bytes);
    size_t cut = bytes >= 4 && data[1] >= 128 ? ((size_t)data[2] << 8 | data[3]) * 2 : good_bytes;
    for (size_t at = 4; at + 4 <= bytes; at += 4) {
        size_t offset =
            ((size_t)data[at] << 16 | (size_t)data[at + 1] << 8 | data[at + 2]) % good_bytes;
        (*log)[offset] = data[at + 3];
    }
    cut = cut < good_bytes ? cut : good_bytes;
    mend_hashes(*log, cut);
    return cut;
}

static void play(void)
{
    const struct fovea_source_ops *ops;
    const struct fovea_source_selection all = {.step = 1};
    struct fovea_source *source;
    struct fovea_error error;
    struct fovea_frame frame;
    const char *address;
    char uri[80];
    snprintf(uri, sizeof uri, "lcmlog:%s", path);
    if (fv_source_find(uri, &ops, &address, &error) != FOVEA_OK) abort();
    if (ops->open(address, &all, &source, &error) != FOVEA_OK) return;
    if (ops->start(source, &error) == FOVEA_OK) {
        volatile uint32_t sum = 0;
        while (ops->dequeue(source, INT64_MAX, &frame) == FOVEA_OK) {
            for (size_t i = 0; i < frame.images[0].size_bytes; i += 61)
                sum = sum + frame.images[0].data[i];
            ops->requeue(source, &frame);
        }
        ops->stop(source);
    }
    ops->close(source);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes)
{
    struct fv_replay_result result;
    struct fovea_error error = {0};
    uint8_t *log;
    if (bytes == 0) return 0;
    size_t log_bytes = make_log(data, bytes, &log);
    if (ftruncate(file, 0) != 0 || pwrite(file, log, log_bytes, 0) != (ssize_t)log_bytes) abort();
    free(log);
    enum fovea_status status = fv_replay(path, FV_REPLAY_STOPS, NULL, NULL, &result, &error);
    if (status != FOVEA_OK &&
        (strchr(error.text, '\n') != NULL || strncmp(error.text, path, strlen(path)) != 0))
        abort();
    play();
    return 0;
}

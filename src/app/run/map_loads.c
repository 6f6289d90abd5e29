#include "app/run/map_loads.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "app/run/answers.h"
#include "drivers/clock.h"
#include "map/archive.h"
#include "support/aligned.h"
#include "support/folder.h"
#include "support/say.h"
#include "support/stall.h"
#include "support/utf8.h"

#include "fovea_command_result_t.h"
#include "fovea_map_files_t.h"
#include "fovea_map_load_t.h"

enum {
    REQUEST_BYTES_MAX = 256 + FV_MESSAGE_MAP_NAME_BYTES,
    ENTRIES_MAX = 4096 /* of the folder that are looked at for a list */
};

enum fovea_status fv_map_loads_open(struct fv_map_loads *loads, struct fv_requests *requests,
                                    const struct fovea *rt, const struct fv_settings *settings,
                                    struct fovea_error *error)
{
    const char *prefix = settings->runtime.channel_prefix;
    struct stat there;
    memset(loads, 0, sizeof *loads);
    loads->rt = rt;
    loads->folder = settings->map_folder;
    fv_message_channel(prefix, FV_MESSAGE_MAP_LOAD, loads->request_channel);
    fv_message_channel(prefix, FV_MESSAGE_COMMAND_RESULT, loads->result_channel);
    fv_message_channel(prefix, FV_MESSAGE_MAP_FILES, loads->files_channel);
    const bool folder = loads->folder[0] != '\0';
    const char *wrong = !folder                            ? NULL
                        : stat(loads->folder, &there) != 0 ? strerrordesc_np(errno)
                        : !S_ISDIR(there.st_mode)          ? "a file"
                                                           : NULL;
    if (wrong != NULL)
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "map.folder: %.400s: found %s, expected a folder", loads->folder,
                               wrong);
    if (folder) {
        loads->capacity = fovea_map_bytes_max(&settings->runtime);
        loads->data = fv_aligned_zeroed(loads->capacity);
        loads->memory_bytes = fovea_map_prepared_bytes(&settings->runtime);
        loads->memory = fv_aligned_zeroed(loads->memory_bytes);
    }
    if (folder && (loads->data == NULL || loads->memory == NULL)) {
        fv_map_loads_close(loads);
        return fovea_error_set(error, FOVEA_ERROR_MEMORY, "map.folder: no memory to load maps");
    }
    loads->requests = requests;
    return FOVEA_OK;
}

void fv_map_loads_close(struct fv_map_loads *loads)
{
    free(loads->data);
    free(loads->memory);
    memset(loads, 0, sizeof *loads);
}

static void refuse(struct fv_map_loads *loads, const char *reason)
{
    loads->lists = false;
    loads->answer_bytes =
        fv_answer_encode(loads->requests->run_id, &loads->command,
                         FOVEA_COMMAND_RESULT_T_RESULT_REFUSED, reason, loads->message);
}

/* ---- on the listener's thread ---------------------------------------------------------------- */

static void take(struct fv_map_loads *loads, const fovea_map_load_t *request,
                 const struct fv_received *received)
{
    struct fv_requests *requests = loads->requests;
    const struct fv_judged_command command = {
        .commands = FOVEA_MAP_LOAD_T_LOAD, .id = request->id, .sender = request->sender};
    uint8_t data[FV_ANSWER_BYTES_MAX];
    const char *reason;
    switch (fv_requests_judge(requests, request, received, fv_command_gate_loads(&requests->gate),
                              atomic_load(&loads->stage) == FV_MAP_LOADS_IDLE, &reason)) {
    case FV_REQUEST_TAKEN:
        loads->command = command;
        /* One that is too long is refused by its length. */
        snprintf(loads->file, sizeof loads->file, "%.127s", request->file);
        if (strlen(request->file) >= sizeof loads->file) strcpy(loads->file, "/");
        atomic_store(&loads->stage, FV_MAP_LOADS_ASKED);
        break;
    case FV_REQUEST_REFUSED:
        fv_requests_answer(requests, loads->result_channel, data,
                           (int)fv_answer_encode(requests->run_id, &command,
                                                 FOVEA_COMMAND_RESULT_T_RESULT_REFUSED, reason,
                                                 data));
        break;
    case FV_REQUEST_IGNORED:
        break;
    }
}

static void take_request(void *context, const struct fv_received *received)
{
    struct fv_map_loads *loads = context;
    fovea_map_load_t request;
    if (received->bytes > REQUEST_BYTES_MAX ||
        fovea_map_load_t_decode(received->data, 0, (int)received->bytes, &request) < 0)
        return;
    take(loads, &request, received);
    fovea_map_load_t_decode_cleanup(&request);
}

struct fv_receiver_channel fv_map_loads_row(struct fv_map_loads *loads)
{
    return fv_receiver_channel_of(loads->request_channel, "fovea.map_load_t", REQUEST_BYTES_MAX,
                                  take_request, loads);
}

/* ---- on the thread that watches the loop ----------------------------------------------------- */

/* A name within the folder that can be shown. */
static bool is_name(const char *file)
{
    bool plain = file[0] != '\0' && file[0] != '.' && strlen(file) < FV_MESSAGE_MAP_NAME_BYTES &&
                 fv_utf8_check(file);
    for (; *file != '\0'; file++)
        plain = plain && *file != '/' && (unsigned char)*file >= ' ' && *file != 0x7f;
    return plain;
}

static bool read_whole(int file, uint8_t *data, size_t bytes)
{
    size_t at = 0;
    while (at < bytes) {
        const ssize_t got = read(file, data + at, bytes - at);
        if (got < 0 && errno == EINTR) continue;
        if (got <= 0) break;
        at += (size_t)got;
        fv_stall_move(-1);
    }
    return at == bytes;
}

/* The file's bytes. False: it was refused. */
static bool fetch(struct fv_map_loads *loads, int folder)
{
    char reason[FV_ANSWER_REASON_BYTES];
    struct stat there;
    const int file = fv_folder_open_file(folder, loads->file, &there);
    if (file < 0) {
        const char *why = errno == EINVAL  ? "found no ordinary file"
                          : errno == ELOOP ? "found a link"
                                           : strerrordesc_np(errno);
        snprintf(reason, sizeof reason, "%s: %s, expected a map in map.folder", loads->file, why);
        refuse(loads, reason);
        return false;
    }
    loads->bytes = (size_t)there.st_size;
    bool whole = there.st_size > 0 && loads->bytes <= loads->capacity;
    if (!whole) {
        snprintf(reason, sizeof reason,
                 "%s: found %lld bytes, expected 1 to %zu: what this run has room for", loads->file,
                 (long long)there.st_size, loads->capacity);
    } else if (!read_whole(file, loads->data, loads->bytes)) {
        whole = false;
        snprintf(reason, sizeof reason, "%s: found it cut while it was read", loads->file);
    }
    close(file);
    if (!whole) refuse(loads, reason);
    return whole;
}

/* True: a map is ready. */
static bool prepare(struct fv_map_loads *loads, int folder)
{
    struct fovea_error error = {0};
    if (!is_name(loads->file)) {
        refuse(loads, "found no name of a file, expected one in map.folder, without a path, of at "
                      "most 127 bytes");
        return false;
    }
    if (!fetch(loads, folder)) return false;
    if (fovea_map_prepare(loads->rt, loads->memory, loads->memory_bytes, loads->data, loads->bytes,
                          loads->file, &loads->ready, &error) == FOVEA_OK)
        return true;
    refuse(loads, error.text);
    return false;
}

/* Into its place among those found so far, which are ordered by their time, newest first. */
static void insert(fovea_map_file_t *files, int32_t *count, fovea_map_file_t found)
{
    int32_t at = *count < FV_MAP_LOADS_FILES_MAX ? (*count)++ : FV_MAP_LOADS_FILES_MAX - 1;
    char *name = files[at].name;
    if (at == FV_MAP_LOADS_FILES_MAX - 1 && name[0] != '\0' && files[at].utime >= found.utime)
        return;
    for (; at > 0 && files[at - 1].utime < found.utime; at--)
        files[at] = files[at - 1];
    memcpy(name, found.name, strlen(found.name) + 1); /* is_name: it fits */
    found.name = name;
    files[at] = found;
}

static void list(struct fv_map_loads *loads, DIR *folder)
{
    static char names[FV_MAP_LOADS_FILES_MAX][FV_MESSAGE_MAP_NAME_BYTES]; /* one thread's */
    fovea_map_file_t files[FV_MAP_LOADS_FILES_MAX];
    fovea_map_files_t message = {.utime = fv_clock_ns(CLOCK_REALTIME) / 1000,
                                 .run_id = loads->requests->run_id,
                                 .id = loads->command.id,
                                 .sender = loads->command.sender,
                                 .files = files};
    memset(names, 0, sizeof names);
    memset(files, 0, sizeof files);
    for (int i = 0; i < FV_MAP_LOADS_FILES_MAX; i++)
        files[i].name = names[i];
    for (int i = 0; i < ENTRIES_MAX; i++) {
        uint8_t head[FV_ARCHIVE_HEADER_BYTES];
        struct stat there;
        struct fv_archive_outline map;
        struct dirent *entry = readdir(folder);
        if (entry == NULL) break;
        const int file =
            is_name(entry->d_name) ? fv_folder_open_file(dirfd(folder), entry->d_name, &there) : -1;
        if (file < 0) continue;
        if (read_whole(file, head, sizeof head) &&
            fv_archive_outline(head, (uint64_t)there.st_size, &map))
            insert(files, &message.count,
                   (fovea_map_file_t){.name = entry->d_name,
                                      .bytes = there.st_size,
                                      .utime = there.st_mtim.tv_sec * INT64_C(1000000) +
                                               there.st_mtim.tv_nsec / 1000,
                                      .landmarks = (int32_t)map.landmarks});
        close(file);
    }
    const int bytes =
        fovea_map_files_t_encode(loads->message, 0, FV_MAP_LOADS_MESSAGE_BYTES, &message);
    loads->lists = true;
    loads->answer_bytes = bytes > 0 ? (uint32_t)bytes : 0;
}

static bool work(struct fv_map_loads *loads)
{
    char reason[FV_ANSWER_REASON_BYTES];
    bool ready = false;
    if (loads->memory == NULL) {
        refuse(loads, "found no folder of maps, expected one in map.folder");
        return false;
    }
    const int call = fv_stall_enter(loads->folder);
    DIR *folder = opendir(loads->folder);
    if (folder == NULL) {
        snprintf(reason, sizeof reason, "map.folder: %s", strerrordesc_np(errno));
        refuse(loads, reason);
    } else if (loads->file[0] == '\0') {
        list(loads, folder);
    } else {
        ready = prepare(loads, dirfd(folder));
    }
    if (folder != NULL) closedir(folder);
    fv_stall_leave(call);
    return ready;
}

void fv_map_loads_tend(struct fv_map_loads *loads)
{
    if (loads->requests == NULL || atomic_load(&loads->stage) != FV_MAP_LOADS_ASKED) return;
    const bool ready = work(loads);
    if (ready) fv_say_note("fovea run: loads the map %s", loads->file);
    atomic_store(&loads->stage, ready ? FV_MAP_LOADS_READY : FV_MAP_LOADS_ANSWERED);
}

/* ---- on the loop's --------------------------------------------------------------------------- */

static void send(const char *channel, const uint8_t *data, uint32_t bytes,
                 struct fv_transport *transport, struct fv_feed *feed)
{
    const struct fovea_message out = {channel, data, bytes, true};
    if (bytes == 0) return;
    fv_transport_put(transport, &out);
    fv_feed_put(feed, &out);
}

void fv_map_loads_take(struct fv_map_loads *loads, struct fovea_inputs *inputs, bool busy)
{
    loads->given =
        !busy && atomic_load_explicit(&loads->stage, memory_order_acquire) == FV_MAP_LOADS_READY;
    if (loads->given) inputs->map = loads->ready;
}

void fv_map_loads_step(struct fv_map_loads *loads, struct fv_recorder *const recorders[2],
                       const struct fovea_inputs *inputs, struct fv_transport *transport,
                       struct fv_feed *feed)
{
    if (loads->requests == NULL) return;
    const int stage = atomic_load_explicit(&loads->stage, memory_order_acquire);
    if (loads->given) {
        for (int i = 0; i < 2; i++)
            fv_recorder_map(recorders[i], inputs, loads->file, loads->data, loads->bytes);
        loads->lists = false;
        loads->answer_bytes =
            fv_answer_encode(loads->requests->run_id, &loads->command,
                             FOVEA_COMMAND_RESULT_T_RESULT_DONE, "", loads->message);
    } else if (stage != FV_MAP_LOADS_ANSWERED) {
        return;
    }
    send(loads->lists ? loads->files_channel : loads->result_channel, loads->message,
         loads->answer_bytes, transport, feed);
    loads->given = false;
    atomic_store_explicit(&loads->stage, FV_MAP_LOADS_IDLE, memory_order_release);
}

void fv_map_loads_end(struct fv_map_loads *loads, struct fv_transport *transport,
                      struct fv_feed *feed)
{
    struct fv_recorder *const none[2] = {NULL, NULL};
    const struct fovea_inputs inputs = {.now_ns = 0};
    if (loads->requests == NULL) return;
    const int stage = atomic_load(&loads->stage);
    loads->given = false;
    if (stage == FV_MAP_LOADS_ASKED || stage == FV_MAP_LOADS_READY) {
        refuse(loads, "the run has ended");
        atomic_store(&loads->stage, FV_MAP_LOADS_ANSWERED);
    }
    fv_map_loads_step(loads, none, &inputs, transport, feed);
}

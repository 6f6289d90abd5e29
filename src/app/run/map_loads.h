/* Maps that are loaded while the loop runs (map_load_t), and the list of those that there are
 * (map_files_t). Files are named within one folder (map.folder): no path comes from outside.
 *
 * The listener's thread judges a request and hands it to the thread that watches the loop, which
 * reads and checks the file in memory that was taken at the start. The loop's thread gives the map
 * to the next step, not while a map is being saved, records its bytes, and answers with
 * command_result_t. One request at a time: others that come meanwhile are refused (requests.h). */
#ifndef FOVEA_APP_RUN_MAP_LOADS_H
#define FOVEA_APP_RUN_MAP_LOADS_H

#include <stdatomic.h>

#include "app/network/feed.h"
#include "app/network/receiver.h"
#include "app/network/transport.h"
#include "app/record/recorder.h"
#include "app/config/settings.h"
#include "app/run/requests.h"
#include "message/recorded.h"

enum {
    FV_MAP_LOADS_FILES_MAX = 64, /* in a list */
    FV_MAP_LOADS_MESSAGE_BYTES = 64 + FV_MAP_LOADS_FILES_MAX * (FV_MESSAGE_MAP_NAME_BYTES + 32)
};

enum fv_map_loads_stage {
    FV_MAP_LOADS_IDLE,
    FV_MAP_LOADS_ASKED,   /* the watching thread's */
    FV_MAP_LOADS_READY,   /* the loop's: for the next step */
    FV_MAP_LOADS_ANSWERED /* the loop's: `message` */
};

struct fv_map_loads {
    struct fv_requests *requests; /* whose gate judges; NULL: nothing is heard */
    const struct fovea *rt;
    const char *folder; /* "": none */
    char request_channel[FV_MESSAGE_CHANNEL_BYTES], result_channel[FV_MESSAGE_CHANNEL_BYTES],
        files_channel[FV_MESSAGE_CHANNEL_BYTES];
    void *memory; /* of the map that is read and checked; NULL: no folder */
    size_t memory_bytes;
    uint8_t *data; /* the file's */
    size_t capacity;
    _Atomic int stage; /* enum fv_map_loads_stage: whose turn it is */

    /* Handed over with the stage. */
    struct fv_judged_command command;
    char file[FV_MESSAGE_MAP_NAME_BYTES]; /* "": the list is asked for */
    size_t bytes;
    const struct fovea_ready_map *ready;
    bool lists;                                  /* the answer is map_files_t */
    uint8_t message[FV_MAP_LOADS_MESSAGE_BYTES]; /* the encoded answer */
    uint32_t answer_bytes;

    bool given; /* the loop's: to the step under way */
};

/* For a run with these settings, whose requests are open; takes the memory where they name a
 * folder. FOVEA_ERROR_INPUT: there is no such folder; FOVEA_ERROR_MEMORY. All stays the caller's.
 * Init-only. */
enum fovea_status fv_map_loads_open(struct fv_map_loads *loads, struct fv_requests *requests,
                                    const struct fovea *rt, const struct fv_settings *settings,
                                    struct fovea_error *error);
void fv_map_loads_close(struct fv_map_loads *loads);

/* The row of the receiver's table for requests. */
struct fv_receiver_channel fv_map_loads_row(struct fv_map_loads *loads);

/* Read and check what was asked for, which may wait for the disk. On the thread that watches the
 * loop. */
void fv_map_loads_tend(struct fv_map_loads *loads);

/* Put a map that is ready into the inputs of the next step, unless a save is under way (`busy`).
 * Loop thread, wait-free. */
void fv_map_loads_take(struct fv_map_loads *loads, struct fovea_inputs *inputs, bool busy);
/* The step has taken it: record it by both recorders, each of which may be NULL, before the step is
 * recorded, and answer. Loop thread, wait-free; as long as copying takes. */
void fv_map_loads_step(struct fv_map_loads *loads, struct fv_recorder *const recorders[2],
                       const struct fovea_inputs *inputs, struct fv_transport *transport,
                       struct fv_feed *feed);

/* The loop has ended: answer who still waits. */
void fv_map_loads_end(struct fv_map_loads *loads, struct fv_transport *transport,
                      struct fv_feed *feed);

#endif

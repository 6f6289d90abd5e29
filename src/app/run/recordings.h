/* Recordings that commands begin and end while the loop runs (FOVEA_COMMAND_RECORD and
 * FOVEA_COMMAND_RECORD_STOP), as numbered files of one folder (record_folder): no name comes from
 * outside. Independent of the recording of the whole run (`record`).
 *
 * The memory for the state and the ring is taken at the start, and every page of it touched. A
 * recording goes from hand to hand: the loop's thread takes the command, the thread that watches
 * the loop makes the file and the recorder (fv_recordings_tend), the loop's thread copies the state
 * before a step (fv_recordings_sense) and records from that step on; at its end the watching thread
 * closes the file. A begin is through when the header with the state is in the file. Where the disk
 * is about to fill, the watching thread asks for the end. So the loop makes no heap call and waits
 * for no disk. Begins and ends are numbered together from 1, so that whoever asked for one can see
 * how it ended. */
#ifndef FOVEA_APP_RUN_RECORDINGS_H
#define FOVEA_APP_RUN_RECORDINGS_H

#include <stdatomic.h>

#include "app/network/feed.h"
#include "app/network/transport.h"
#include "app/record/recorder.h"
#include "fovea/fovea.h"
#include "message/message.h"

enum { FV_RECORDINGS_REASON_BYTES = 256, FV_RECORDINGS_NAME_BYTES = 128 };

/* Whose turn it is: the loop's in the first and where it records, the watching thread's where it
 * opens and closes. */
enum fv_recordings_stage {
    FV_RECORDINGS_READY,
    FV_RECORDINGS_OPENS,
    FV_RECORDINGS_BEGINS, /* with the next step: the loop's */
    FV_RECORDINGS_RECORDS,
    FV_RECORDINGS_CLOSES
};

struct fv_recordings {
    struct fv_recorder_setup setup; /* path NULL: there is no folder */
    char folder[FV_SETTINGS_PATH_BYTES + 2];
    struct fovea *rt;
    _Atomic int stage; /* enum fv_recordings_stage */
    int64_t run_id;
    char channel[FV_MESSAGE_CHANNEL_BYTES];

    /* The loop's. */
    uint32_t asked; /* begins and ends */
    /* Handed over with the stage. */
    struct fv_recorder *recorder;
    bool by_command;                               /* the end */
    char failure[FV_RECORDINGS_REASON_BYTES];      /* of the last begin or end; "": none */
    char refusal[FV_RECORDINGS_REASON_BYTES + 64]; /* the loop's: of the last command */

    /* The watching thread's. */
    char file[FV_RECORDINGS_NAME_BYTES]; /* name of the last recording; "": none */
    char reason[FV_RECORDINGS_REASON_BYTES];
    int64_t bytes, told_ns;
    int told_stage;
    char low[FV_RECORDINGS_REASON_BYTES]; /* why `full`; "": it is not */
    atomic_bool full;                     /* the loop is to end the recording */

    /* What goes out next. While `news` is set the loop reads it; else the watching thread writes.
     */
    struct fv_recordings_state {
        int8_t state;
        int64_t bytes, free_bytes;
        char file[FV_RECORDINGS_NAME_BYTES], reason[FV_RECORDINGS_REASON_BYTES];
    } told;
    atomic_bool news;
};

/* Take the memory, and make the folder, where setup->settings name one; setup->path is not looked
 * at, and what it points to stays the caller's. FOVEA_ERROR_INPUT: no folder can be there;
 * FOVEA_ERROR_MEMORY. Init-only. */
enum fovea_status fv_recordings_open(struct fv_recordings *recordings, struct fovea *rt,
                                     const struct fv_recorder_setup *setup, int64_t run_id,
                                     struct fovea_error *error);
void fv_recordings_close(struct fv_recordings *recordings);

/* ---- the loop's, wait-free ------------------------------------------------------------------- */

/* Take one of the two commands. NULL: its number is recordings->asked; else why it is refused. */
const char *fv_recordings_ask(struct fv_recordings *recordings, uint32_t bits);
/* The number of begins and ends that are through. `*failure`: why the last failed, "" if it did
 * not; valid until the next fv_recordings_ask. */
uint32_t fv_recordings_ended(const struct fv_recordings *recordings, const char **failure);
/* Before a step with these inputs, whose times are filled in. Not while `busy`. */
void fv_recordings_sense(struct fv_recordings *recordings, const struct fovea_inputs *inputs,
                         bool busy);
/* What records the step and work under way; NULL: nothing. */
struct fv_recorder *fv_recordings_recorder(const struct fv_recordings *recordings);
/* After a work: say what is new, as recorder_t. */
void fv_recordings_work(struct fv_recordings *recordings, struct fv_transport *transport,
                        struct fv_feed *feed);

/* ---- the watching thread's ------------------------------------------------------------------- */

/* Open, close, look. */
void fv_recordings_tend(struct fv_recordings *recordings);
/* When the loop has ended: close what is open, with the end of the run. */
void fv_recordings_end(struct fv_recordings *recordings);

#endif

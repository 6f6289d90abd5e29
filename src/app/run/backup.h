/* The settings of a run as one file: given out, and taken back (settings_t, settings_result_t).
 *
 * What is taken back is checked whole first, as the next start would check it, and refused whole;
 * then it is written in place of the file that parameters.file names, and live parameters change at
 * once where all of them can. Keys of the host (fv_settings_key.host) are given out as comments,
 * and refused. A calibration goes with it where `camera` names a file: it stands in the kept file,
 * and the user's files are never written.
 *
 * The listener's thread judges a request and hands it to the thread that watches the loop, which
 * does the work and may wait for the disk; the loop's thread sends the answer. One request at a
 * time: others that come meanwhile are refused (requests.h). */
#ifndef FOVEA_APP_RUN_BACKUP_H
#define FOVEA_APP_RUN_BACKUP_H

#include <stdatomic.h>

#include "app/config/kept_parameters.h"
#include "app/network/feed.h"
#include "app/network/receiver.h"
#include "app/network/transport.h"
#include "app/run/parameters.h"

enum { FV_BACKUP_MESSAGE_BYTES = FV_KEPT_BYTES_MAX + 512 };

enum fv_backup_stage { FV_BACKUP_IDLE, FV_BACKUP_ASKED, FV_BACKUP_ANSWERED };

struct fv_backup {
    struct fv_parameters *parameters; /* NULL: nothing is heard */
    const struct fv_settings *started;
    const struct fovea_source_info *source; /* of the source that is open */
    char request_channel[FV_MESSAGE_CHANNEL_BYTES], channel[FV_MESSAGE_CHANNEL_BYTES];
    _Atomic int stage; /* enum fv_backup_stage: whose turn it is */

    /* Handed over with the stage. */
    int64_t id, sender;
    bool ended;       /* the run has: it is refused */
    char reason[256]; /* why */
    char *text;       /* FV_KEPT_BYTES_MAX + 1 */
    uint8_t *message; /* the encoded answer */
    uint32_t answer_bytes;
};

/* For the parameters of a run, whose settings at the start are `started`, and its source; all stay
 * the caller's.
 * Init-only. FOVEA_ERROR_MEMORY. */
enum fovea_status fv_backup_open(struct fv_backup *backup, struct fv_parameters *parameters,
                                 const struct fv_settings *started,
                                 const struct fovea_source_info *source, struct fovea_error *error);
void fv_backup_close(struct fv_backup *backup);

/* The row of the receiver's table for requests. */
struct fv_receiver_channel fv_backup_row(struct fv_backup *backup);

/* Do what was asked. On the thread that watches the loop. */
void fv_backup_tend(struct fv_backup *backup);

/* When the loop has ended: answer who still waits. A request that nothing was done for is refused.
 */
void fv_backup_end(struct fv_backup *backup, struct fv_transport *transport, struct fv_feed *feed);

/* Send the answer that is there. Loop thread, wait-free. */
void fv_backup_step(struct fv_backup *backup, struct fv_transport *transport, struct fv_feed *feed);

#endif

/* Where a recording goes: a file of the user's name, or the next numbered file of a folder.
 *
 * FILE: as every output (support/output.h): it replaces what an earlier run left, and a second run
 * on it is refused while the first one writes.
 *
 * DIR/: a black box. Each run writes a new file, and no run writes over that of another:
 *
 *     DIR/000012-20261122T210501Z.open.lcm    being written, left by a crash or power cut, or
 *                                             ended early by a full or slow disk
 *     DIR/000012-20261122T210501Z.lcm         ended in order
 *
 * The number is one above the highest in the folder, so that the order is right also where the
 * clock is not; then the time of the start in UTC. `keep` N > 0 bounds the disk: the newest N that
 * ended in order stay, and the newest N that did not. A restart thus never pushes out a crash's
 * recording; only N later ones that did not end in order do. No such one pushes out one that did:
 * restarts on a full disk remove no whole recording. One with no iteration of the run in it is
 * removed itself, however it ended. A recording that has just ended is not the one that goes, also
 * when it began first. Files that are being written, and files with other names, are never removed.
 * 0: all stay. Several runs may record to one folder. */
#ifndef FOVEA_APP_RECORD_RECORDING_FILE_H
#define FOVEA_APP_RECORD_RECORDING_FILE_H

#include <stdbool.h>
#include <stdint.h>

#include "fovea/status.h"
#include "support/output.h"

struct fv_recording_file {
    struct fv_output output; /* its path is the recording's, as long as it is open */
    bool numbered;
    uint32_t keep;
};

/* Whether `path` means a folder of numbered recordings: it ends in '/'. */
bool fv_recording_file_numbered(const char *path);

/* Open `path`; DIR/ is made when it is not there, its parent is not. FOVEA_ERROR_INPUT: it cannot
 * be written, or another run writes it. */
enum fovea_status fv_recording_file_open(struct fv_recording_file *file, const char *path,
                                         uint32_t keep, struct fovea_error *error);

/* How much of the run is in a recording, and what a numbered one becomes. */
enum fv_recording_holds {
    FV_RECORDING_ALL,  /* it gets its final name, and what is beyond `keep` is removed */
    FV_RECORDING_PART, /* it keeps the name with ".open" */
    FV_RECORDING_NONE  /* it is removed */
};
/* Sync and close it. FOVEA_ERROR_SYSTEM: it is not whole on the disk, or was deleted meanwhile. */
enum fovea_status fv_recording_file_close(struct fv_recording_file *file,
                                          enum fv_recording_holds holds, struct fovea_error *error);

/* The parts of a numbered name. */
struct fv_recording_name {
    uint64_t number;
    bool open; /* .open.lcm */
};
/* False: `name` is not one that a run gives. */
bool fv_recording_name_read(const char *name, struct fv_recording_name *read);

#endif

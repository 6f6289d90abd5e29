/* Files that a program writes: recordings, maps, trajectories, pictures, tables. All are opened
 * here, so that one set of rules holds for all.
 *
 * - Nothing is cut, and nothing but fv_output_append writes in place. A new file is created
 * exclusively as PATH.part (O_EXCL, O_NOFOLLOW) and put at PATH by a rename. What was at PATH keeps
 * its bytes until then, also for a program that has it open. A link at PATH or PATH.part is
 * replaced, never followed.
 * - One program writes a path at a time. PATH.part is locked (flock) from its creation on, and the
 *   lock stays with the file after the rename. A second program is refused while the first runs. A
 *   PATH.part without a lock was left by a program that died; it is removed.
 * - A new file has the mode of the file that it replaces, else 0644 less the umask.
 * - /dev/null, /dev/full, and the streams that are open (/dev/stdout, /dev/stderr, /dev/fd/N) are
 *   written as they are. Other devices, pipes and sockets are refused: opening them may hang.
 *
 * Init-only and at the end; not for the loop thread. */
#ifndef FOVEA_SUPPORT_OUTPUT_H
#define FOVEA_SUPPORT_OUTPUT_H

#include <stdbool.h>
#include <stdio.h>

#include "fovea/status.h"

enum { FV_OUTPUT_PATH_BYTES = 4096, FV_OUTPUT_PART_BYTES = FV_OUTPUT_PATH_BYTES + 8 };

enum fv_output_kind {
    FV_OUTPUT_WHOLE, /* at PATH when it is closed: whole, synced, or not at all */
    FV_OUTPUT_STREAM /* at PATH from the start, and grows there */
};

struct fv_output {
    int file;     /* -1: closed */
    FILE *stream; /* NULL until fv_output_stream */
    bool named;   /* a file of its own; false: a device or an open stream */
    bool placed;  /* it is at `path`, no longer at `part` */
    char path[FV_OUTPUT_PATH_BYTES], part[FV_OUTPUT_PART_BYTES];
};

#define FV_OUTPUT_CLOSED ((struct fv_output){.file = -1})

/* FOVEA_ERROR_INPUT: it cannot be written, or another program writes it (errno is EBUSY then);
 * `error` says which. */
enum fovea_status fv_output_open(struct fv_output *output, const char *path,
                                 enum fv_output_kind kind, struct fovea_error *error);
/* The same for a file that is gone on with: at its end, or made where nothing is. It is written in
 * place, so a link is refused. */
enum fovea_status fv_output_append(struct fv_output *output, const char *path,
                                   struct fovea_error *error);
/* Put a FV_OUTPUT_WHOLE in its place before it is closed; it grows there from now on. 0 or errno.
 */
int fv_output_place(struct fv_output *output);
/* A stdio stream on it, owned by the output. NULL: no memory. */
FILE *fv_output_stream(struct fv_output *output);

/* Write what is buffered, sync, put it in its place, close. FOVEA_ERROR_SYSTEM: it is not whole;
 * what was at PATH stays (but for a stream, which has replaced it), and errno says why. A closed
 * one: FOVEA_OK. */
enum fovea_status fv_output_close(struct fv_output *output, struct fovea_error *error);
/* Close it and remove what is not in its place yet. */
void fv_output_discard(struct fv_output *output);

/* Whether its name still leads to it: false when it was deleted, moved or replaced. */
bool fv_output_there(const struct fv_output *output);

/* Create PATH exclusively and lock it, for a name that nothing has yet. EEXIST and other reasons
 * are returned; 0: it is open. */
int fv_output_create(struct fv_output *output, const char *path);
/* Give an output that is in its place another name in the same folder; the lock stays. 0 or errno:
 * EEXIST when the name is taken. */
int fv_output_rename(struct fv_output *output, const char *path);

#endif

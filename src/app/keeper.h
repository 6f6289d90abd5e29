/* Saving the map while the loop runs, and at its end.
 *
 * A save that is asked for goes from hand to hand: the loop's thread notes it (fv_keeper_commands);
 * the watching thread makes a buffer (fv_keeper_tend); the loop passes the command on to the step
 * with the buffer, and the map's job fills it in units; when a work tells that all is there
 * (fv_keeper_work), the watching thread writes the file and gives the buffer back. So the loop
 * makes no heap call and waits for no disk, and memory is taken only meanwhile. A save asked for
 * while one is going on follows it. */
#ifndef FOVEA_APP_KEEPER_H
#define FOVEA_APP_KEEPER_H

#include <stdatomic.h>

#include "fovea/fovea.h"

enum fv_keeper_stage { FV_KEEPER_IDLE, FV_KEEPER_READY, FV_KEEPER_FILLING, FV_KEEPER_FULL };

struct fv_keeper {
    const char *path; /* "": no map is saved; said once when one is asked for */
    struct fovea *rt;
    const struct fovea_config *config;
    atomic_bool asked;
    _Atomic int stage; /* enum fv_keeper_stage: whose turn it is */
    uint8_t *buffer;
    size_t capacity, bytes;
};

/* Commands for the step: those that came, but a save only when its buffer is there. Loop thread,
 * wait-free.
 */
uint32_t fv_keeper_commands(struct fv_keeper *keeper, uint32_t commands);
/* What a work told. Loop thread, wait-free. */
void fv_keeper_work(struct fv_keeper *keeper, const struct fovea_outputs *outputs);

/* Do what is to be done off the loop: take memory, write the file; complaints go to stderr.
 * Watching thread.
 */
void fv_keeper_tend(struct fv_keeper *keeper);
/* When the loop has ended: save once more. FOVEA_OK also when there is nothing to save. */
enum fovea_status fv_keeper_end(struct fv_keeper *keeper, struct fovea_error *error);

#endif

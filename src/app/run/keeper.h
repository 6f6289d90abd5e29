/* Saving the map while the loop runs, and at its end.
 *
 * The buffer is taken at the start, and every page of it touched, so that a save fails for want of
 * memory before the run and not after it. A save that is asked for goes from hand to hand: the
 * loop's thread passes the command on to the step with the buffer (fv_keeper_commands), and the
 * map's job fills it in units; when a work says that all is there (fv_keeper_work), the watching
 * thread writes the file (fv_keeper_tend) and gives the buffer back. So the loop makes no heap call
 * and waits for no disk. A save asked for while one is going on follows it. Saves are numbered from
 * 1, so that whoever asked for one can see its end (fv_keeper_ended).
 *
 * Where the map goes, and what becomes of the one there, is in app/config/map_file.h. */
#ifndef FOVEA_APP_RUN_KEEPER_H
#define FOVEA_APP_RUN_KEEPER_H

#include <stdatomic.h>

#include "app/config/settings.h"
#include "fovea/fovea.h"

enum fv_keeper_stage { FV_KEEPER_IDLE, FV_KEEPER_FILLING, FV_KEEPER_FULL };

struct fv_keeper {
    const struct fv_settings *settings;
    struct fovea *rt;
    uint8_t *buffer; /* NULL: no map is saved; said when one is asked for */
    size_t capacity;
    _Atomic int stage;   /* enum fv_keeper_stage: whose turn it is */
    atomic_bool unnamed; /* asked to save without a buffer: to be said */

    /* The loop's. */
    bool asked, overwrite; /* a save, by FOVEA_COMMAND_OVERWRITE */
    uint32_t begun;        /* saves */
    /* Handed over with the stage. */
    bool overwrites;
    size_t bytes;
    struct fovea_error failure; /* of the last save; "": none */
};

/* Take the buffer, when the settings name a file. FOVEA_ERROR_MEMORY: there is none. `settings`
 * stay the caller's. Init-only. */
enum fovea_status fv_keeper_open(struct fv_keeper *keeper, struct fovea *rt,
                                 const struct fv_settings *settings, struct fovea_error *error);
void fv_keeper_close(struct fv_keeper *keeper);

/* Commands for the step: those that came, but a save only when the buffer is free. Loop thread,
 * wait-free. */
uint32_t fv_keeper_commands(struct fv_keeper *keeper, uint32_t commands);
/* The number of the save that serves one asked for in the next fv_keeper_commands; 0: no file is
 * named. Loop thread, wait-free. */
uint32_t fv_keeper_next(const struct fv_keeper *keeper);
/* The number of saves that have ended. `*failure` (may be NULL): why the last of them failed, ""
 * if it did not; valid until the next fv_keeper_commands. Loop thread, wait-free; after the loop
 * has ended, any one thread. */
uint32_t fv_keeper_ended(const struct fv_keeper *keeper, const char **failure);
/* What a work gave. Loop thread, wait-free. */
void fv_keeper_work(struct fv_keeper *keeper, const struct fovea_outputs *outputs);

/* Write the file when a map is there; complaints go to stderr. Watching thread. */
void fv_keeper_tend(struct fv_keeper *keeper);
/* When the loop has ended: save once more. FOVEA_OK also when there is nothing to save. No heap
 * call. */
enum fovea_status fv_keeper_end(struct fv_keeper *keeper, struct fovea_error *error);

#endif

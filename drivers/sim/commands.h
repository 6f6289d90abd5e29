/* Velocity commands of a robot that is driven (`sim:drive?commands=1`). In lock-step frame n waits
 * for the command that answers frame n - 1, and shows the robot as it moves by it from frame n on;
 * so the same commands give the same frames, however long they take. By the clock nothing is waited
 * for: the last command holds, for half a second of the drive. */
#ifndef FOVEA_DRIVERS_SIM_COMMANDS_H
#define FOVEA_DRIVERS_SIM_COMMANDS_H

#include <semaphore.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stdint.h>

#include "fovea/source.h"

struct fv_sim_drive;

enum { FV_SIM_COMMANDS_QUEUE = 16 };

enum fv_sim_commands_end { FV_SIM_COMMANDS_DRIVES, FV_SIM_COMMANDS_ENDED, FV_SIM_COMMANDS_TOLD };

struct fv_sim_commands {
    bool enabled, by_clock;
    double patience_s; /* for the answer to one frame */
    /* From the thread that brings them to the loop's. */
    struct fovea_velocity_command queue[FV_SIM_COMMANDS_QUEUE];
    atomic_uint brought, taken;
    sem_t waiting; /* one for each that is in the queue */
    /* The loop's. */
    struct fovea_velocity_command last;
    uint64_t last_frame; /* at which it was taken */
    bool any, waits;
    int64_t waits_since_ns;
    /* Those that were taken and not yet given out as samples. */
    struct fovea_velocity_sample given[FV_SIM_COMMANDS_QUEUE];
    uint32_t given_count;
    int64_t last_stamp_ns; /* of the last frame */
    uint64_t failed_frame; /* that was not answered; 0: none */
    uint64_t others;       /* that came while it waited, answers to other frames, */
    int64_t other;         /* and the sequence of the last one */
    atomic_int end;        /* enum fv_sim_commands_end */
    bool told_goal;        /* of whoever asks for lines */
};

/* From any one thread, wait-free. */
enum fovea_status fv_sim_commands_bring(struct fv_sim_commands *commands,
                                        const struct fovea_velocity_command *command,
                                        struct fovea_error *error);
/* Advance the drive by the `steps` ticks that frame n needs. FOVEA_OK; FOVEA_AGAIN: its command has
 * not come until the deadline; FOVEA_ERROR_INPUT: it has not come for long. Loop thread. */
enum fovea_status fv_sim_commands_advance(struct fv_sim_commands *commands,
                                          struct fv_sim_drive *drive, uint64_t frame, int64_t steps,
                                          double rate_hz, int64_t deadline_ns);
/* Those that were taken since the last call, as samples; returns their number. Loop thread. */
uint32_t fv_sim_commands_give(struct fv_sim_commands *commands, struct fovea_sample *samples,
                              uint32_t count_max);
/* The drive has ended. Loop thread. */
void fv_sim_commands_end(struct fv_sim_commands *commands);
/* That the answer to a frame has not come for long; else FOVEA_AGAIN. */
enum fovea_status fv_sim_commands_failure(const struct fv_sim_commands *commands,
                                          struct fovea_error *error);
/* A line on where the goal is, once, and when the drive has ended another on how it went; else
 * FOVEA_AGAIN. Off the loop thread. */
enum fovea_status fv_sim_commands_tell(struct fv_sim_commands *commands,
                                       const struct fv_sim_drive *drive, struct fovea_error *error);

#endif

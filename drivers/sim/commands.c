#include "sim.h"

#include <stdio.h>
#include <string.h>

#include "../clock.h"
#include "../thread.h"

static const double holds_s = 0.5; /* of the drive: so long a command holds by the clock */

enum fovea_status fv_sim_commands_bring(struct fv_sim_commands *c,
                                        const struct fovea_velocity_command *command,
                                        struct fovea_error *error)
{
    const unsigned brought = atomic_load(&c->brought);
    if (!c->enabled)
        return fovea_error_set(
            error, FOVEA_ERROR_UNSUPPORTED,
            "sim: commands: found a velocity command, expected sim:drive with commands=1");
    if (brought - atomic_load(&c->taken) == FV_SIM_COMMANDS_QUEUE)
        return fovea_error_set(error, FOVEA_AGAIN,
                               "sim: commands: %d wait, expected one for each frame",
                               FV_SIM_COMMANDS_QUEUE);
    c->queue[brought % FV_SIM_COMMANDS_QUEUE] = *command;
    atomic_store(&c->brought, brought + 1);
    sem_post(&c->waiting);
    return FOVEA_OK;
}

/* The next of the queue, for which was waited. */
static struct fovea_velocity_command take(struct fv_sim_commands *c)
{
    const unsigned taken = atomic_load(&c->taken);
    const struct fovea_velocity_command command = c->queue[taken % FV_SIM_COMMANDS_QUEUE];
    atomic_store(&c->taken, taken + 1);
    return command;
}

static void keep(struct fv_sim_commands *c, const struct fovea_velocity_command *command,
                 uint64_t frame)
{
    c->last = *command;
    c->last_frame = frame;
    c->any = true;
    if (c->given_count == FV_SIM_COMMANDS_QUEUE) return;
    struct fovea_velocity_sample *sample = &c->given[c->given_count++];
    sample->stamp_ns = c->last_stamp_ns;
    memcpy(sample->velocity_m_s, command->velocity_m_s, sizeof sample->velocity_m_s);
    memcpy(sample->angular_rate, command->angular_rate, sizeof sample->angular_rate);
}

/* Wait for the answer to the frame before this one. Others, of frames that are over, are dropped.
 */
static enum fovea_status wait_for(struct fv_sim_commands *c, uint64_t frame, int64_t deadline_ns)
{
    const int64_t now_ns = fv_clock_ns(CLOCK_MONOTONIC);
    if (!c->waits) {
        c->waits = true;
        c->waits_since_ns = now_ns;
        c->others = 0;
    }
    const int64_t until_ns = c->waits_since_ns + (int64_t)(c->patience_s * 1e9);
    while (fv_thread_take(&c->waiting, deadline_ns < until_ns ? deadline_ns : until_ns)) {
        const struct fovea_velocity_command command = take(c);
        if (command.sequence >= 0 && (uint64_t)command.sequence != frame - 1) {
            c->others++;
            c->other = command.sequence;
            continue;
        }
        keep(c, &command, frame);
        c->waits = false;
        return FOVEA_OK;
    }
    if (fv_clock_ns(CLOCK_MONOTONIC) < until_ns) return FOVEA_AGAIN;
    c->failed_frame = frame;
    return FOVEA_ERROR_INPUT;
}

static void take_newest(struct fv_sim_commands *c, uint64_t frame, double rate_hz)
{
    while (fv_thread_take(&c->waiting, 0)) {
        const struct fovea_velocity_command command = take(c);
        keep(c, &command, frame);
    }
    if ((double)(frame - c->last_frame) > holds_s * rate_hz) c->any = false;
}

enum fovea_status fv_sim_commands_advance(struct fv_sim_commands *c, struct fv_sim_drive *drive,
                                          uint64_t frame, int64_t steps, double rate_hz,
                                          int64_t deadline_ns)
{
    enum fovea_status status = FOVEA_OK;
    if (c->by_clock)
        take_newest(c, frame, rate_hz);
    else if (frame > 0)
        status = wait_for(c, frame, deadline_ns);
    if (status != FOVEA_OK) return status;
    for (int64_t i = 0; i < steps; i++)
        fv_sim_drive_step(drive, c->any ? c->last.velocity_m_s[0] : 0,
                          c->any ? c->last.angular_rate[2] : 0);
    return FOVEA_OK;
}

uint32_t fv_sim_commands_give(struct fv_sim_commands *c, struct fovea_sample *samples,
                              uint32_t count_max)
{
    const uint32_t count = c->given_count < count_max ? c->given_count : count_max;
    for (uint32_t i = 0; i < count; i++)
        samples[i] = (struct fovea_sample){.kind = FOVEA_SAMPLE_VELOCITY, .velocity = c->given[i]};
    c->given_count -= count;
    memmove(c->given, c->given + count, c->given_count * sizeof *c->given);
    return count;
}

void fv_sim_commands_end(struct fv_sim_commands *c)
{
    if (atomic_load(&c->end) == FV_SIM_COMMANDS_DRIVES)
        atomic_store(&c->end, FV_SIM_COMMANDS_ENDED);
}

enum fovea_status fv_sim_commands_failure(const struct fv_sim_commands *c,
                                          struct fovea_error *error)
{
    if (c->failed_frame == 0) return FOVEA_AGAIN;
    char others[96] = "";
    if (c->others > 0)
        snprintf(others, sizeof others, " (%llu came, the last with %lld)",
                 (unsigned long long)c->others, (long long)c->other);
    return fovea_error_set(
        error, FOVEA_OK,
        "found no velocity_command_t with sequence %llu for %g s%s, expected an answer to each frame",
        (unsigned long long)(c->failed_frame - 1), c->patience_s, others);
}

static void tell_goal(const struct fv_sim_drive *d, struct fovea_error *error)
{
    const struct fv_sim_drive_tick *start = &d->tick[0];
    const double x = d->goal[0] - start->position[0], y = d->goal[1] - start->position[1];
    const double cosine = fv_cos(start->yaw), sine = fv_sin(start->yaw);
    (void)fovea_error_set(
        error, FOVEA_OK, "sim: drive: the goal is %.3f m ahead of the start and %.3f m to its left",
        cosine * x + sine * y, cosine * y - sine * x);
}

enum fovea_status fv_sim_commands_tell(struct fv_sim_commands *c, const struct fv_sim_drive *d,
                                       struct fovea_error *error)
{
    const double shortest_s = d->shortest_m / FV_SIM_DRIVE_SPEED_M_S;
    if (c->enabled && !c->told_goal) {
        c->told_goal = true;
        tell_goal(d, error);
        return FOVEA_OK;
    }
    if (!c->enabled || atomic_load(&c->end) != FV_SIM_COMMANDS_ENDED) return FOVEA_AGAIN;
    atomic_store(&c->end, FV_SIM_COMMANDS_TOLD);
    if (d->reached >= 0)
        (void)fovea_error_set(
            error, FOVEA_OK,
            "sim: drive: at the goal after %.2f s, contacts %lld; the shortest way takes %.2f s at %g m/s",
            (double)d->reached * d->tick_s, (long long)d->contacts, shortest_s,
            FV_SIM_DRIVE_SPEED_M_S);
    else
        (void)fovea_error_set(
            error, FOVEA_OK,
            "sim: drive: not at the goal after %.2f s, contacts %lld; the shortest way takes %.2f s at %g m/s",
            (double)d->tick_count * d->tick_s, (long long)d->contacts, shortest_s,
            FV_SIM_DRIVE_SPEED_M_S);
    return FOVEA_OK;
}

/* Faults one after the other: each of `shortest` to `longest` frames, behind each a gap of the
 * length that the fraction of faulty frames asks for, half as much to half as much again. */
#include "fault.h"

#include "base/elementary.h"

/* Draw the length of a window that begins at `begin`, and its seed. */
static void window_draw(struct fv_fault_schedule *schedule, uint64_t begin)
{
    const struct fv_fault_options *options = schedule->options;
    struct fv_random random;
    fv_random_seed(&random, schedule->state);
    const uint32_t range = (uint32_t)(options->longest - options->shortest) + 1;
    const uint64_t frames = (uint64_t)options->shortest + fv_random_below(&random, range);
    schedule->window.begin = begin;
    schedule->window.end = begin + frames;
    const uint64_t high = fv_random_u32(&random);
    schedule->window.seed = high << 32 | fv_random_u32(&random);
    const uint64_t next = fv_random_u32(&random);
    schedule->state = next << 32 | fv_random_u32(&random);
}

/* Frames between a window and the next. */
static uint64_t gap_draw(const struct fv_fault_schedule *schedule)
{
    const struct fv_fault_options *options = schedule->options;
    struct fv_random random;
    fv_random_seed(&random, ~schedule->window.seed);
    const double mean =
        0.5 * (options->shortest + options->longest) * (1 - options->fraction) / options->fraction;
    return (uint64_t)(mean * (0.5 + fv_random_unit(&random)) + 0.5);
}

static void schedule_rewind(struct fv_fault_schedule *schedule)
{
    schedule->number = 0;
    schedule->since = 0;
    schedule->state = schedule->options->seed;
    window_draw(schedule, schedule->options->first);
}

void fv_fault_schedule_open(struct fv_fault_schedule *schedule,
                            const struct fv_fault_options *options)
{
    schedule->options = options;
    schedule_rewind(schedule);
}

bool fv_fault_schedule_at(struct fv_fault_schedule *schedule, uint64_t index,
                          struct fv_fault_window *window)
{
    const uint64_t count = schedule->options->count;
    if (index < schedule->since) schedule_rewind(schedule);
    while (index >= schedule->window.end && (count == 0 || schedule->number + 1 < count)) {
        schedule->since = schedule->window.end;
        window_draw(schedule, schedule->window.end + gap_draw(schedule));
        schedule->number++;
    }
    *window = schedule->window;
    return index >= window->begin && index < window->end;
}

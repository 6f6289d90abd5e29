/* The governor: turns measured time into grants. It stands outside the state, so that a replay,
 * which is given the recorded grants, needs no clock.
 *
 * A job's guaranteed minimum (jobs.c) finishes it in bounded frames even on a board that is always
 * short of time; the rest of the period is shared by priority. Sustained shortage lowers the
 * features asked for, by a tenth at a time. */
#include "runtime/jobs.h"

enum {
    SHORT_FRAMES_TO_ACT = 15,  /* half a second at 30 Hz: a single slow frame changes nothing */
    AMPLE_FRAMES_TO_ACT = 150, /* slower up than down, so that it does not oscillate */
    UNITS_MAX = 4096,
    USABLE_PERCENT = 85,         /* of the period: the rest is the system's and the driver's */
    UNIT_FIRST_GUESS_NS = 250000 /* the bound that units are built to */
};

void fovea_grants_fixed(const struct fovea_config *config, struct fovea_grants *grants)
{
    grants->features = config->features.count_max;
    for (int job = 0; job < FOVEA_JOB_COUNT; job++)
        grants->units[job] = fv_jobs[job]->units_fixed;
}

void fovea_governor_init(struct fovea_governor *governor, const struct fovea_config *config,
                         int64_t period_ns)
{
    *governor = (struct fovea_governor){.period_ns = period_ns,
                                        .features = config->features.count_max,
                                        .features_max = config->features.count_max,
                                        .features_min = FOVEA_FEATURES_MIN};
    for (int job = 0; job < FOVEA_JOB_COUNT; job++)
        governor->unit_ns[job] = UNIT_FIRST_GUESS_NS;
}

static int64_t usable_ns(const struct fovea_governor *governor)
{
    return governor->period_ns / 100 * USABLE_PERCENT;
}

void fovea_governor_next(struct fovea_governor *governor, const struct fovea_config *config,
                         struct fovea_grants *grants)
{
    if (governor->short_frames >= SHORT_FRAMES_TO_ACT) {
        governor->features -= governor->features / 10;
        if (governor->features < governor->features_min)
            governor->features = governor->features_min;
        governor->short_frames = 0;
    } else if (governor->ample_frames >= AMPLE_FRAMES_TO_ACT) {
        governor->features += governor->features / 10;
        if (governor->features > governor->features_max)
            governor->features = governor->features_max;
        governor->ample_frames = 0;
    }
    fovea_grants_fixed(config, grants);
    grants->features = governor->features;
}

void fovea_governor_work(struct fovea_governor *governor, int64_t step_ns, uint32_t jobs_waiting,
                         struct fovea_grants *grants)
{
    int64_t left_ns = usable_ns(governor) - step_ns;
    for (int job = 0; job < FOVEA_JOB_COUNT; job++) {
        grants->units[job] = fv_jobs[job]->units_min;
        left_ns -= (jobs_waiting >> job & 1) ? fv_jobs[job]->units_min * governor->unit_ns[job] : 0;
    }
    for (int job = 0; job < FOVEA_JOB_COUNT && left_ns > 0; job++) {
        if (!(jobs_waiting >> job & 1)) continue;
        int64_t more = left_ns / governor->unit_ns[job];
        if (more > UNITS_MAX) more = UNITS_MAX;
        grants->units[job] += (uint32_t)more;
        left_ns -= more * governor->unit_ns[job];
    }
}

/* Estimates follow rises at once and falls slowly: a bound is wanted, not a mean. */
static int64_t follow(int64_t estimate, int64_t sample)
{
    return sample > estimate ? sample : estimate - (estimate - sample) / 16;
}

void fovea_governor_learn(struct fovea_governor *governor, int64_t step_ns, int64_t work_ns,
                          const struct fovea_outputs *work_outputs)
{
    uint32_t units = 0;
    for (int job = 0; job < FOVEA_JOB_COUNT; job++)
        units += work_outputs->units_done[job];
    if (units > 0) {
        for (int job = 0; job < FOVEA_JOB_COUNT; job++) {
            if (work_outputs->units_done[job] == 0) continue;
            const int64_t sample = work_ns / units;
            governor->unit_ns[job] = follow(governor->unit_ns[job], sample < 1000 ? 1000 : sample);
        }
    }
    governor->step_ns = follow(governor->step_ns, step_ns);
    const bool is_short = step_ns + work_ns > usable_ns(governor);
    const bool is_ample = step_ns < usable_ns(governor) / 2;
    governor->short_frames = is_short ? governor->short_frames + 1 : 0;
    governor->ample_frames = is_ample ? governor->ample_frames + 1 : 0;
}

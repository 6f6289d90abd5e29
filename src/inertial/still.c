#include "inertial/still.h"

#include <string.h>

#include "geometry/vec.h"
#include "inertial/stamp.h"

enum { QUIET_BLOCKS = 2, COUNT_MIN = 10 };

static const int64_t block_ns = 250000000, gap_max_ns = 60000000, stay_ns = 500000000;
/* Standing and moving differ by more: sim:stopgo, and the quiet beginning of euroc_v101_standing.
 */
static const double vary_most = 1.6, jump_most = 6; /* of a sample's noise */
static const double stay_rad = 0.002;
static const double slow_m_s = 0.03, slow_sigmas = 2; /* a velocity that may be none */

void fv_imu_still_init(struct fv_imu_still *still)
{
    memset(still, 0, sizeof *still);
    still->fast_ns = still->stirred_ns = INT64_MIN;
}

void fv_imu_still_forget(struct fv_imu_still *still)
{
    still->anchored = still->standing = false;
}

/* ---- samples --------------------------------------------------------------------------------- */

static double noise_of(const struct fv_imu_still_noise *noise, int axis)
{
    return axis < 3 ? noise->gyro : noise->acceleration;
}

static void begin_block(struct fv_imu_still *still, int64_t stamp_ns)
{
    still->block_ns = stamp_ns;
    still->count = 0;
    memset(still->sum, 0, sizeof still->sum);
    memset(still->square, 0, sizeof still->square);
}

static void stir(struct fv_imu_still *still)
{
    still->blocks = 0;
    still->standing = false;
    still->stirred_ns = still->last_ns;
}

static void end_block(struct fv_imu_still *still, const struct fv_imu_still_noise *noise)
{
    const double n = (double)still->count;
    bool quiet = still->count >= COUNT_MIN;
    for (int i = 0; i < 6 && still->count > 1; i++) {
        const double most = vary_most * noise_of(noise, i), shift = still->sum[i] / n;
        const double variance = (still->square[i] - n * shift * shift) / (n - 1);
        const double shift_most = jump_most * noise_of(noise, i) * __builtin_sqrt(2 / n);
        quiet =
            quiet && variance <= most * most && (still->blocks == 0 || fv_abs(shift) <= shift_most);
        /* The first one counts: from then on the mean stays. */
        if (still->blocks == 0 || !quiet) still->mean[i] += shift;
    }
    if (quiet)
        still->blocks++;
    else
        stir(still);
}

void fv_imu_still_take(struct fv_imu_still *still, const struct fv_imu_still_noise *noise,
                       const struct fv_imu_reading *sample)
{
    const int64_t since_ns = fv_stamp_since(sample->stamp_ns, still->last_ns);
    still->last_ns = sample->stamp_ns;
    if (since_ns <= 0 || since_ns > gap_max_ns) {
        stir(still);
        begin_block(still, sample->stamp_ns);
    }
    for (int i = 0; i < 6; i++) {
        const double value = i < 3 ? sample->gyro[i] : sample->acceleration[i - 3],
                     off = value - still->mean[i];
        if (still->blocks > 0 && fv_abs(off) > jump_most * noise_of(noise, i)) stir(still);
        still->sum[i] += off;
        still->square[i] += off * off;
    }
    still->count++;
    if (fv_stamp_since(sample->stamp_ns, still->block_ns) < block_ns) return;
    end_block(still, noise);
    begin_block(still, sample->stamp_ns);
}

/* ---- pictures -------------------------------------------------------------------------------- */

/* How far the pose is from the anchor, as an angle. */
static double away(const struct fv_imu_still *still, const struct fv_imu_still_seen *seen)
{
    struct fv_se3 between;
    double turn[3];
    fv_se3_invert(&still->anchor, &between);
    fv_se3_compose(&between, &seen->T_world_cam, &between);
    fv_so3_log(between.R, turn);
    const double turned = fv_norm3(turn), gone = fv_norm3(between.t) / seen->depth;
    return turned > gone ? turned : gone;
}

void fv_imu_still_see(struct fv_imu_still *still, const struct fv_imu_still_seen *seen)
{
    if (seen->velocity > slow_m_s + slow_sigmas * seen->velocity_sigma)
        still->fast_ns = seen->stamp_ns;
    if (!seen->of_use) {
        fv_imu_still_forget(still);
        return;
    }
    if (!still->anchored || !(seen->depth > 0) || away(still, seen) > stay_rad) {
        still->anchor = seen->T_world_cam;
        still->since_ns = seen->stamp_ns;
        still->anchored = true;
        still->standing = false;
        return;
    }
    still->standing = still->blocks >= QUIET_BLOCKS && still->stirred_ns >= still->fast_ns &&
                      fv_stamp_since(seen->stamp_ns, still->since_ns) >= stay_ns;
}

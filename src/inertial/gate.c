#include "inertial/gate.h"

#include <string.h>

#include "inertial/reading.h"
#include "inertial/stamp.h"

enum { AXES = 6, SAME_MIN = 10, AT_END_MIN = 4, OTHERS_MIN = 20 };
enum { INTERVALS_MIN = 16, INTERVALS_MAX = 64 }; /* that the observed rate is the mean of */

static const int64_t same_min_ns = 100000000, clock_max_ns = 1000000000, leap_ns = 100000000,
                     follow_ns = 250000000, silent_ns = 200000000;
static const double end_fraction = 0.999;
static const double end_floor[2] = {2, 15}; /* below, no end of a range is learned */
static const double agree_fraction = 0.1;   /* of nominal and observed period */
static const double round_up = 0.4;      /* of a period: jitter of stamps is less than the rest */
static const double forget_behind = 0.9; /* per sample */
static const double lossy_max = 0.5;     /* share of intervals with samples missing */
static const double silent_periods = 20;
static const double rate_min_hz = 1e-3; /* a nominal rate below says nothing */
static const double missing_max = 1e9;  /* in one gap: a count, not a time */

const char *fovea_imu_state_name(enum fovea_imu_state state)
{
    static const char *const names[FOVEA_IMU_STATE_COUNT] = {
        [FOVEA_IMU_NONE] = "none",
        [FOVEA_IMU_OK] = "ok",
        [FOVEA_IMU_SILENT] = "silent",
        [FOVEA_IMU_NOT_FINITE] = "not finite",
        [FOVEA_IMU_SATURATED] = "saturated",
        [FOVEA_IMU_FROZEN] = "frozen",
        [FOVEA_IMU_OFF_CLOCK] = "off the clock",
    };
    return (unsigned)state < FOVEA_IMU_STATE_COUNT ? names[state] : "unknown";
}

void fv_imu_gate_carve(struct fv_imu_gate *gate, const struct fovea_rig_imu *rig,
                       struct fv_arena *persistent, struct fv_arena *frame)
{
    gate->rig = *rig;
    gate->state = fv_arena_take(persistent, 1, sizeof *gate->state);
    gate->clean = fv_arena_take(frame, FOVEA_INPUT_SAMPLES_MAX, sizeof *gate->clean);
    gate->count = 0;
}

/* ---- numbers --------------------------------------------------------------------------------- */

/* a + b; at the ends of the range, the end. */
static int64_t add(int64_t a, int64_t b)
{
    int64_t sum;
    return __builtin_add_overflow(a, b, &sum) ? (b < 0 ? INT64_MIN : INT64_MAX) : sum;
}

static int64_t smaller(int64_t a, int64_t b)
{
    return a < b ? a : b;
}

static double magnitude(double v)
{
    return v < 0 ? -v : v;
}

/* Of gyro and acceleration, by axis. */
static int sort_of(int axis)
{
    return axis / 3;
}

/* As bits: -0 and 0 are two values. */
static bool same(const double *a, const double *b, size_t count)
{
    return memcmp(a, b, count * sizeof *a) == 0;
}

/* ---- values ---------------------------------------------------------------------------------- */

/* Whether an axis is at the end of its range: the one that the rig states, or one below that which
 * is learned, since a sensor may stop before its numbers do. */
static bool is_saturated(struct fv_imu_gate *gate, const double values[AXES])
{
    const double stated[2] = {gate->rig.gyro_range, gate->rig.acceleration_range};
    struct fv_imu_gate_state *state = gate->state;
    bool saturated = false;
    for (int i = 0; i < AXES; i++) {
        const int sort = sort_of(i);
        const double size = magnitude(values[i]);
        const bool again = state->any_seen && same(&values[i], &state->values[i], 1);
        const bool extreme = size >= state->peak[sort] && size > end_floor[sort];
        if (size > state->level[sort]) state->level[sort] = 0;
        state->axis_same[i] = !extreme ? 0 : again ? state->axis_same[i] + 1 : 1;
        if (state->axis_same[i] >= AT_END_MIN) state->level[sort] = size;
        if (size > state->peak[sort]) state->peak[sort] = size;
        const double learned = state->level[sort];
        const bool before = learned > 0 && !(stated[sort] > 0 && stated[sort] < learned);
        const double end = before ? learned : stated[sort];
        saturated = saturated || (end > 0 && size >= end * end_fraction);
    }
    return saturated;
}

static bool is_frozen(struct fv_imu_gate *gate, const double values[AXES], int64_t at_ns)
{
    struct fv_imu_gate_state *state = gate->state;
    if (!state->any_seen || !same(values, state->values, AXES)) {
        state->same = 1;
        state->same_since_ns = at_ns;
        return false;
    }
    state->same++;
    return (gate->rig.gyro_noise > 0 || gate->rig.acceleration_noise > 0) &&
           state->same >= SAME_MIN && fv_stamp_since(at_ns, state->same_since_ns) >= same_min_ns;
}

/* ---- stamps ---------------------------------------------------------------------------------- */

/* Samples out of order that agree among themselves are the sensor's clock, which leapt, when none
 * in order has come for a while. */
static bool clock_leapt(struct fv_imu_gate_state *state, int64_t at_ns, int64_t now_ns)
{
    const bool continues = state->others > 0 && at_ns > state->other_ns &&
                           fv_stamp_since(at_ns, state->other_ns) < leap_ns;
    if (state->others > 0 && at_ns == state->other_ns)
        return false; /* a repetition: says nothing */
    state->others = continues ? state->others + 1 : 1;
    state->other_ns = at_ns;
    return state->others >= OTHERS_MIN && fv_stamp_since(now_ns, state->seen_now_ns) >= follow_ns;
}

static bool off_clock(const struct fv_imu_gate_state *state, int64_t at_ns, int64_t now_ns)
{
    const int64_t before_ns = state->any_step ? smaller(state->step_ns, now_ns) : now_ns;
    return fv_stamp_since(at_ns, now_ns) > clock_max_ns ||
           fv_stamp_since(before_ns, at_ns) > clock_max_ns;
}

/* Whether the stamp is farther ahead of the last one than time has passed. */
static bool leaps_ahead(const struct fv_imu_gate_state *state, int64_t at_ns, int64_t now_ns)
{
    const int64_t passed_ns = fv_stamp_since(now_ns, state->seen_now_ns),
                  step_ns = fv_stamp_since(now_ns, state->step_ns);
    return fv_stamp_since(at_ns, state->seen_ns) > add(add(passed_ns, step_ns), leap_ns);
}

static void lack(struct fv_imu_gate_state *state, uint32_t count)
{
    const uint32_t room = UINT32_MAX - state->lacking;
    state->lacking += count < room ? count : room;
}

/* The nominal period, or where that agrees with the observed one to a tenth, or is not stated, the
 * observed one. */
static double period_of(const struct fv_imu_gate *gate)
{
    const struct fv_imu_gate_state *state = gate->state;
    if (!(gate->rig.rate_hz >= rate_min_hz)) return state->period_ns;
    const double nominal_ns = 1e9 / gate->rig.rate_hz;
    const bool agree = state->intervals >= INTERVALS_MIN &&
                       magnitude(state->period_ns - nominal_ns) <= agree_fraction * nominal_ns;
    return agree ? state->period_ns : nominal_ns;
}

/* Follow the mean interval. One with samples missing counts as so many, unless most are like that:
 * then the rate is another. */
static void observe_period(struct fv_imu_gate_state *state, double interval_ns, uint32_t missing)
{
    const double most = 2 * state->period_ns;
    if (state->intervals < INTERVALS_MAX) state->intervals++;
    state->lossy += ((missing > 0) - state->lossy) / INTERVALS_MAX;
    if (state->lossy < lossy_max) interval_ns /= 1.0 + missing;
    if (state->intervals == 1) state->period_ns = interval_ns;
    if (state->intervals > INTERVALS_MIN && interval_ns > most) interval_ns = most;
    state->period_ns += (interval_ns - state->period_ns) / state->intervals;
}

/* How many are missing between the last sample in order and this one. */
static uint32_t missing_before(struct fv_imu_gate *gate, double interval_ns)
{
    struct fv_imu_gate_state *state = gate->state;
    const double period_ns = period_of(gate);
    if (gate->rig.rate_hz < rate_min_hz && state->intervals < INTERVALS_MIN) return 0;
    state->behind_ns = state->behind_ns * forget_behind + interval_ns - period_ns;
    if (state->behind_ns < -2 * period_ns) state->behind_ns = -2 * period_ns;
    const double whole = state->behind_ns / period_ns + round_up;
    if (!(whole >= 1)) return 0;
    const uint32_t missing = (uint32_t)(whole < missing_max ? whole : missing_max);
    state->behind_ns = whole < missing_max ? state->behind_ns - missing * period_ns : 0;
    return missing;
}

static void count_missing(struct fv_imu_gate *gate, int64_t at_ns)
{
    struct fv_imu_gate_state *state = gate->state;
    const double interval_ns = (double)fv_stamp_since(at_ns, state->seen_ns);
    const uint32_t missing = missing_before(gate, interval_ns);
    state->counts.missing += missing;
    lack(state, missing);
    observe_period(state, interval_ns, missing);
}

/* ---- a sample -------------------------------------------------------------------------------- */

static void refuse(struct fv_imu_gate_state *state, uint64_t *count, enum fovea_imu_state verdict)
{
    ++*count;
    state->verdict = (uint32_t)verdict;
}

/* The same for one that stands in its place among the others. */
static void refuse_value(struct fv_imu_gate_state *state, uint64_t *count,
                         enum fovea_imu_state verdict)
{
    refuse(state, count, verdict);
    lack(state, 1);
}

/* Nothing before continues: forget what was learned from intervals and successions. */
static void begin_anew(struct fv_imu_gate_state *state)
{
    state->any_seen = state->any_clean = 0;
    state->behind_ns = 0;
    state->others = 0;
}

static void pass(struct fv_imu_gate *gate, const struct fovea_imu_sample *sample, int64_t at_ns)
{
    struct fv_imu_gate_state *state = gate->state;
    struct fv_imu_clean *clean = &gate->clean[gate->count++];
    *clean = (struct fv_imu_clean){.sample = *sample, .lacking = state->lacking};
    if (!state->any_clean) {
        clean->notes = FV_IMU_AFTER_JUMP;
        clean->lacking = 0;
    } else if (state->lacking > 0) {
        clean->notes = FV_IMU_AFTER_GAP;
        state->counts.gaps++;
    }
    state->lacking = 0;
    state->clean_ns = at_ns;
    state->any_clean = 1;
    state->counts.taken++;
    state->verdict = FOVEA_IMU_OK;
}

/* Whether the stamp continues the samples before, or the clock has leapt and it begins anew. */
static bool in_order(struct fv_imu_gate *gate, const double values[AXES], int64_t at_ns,
                     int64_t now_ns)
{
    struct fv_imu_gate_state *state = gate->state;
    struct fovea_imu_counts *counts = &state->counts;
    if (off_clock(state, at_ns, now_ns)) {
        refuse(state, &counts->off_clock, FOVEA_IMU_OFF_CLOCK);
        return false;
    }
    if (!state->any_seen) return true;
    const bool ahead = leaps_ahead(state, at_ns, now_ns);
    if (at_ns > state->seen_ns && !ahead) {
        const bool leapt = state->others > 0 && state->other_ns > state->seen_ns &&
                           fv_stamp_since(at_ns, state->other_ns) < leap_ns &&
                           at_ns > state->other_ns;
        if (leapt) { /* it was refused as ahead until the time had passed */
            counts->jumps++;
            begin_anew(state);
        }
        state->others = 0;
        return true;
    }
    if (at_ns == state->seen_ns && same(values, state->values, AXES)) {
        counts->repeated++;
        return false;
    }
    if (clock_leapt(state, at_ns, now_ns)) {
        counts->jumps++;
        begin_anew(state);
        return true;
    }
    if (ahead)
        refuse(state, &counts->off_clock, FOVEA_IMU_OFF_CLOCK);
    else
        counts->late++;
    return false;
}

static void judge(struct fv_imu_gate *gate, const struct fovea_imu_sample *sample, int64_t now_ns)
{
    struct fv_imu_gate_state *state = gate->state;
    struct fovea_imu_counts *counts = &state->counts;
    const int64_t at_ns = add(sample->stamp_ns, gate->rig.time_offset_ns);
    double values[AXES];
    memcpy(values, sample->gyro, sizeof sample->gyro);
    memcpy(values + 3, sample->acceleration, sizeof sample->acceleration);
    if (!in_order(gate, values, at_ns, now_ns)) return;
    if (state->any_seen) count_missing(gate, at_ns);
    const bool finite = fv_imu_possible(sample);
    const bool saturated = finite && is_saturated(gate, values);
    const bool frozen = finite && is_frozen(gate, values, at_ns);
    memcpy(state->values, values, sizeof values);
    state->seen_ns = at_ns;
    state->seen_now_ns = now_ns;
    state->any_seen = 1;
    if (!finite)
        refuse_value(state, &counts->not_finite, FOVEA_IMU_NOT_FINITE);
    else if (frozen)
        refuse_value(state, &counts->frozen, FOVEA_IMU_FROZEN);
    else if (saturated)
        refuse_value(state, &counts->saturated, FOVEA_IMU_SATURATED);
    else
        pass(gate, sample, at_ns);
}

void fv_imu_gate_step(struct fv_imu_gate *gate, const struct fovea_sample *samples, uint32_t count,
                      int64_t now_ns)
{
    struct fv_imu_gate_state *state = gate->state;
    gate->count = 0;
    if (!state->any_step) state->step_ns = now_ns;
    for (uint32_t i = 0; i < count && i < FOVEA_INPUT_SAMPLES_MAX; i++)
        if (samples[i].kind == FOVEA_SAMPLE_IMU) {
            state->any_heard = 1;
            state->heard_now_ns = now_ns;
            judge(gate, &samples[i].imu, now_ns);
        }
    state->step_ns = now_ns;
    state->any_step = 1;
}

/* Without a sample for long, good or bad. */
static bool is_silent(const struct fv_imu_gate *gate)
{
    const struct fv_imu_gate_state *state = gate->state;
    const double periods_ns = silent_periods * period_of(gate);
    const int64_t most_ns = periods_ns <= (double)silent_ns ? silent_ns
                            : periods_ns < 1e18             ? (int64_t)periods_ns
                                                            : INT64_MAX;
    return !state->any_heard || fv_stamp_since(state->step_ns, state->heard_now_ns) > most_ns;
}

void fv_imu_gate_status(const struct fv_imu_gate *gate, struct fovea_imu_status *status)
{
    const struct fv_imu_gate_state *state = gate->state;
    *status = (struct fovea_imu_status){
        .state = (enum fovea_imu_state)state->verdict,
        .stamp_ns = fv_stamp_since(state->clean_ns, gate->rig.time_offset_ns),
        .rate_hz = state->period_ns > 0 ? 1e9 / state->period_ns : 0,
        .counts = state->counts};
    if (!state->any_clean) status->stamp_ns = 0;
    if (is_silent(gate)) status->state = FOVEA_IMU_SILENT;
}

/* The scale from wheel odometry: displacement of the camera by it over that in the map. */
#include <string.h>

#include "geometry/vec.h"
#include "scale/scale.h"

static const double stretch_least_m = 0.2; /* shorter ones measure noise */
static const double inner_least =
    1e-3; /* units of the map: less is no motion, whatever wheel odometry says */
static const double sigma_stretch_least = 0.01; /* of one stretch, relative */
static const double sigma_few =
    0.1; /* of one stretch, while there are too few to show their spread */
static const double sigma_least = 0.005;       /* of them all: no number of stretches gives less */
static const uint64_t gap_most_ns = 500000000; /* between samples */
enum { STRETCHES_FEW = 6 };

/* Stamps may be anything. */
static uint64_t apart_ns(int64_t earlier, int64_t later)
{
    return (uint64_t)later - (uint64_t)earlier;
}

static void observe(struct fv_scale *scale, const struct fovea_wheel_odometry_sample *sample)
{
    struct fv_scale_state *s = scale->state;
    int64_t last = s->positions[(s->position_count - 1) % FV_SCALE_POSITIONS_MAX].stamp_ns;
    /* Far back: a clock was set, or the last stamp was wrong. What came before has another time. */
    if (s->position_count > 0 && last > sample->stamp_ns &&
        apart_ns(sample->stamp_ns, last) > gap_most_ns)
        s->position_count = 0;
    if (s->position_count > 0 && sample->stamp_ns <= last) return;
    struct fv_se3 T_wheel_odom_body;
    fv_so3_from_quaternion(sample->orientation, T_wheel_odom_body.R);
    fv_copy3(sample->position_m, T_wheel_odom_body.t);
    struct fv_scale_position *position =
        &s->positions[s->position_count++ % FV_SCALE_POSITIONS_MAX];
    position->stamp_ns = sample->stamp_ns;
    fv_se3_apply(&T_wheel_odom_body, scale->T_body_cam.t, position->at);
}

void fv_scale_observe(struct fv_scale *scale, const struct fovea_sample *samples, uint32_t count)
{
    if (scale->config.source != FOVEA_SCALE_WHEEL_ODOMETRY) return;
    for (uint32_t i = 0; i < count && i < FOVEA_INPUT_SAMPLES_MAX; i++)
        if (samples[i].kind == FOVEA_SAMPLE_WHEEL_ODOMETRY)
            observe(scale, &samples[i].wheel_odometry);
}

/* -1: wheel odometry has not come so far yet; 0: it begins later or has a gap there; 1: found. */
static int position_at(const struct fv_scale_state *s, int64_t stamp_ns, double at[3])
{
    uint64_t oldest =
        s->position_count > FV_SCALE_POSITIONS_MAX ? s->position_count - FV_SCALE_POSITIONS_MAX : 0;
    if (s->position_count == 0 ||
        s->positions[(s->position_count - 1) % FV_SCALE_POSITIONS_MAX].stamp_ns < stamp_ns)
        return -1;
    uint64_t low = oldest, high = s->position_count - 1; /* the first one not before the stamp */
    while (low < high) {
        uint64_t middle = low + (high - low) / 2;
        if (s->positions[middle % FV_SCALE_POSITIONS_MAX].stamp_ns < stamp_ns)
            low = middle + 1;
        else
            high = middle;
    }
    const struct fv_scale_position *b = &s->positions[low % FV_SCALE_POSITIONS_MAX];
    if (b->stamp_ns == stamp_ns) return (fv_copy3(b->at, at), 1);
    if (low == oldest) return 0;
    const struct fv_scale_position *a = &s->positions[(low - 1) % FV_SCALE_POSITIONS_MAX];
    if (apart_ns(a->stamp_ns, b->stamp_ns) > gap_most_ns) return 0;
    double fraction = (double)(stamp_ns - a->stamp_ns) / (double)(b->stamp_ns - a->stamp_ns);
    for (int i = 0; i < 3; i++)
        at[i] = a->at[i] + fraction * (b->at[i] - a->at[i]);
    return 1;
}

static void scale_sort(double *values, uint32_t count)
{
    for (uint32_t i = 1; i < count; i++) {
        double value = values[i];
        uint32_t at = i;
        for (; at > 0 && values[at - 1] > value; at--)
            values[at] = values[at - 1];
        values[at] = value;
    }
}

/* Mean of the ratios within three deviations of their median; the deviation is that of their middle
 * (1.4826 times the median of distances, for normal errors). */
static void scale_refine(struct fv_scale_state *s, double *ratios, uint32_t count)
{
    double off[FV_SCALE_STATIONS_MAX], sum = 0;
    uint32_t used = 0;
    if (count == 0) return;
    scale_sort(ratios, count);
    double middle = 0.5 * (ratios[(count - 1) / 2] + ratios[count / 2]);
    for (uint32_t i = 0; i < count; i++)
        off[i] = fv_abs(ratios[i] - middle);
    scale_sort(off, count);
    double sigma = 1.4826 * off[count / 2];
    if (sigma < sigma_stretch_least) sigma = sigma_stretch_least;
    for (uint32_t i = 0; i < count; i++) {
        if (fv_abs(ratios[i] - middle) > 3 * sigma) continue;
        sum += ratios[i];
        used++;
    }
    if (count < STRETCHES_FEW && sigma < sigma_few) sigma = sigma_few;
    s->known = true;
    s->source = FOVEA_SCALE_WHEEL_ODOMETRY;
    s->log_scale = sum / used;
    s->variance = sigma * sigma / used + sigma_least * sigma_least;
    if (s->prior_variance > 0) { /* what the map brought, weighed by how sure the two are */
        const double gain = s->prior_variance / (s->prior_variance + s->variance);
        s->log_scale = s->prior + gain * (s->log_scale - s->prior);
        s->variance *= gain;
    }
}

/* Keyframes of this map become stations in order of their numbers; the oldest give way. */
static void scale_note_keyframes(struct fv_scale_state *s, const struct fv_map *map)
{
    for (int added = 0; added < FV_SCALE_STATIONS_MAX; added++) {
        const struct fv_keyframe *next = NULL;
        for (uint32_t k = 0; k < map->limits.keyframes; k++) {
            const struct fv_keyframe *f = &map->keyframes[k];
            if (f->used && f->map_id == s->map && f->number >= s->station_next &&
                (next == NULL || f->number < next->number))
                next = f;
        }
        if (next == NULL) return;
        if (s->station_count == FV_SCALE_STATIONS_MAX)
            memmove(s->stations, s->stations + 1, --s->station_count * sizeof s->stations[0]);
        struct fv_scale_station *station = &s->stations[s->station_count++];
        memset(station, 0, sizeof *station);
        station->slot = (uint32_t)(next - map->keyframes);
        station->generation = next->generation;
        station->position.stamp_ns = next->stamp_ns;
        s->station_next = next->number + 1;
    }
}

/* Ask wheel odometry for the positions of stations; forget those that it does not know or the map
 * no longer holds. */
static void position_stations(struct fv_scale_state *s, const struct fv_map *map)
{
    uint32_t kept = 0;
    for (uint32_t i = 0; i < s->station_count; i++) {
        struct fv_scale_station station = s->stations[i];
        const struct fv_keyframe *keyframe = &map->keyframes[station.slot];
        if (!keyframe->used || keyframe->generation != station.generation ||
            keyframe->map_id != s->map)
            continue;
        if (!station.positioned) {
            int found = position_at(s, station.position.stamp_ns, station.position.at);
            if (found == 0) continue;
            station.positioned = found > 0;
        }
        s->stations[kept++] = station;
    }
    s->station_count = kept;
}

void fv_scale_walk(struct fv_scale *scale, const struct fv_odometry *odometry)
{
    const struct fv_map *map = fv_odometry_map(odometry);
    static const double origin[3] = {0, 0, 0};
    struct fv_scale_state *s = scale->state;
    double ratios[FV_SCALE_STATIONS_MAX], from_inner[3] = {0}, from_outer[3] = {0};
    uint32_t count = 0;
    bool begun = false;
    scale_note_keyframes(s, map);
    position_stations(s, map);
    for (uint32_t i = 0; i < s->station_count && s->stations[i].positioned; i++) {
        double inner[3], by_map[3], by_odometry[3];
        fv_se3_apply_inverse(&map->keyframes[s->stations[i].slot].T_cam_world, origin, inner);
        fv_subtract3(inner, from_inner, by_map);
        fv_subtract3(s->stations[i].position.at, from_outer, by_odometry);
        double moved = fv_norm3(by_odometry), seen = fv_norm3(by_map);
        if (begun && (moved < stretch_least_m || seen < inner_least)) continue;
        if (begun) ratios[count++] = fv_log(moved / seen);
        begun = true;
        fv_copy3(inner, from_inner);
        fv_copy3(s->stations[i].position.at, from_outer);
    }
    scale_refine(s, ratios, count);
}

/* Tracks as LCM bytes. */
#include <string.h>

#include "message/message.h"
#include "message/wire.h"

#include "fovea_tracks_t.h"

/* One array per member, in the caller's scratch, widest first. */
struct columns {
    int64_t *id, *age_ns, *unseen_ns;
    double *position, *velocity, *covariance, *velocity_covariance;
    char **name;
    int32_t *class_id, *hits;
    float *real[7]; /* score, box, velocity */
    int8_t *state, *located;
};

enum { BYTES_EACH = 3 * 8 + 18 * 8 + (int)sizeof(char *) + 2 * 4 + 7 * 4 + 2 };

size_t fv_message_tracks_size_max(uint32_t count_max, size_t label_bytes)
{
    fovea_tracks_t empty;
    memset(&empty, 0, sizeof empty);
    return (size_t)fovea_tracks_t_encoded_size(&empty) +
           count_max * (BYTES_EACH + 4 + label_bytes + 1);
}

size_t fv_message_tracks_scratch_bytes(uint32_t count_max)
{
    return (size_t)count_max * BYTES_EACH;
}

static void lay_out(struct columns *c, void *scratch, size_t n)
{
    c->id = scratch;
    c->age_ns = c->id + n;
    c->unseen_ns = c->age_ns + n;
    c->position = (double *)(void *)(c->unseen_ns + n);
    c->velocity = c->position + 3 * n;
    c->covariance = c->velocity + 3 * n;
    c->velocity_covariance = c->covariance + 6 * n;
    c->name = (char **)(void *)(c->velocity_covariance + 6 * n);
    c->class_id = (int32_t *)(void *)(c->name + n);
    c->hits = c->class_id + n;
    for (size_t k = 0; k < 7; k++)
        c->real[k] = (float *)(void *)(c->hits + n) + k * n;
    c->state = (int8_t *)(void *)(c->real[6] + n);
    c->located = c->state + n;
}

static void fill(const struct columns *c, uint32_t i, const struct fovea_track *track,
                 const char *name, int64_t stamp_ns)
{
    const float real[7] = {track->score,    track->x_min_px, track->y_min_px, track->x_max_px,
                           track->y_max_px, track->x_px_s,   track->y_px_s};
    c->id[i] = (int64_t)track->id;
    c->age_ns[i] = stamp_ns - track->first_ns;
    c->unseen_ns[i] = stamp_ns - track->seen_ns;
    c->name[i] = (char *)name; /* lcm-gen knows no const; it only reads */
    c->class_id[i] = track->class_id;
    c->hits[i] = (int32_t)track->hits;
    c->state[i] = (int8_t)track->state;
    c->located[i] = (int8_t)track->located;
    for (int k = 0; k < 7; k++)
        c->real[k][i] = real[k];
    for (int k = 0; k < 3; k++)
        c->position[3 * i + (uint32_t)k] = track->located ? track->position_m[k] : 0.0;
    for (int k = 0; k < 3; k++)
        c->velocity[3 * i + (uint32_t)k] = track->located ? track->velocity_m_s[k] : 0.0;
    for (uint32_t k = 0; k < 6; k++) {
        c->covariance[6 * i + k] = track->located ? track->covariance_m2[k] : 0.0;
        c->velocity_covariance[6 * i + k] =
            track->located ? track->velocity_covariance_m2_s2[k] : 0.0;
    }
}

uint32_t fv_message_tracks_encode(const struct fv_message_tracks *in, void *scratch,
                                  uint8_t *buffer, size_t capacity)
{
    struct columns c;
    lay_out(&c, scratch, in->count);
    for (uint32_t i = 0; i < in->count; i++)
        fill(&c, i, &in->tracks[i], in->names[i], in->stamp.time_ns);
    const fovea_tracks_t message = {
        .stamp = in->stamp,
        .reset_counter = (int32_t)in->reset_counter,
        .width = in->width,
        .height = in->height,
        .count = (int32_t)in->count,
        .id = c.id,
        .class_id = c.class_id,
        .class_name = c.name,
        .state = c.state,
        .score = c.real[0],
        .x_min_px = c.real[1],
        .y_min_px = c.real[2],
        .x_max_px = c.real[3],
        .y_max_px = c.real[4],
        .x_px_s = c.real[5],
        .y_px_s = c.real[6],
        .age_ns = c.age_ns,
        .unseen_ns = c.unseen_ns,
        .hits = c.hits,
        .located = c.located,
        .vector_count = (int32_t)(3 * in->count),
        .position_m = c.position,
        .velocity_m_s = c.velocity,
        .matrix_count = (int32_t)(6 * in->count),
        .covariance_m2 = c.covariance,
        .velocity_covariance_m2_s2 = c.velocity_covariance,
    };
    return fv_wire_encoded(fovea_tracks_t_encode(buffer, 0, fv_wire_capacity(capacity), &message));
}

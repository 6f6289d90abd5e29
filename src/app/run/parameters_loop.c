/* Live parameters on the loop's thread: inputs of the next step, and answers behind it. */
#include <string.h>

#include "app/run/parameters_internal.h"

void fv_parameters_take(struct fv_parameters *parameters, struct fovea_inputs *inputs)
{
    parameters->taken_count = 0;
    if (parameters->taken == NULL) return; /* nothing is heard */
    while (parameters->taken_count < FV_PARAMETERS_WAITING) {
        size_t bytes;
        const uint8_t *data = fv_ring_peek(&parameters->ring, &bytes);
        if (data == NULL) return;
        struct fv_parameter_change *change = &parameters->taken[parameters->taken_count++];
        memcpy(change, data, sizeof *change);
        fv_ring_release(&parameters->ring, sizeof *change);
        if (change->bytes == 0) continue;
        memcpy((char *)&parameters->in_force + change->offset, change->raw, change->bytes);
        inputs->parameters = &parameters->in_force;
    }
}

static void answer(const struct fv_parameters *parameters, struct fv_parameter_change *change,
                   struct fv_transport *transport, struct fv_feed *feed)
{
    uint8_t data[FV_PARAMETERS_ANSWER_BYTES];
    if (!change->answered) return;
    const int bytes = fv_parameters_encode(parameters, change, data);
    if (bytes == 0) return;
    const struct fovea_message out = {parameters->channel, data, (uint32_t)bytes, true};
    fv_transport_put(transport, &out);
    fv_feed_put(feed, &out);
}

void fv_parameters_step(struct fv_parameters *parameters, struct fv_recorder *const recorders[2],
                        const struct fovea_inputs *inputs, struct fv_transport *transport,
                        struct fv_feed *feed)
{
    for (uint32_t i = 0; i < parameters->taken_count; i++) {
        struct fv_parameter_change *change = &parameters->taken[i];
        for (int n = 0; n < 2 && change->bytes > 0; n++)
            fv_recorder_parameter(recorders[n], inputs, change->key, change->value);
        answer(parameters, change, transport, feed);
    }
    parameters->taken_count = 0;
}

void fv_parameters_end(struct fv_parameters *parameters, struct fv_transport *transport,
                       struct fv_feed *feed)
{
    struct fovea_inputs none = {.frame = NULL};
    if (parameters->rt == NULL) return; /* nothing is heard */
    pthread_mutex_lock(&parameters->changing);
    for (uint32_t i = 0; i < parameters->camera_request_count; i++) {
        struct fv_parameter_change *waits = &parameters->camera_requests[i];
        fv_parameters_print_value(parameters->settings, fv_settings_key_find(waits->key),
                                  waits->value);
        fv_parameters_refuse(waits, "the run has ended");
        answer(parameters, waits, transport, feed);
    }
    parameters->camera_request_count = 0;
    pthread_mutex_unlock(&parameters->changing);
    do {
        fv_parameters_tend(parameters, true);
        fv_parameters_take(parameters, &none);
        for (uint32_t i = 0; i < parameters->taken_count; i++) {
            if (parameters->taken[i].bytes > 0)
                fv_parameters_refuse(&parameters->taken[i], "the run has ended");
            answer(parameters, &parameters->taken[i], transport, feed);
        }
    } while (parameters->taken_count > 0);
}

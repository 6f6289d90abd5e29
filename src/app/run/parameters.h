/* Live parameters of a run: requests from LCM (parameter_t) become inputs of the step after them,
 * and are answered (parameter_result_t).
 *
 * The thread of the listener judges a request, reads its value as a configuration file's, and hands
 * the change over in a ring; so the loop's thread copies bytes and nothing else. What was changed
 * with `keep` stands in a YAML file of its own, which the next start reads after the configuration:
 * the user's file is never written. The thread that watches the loop writes it, so that a slow disk
 * holds up no command; and it sets the controls of cameras, for the same reason: only
 * what a camera has taken becomes an input. */
#ifndef FOVEA_APP_RUN_PARAMETERS_H
#define FOVEA_APP_RUN_PARAMETERS_H

#include <pthread.h>
#include <stdbool.h>
#include <stdint.h>

#include "app/config/settings.h"
#include "app/config/setup.h"
#include "app/network/feed.h"
#include "app/network/receiver.h"
#include "app/network/transport.h"
#include "app/record/recorder.h"
#include "app/run/requests.h"
#include "base/ring.h"
#include "message/message.h"
#include "message/recorded.h"

enum {
    FV_PARAMETER_KEY_BYTES = 64,
    FV_PARAMETER_VALUE_BYTES = 1024,
    FV_PARAMETER_REASON_BYTES = 256,
    FV_PARAMETER_RAW_BYTES = 64, /* of the longest member: a list of words */
    FV_PARAMETERS_WAITING = FV_MESSAGE_PARAMETERS_MAX
};

/* A judged request. */
struct fv_parameter_change {
    int64_t id, sender;
    uint32_t offset, bytes; /* of the member in struct fovea_config; 0 bytes: nothing changes */
    uint8_t raw[FV_PARAMETER_RAW_BYTES];
    bool answered; /* somebody waits for the result */
    bool keep;     /* of one that waits for the camera */
    int8_t result; /* FOVEA_PARAMETER_RESULT_T_RESULT_* */
    char key[FV_PARAMETER_KEY_BYTES], value[FV_PARAMETER_VALUE_BYTES],
        reason[FV_PARAMETER_REASON_BYTES];
};

struct fv_parameters {
    const struct fovea *rt;
    const struct fovea_source_ops *ops; /* of the cameras */
    struct fovea_source *source;
    struct fovea_error unbalanced; /* why white balance would change nothing; "": it would */
    struct fv_ring ring; /* of struct fv_parameter_change, from the listener to the loop */
    void *ring_memory;
    char request_channel[FV_MESSAGE_CHANNEL_BYTES], channel[FV_MESSAGE_CHANNEL_BYTES];
    struct fv_requests *requests; /* whose gate judges */

    /* Of who changes parameters, one at a time. */
    pthread_mutex_t changing;
    struct fv_settings *settings; /* in force when all that is in the ring has been taken */
    struct fv_settings *tried;    /* the same with the request that is judged */
    /* Those of the start with all that is kept, which stand in the file's lines; the same with the
     * request that is judged; a copy for writing. */
    struct fv_settings *kept, *kept_tried, *written;
    char *kept_calibration;              /* of that file, as it is written with them; "": none */
    struct fv_parameter_change *keeping; /* requests whose values are to be written */
    uint32_t keeping_count;
    struct fv_parameter_change *camera_requests; /* requests that change a camera, in order */
    uint32_t camera_request_count;

    /* Of the thread that writes. */
    struct fv_parameter_change *answers; /* to requests whose values were written, or not */
    uint32_t answer_count, answers_passed;
    int64_t written_ns;

    /* The loop's. */
    struct fovea_config in_force;
    uint32_t taken_count; /* with the step under way */
    struct fv_parameter_change *taken;
};

/* Prepare for a runtime with these settings and the open source of `setup`; that and `requests`
 * stay the caller's. Init-only. FOVEA_ERROR_MEMORY. */
enum fovea_status fv_parameters_open(struct fv_parameters *parameters, const struct fovea *rt,
                                     const struct fv_settings *settings,
                                     const struct fv_setup *setup, struct fv_requests *requests,
                                     struct fovea_error *error);

/* The row of the receiver's table for requests. */
struct fv_receiver_channel fv_parameters_row(struct fv_parameters *parameters);

/* Change every live parameter that differs from `wanted`, in an order in which each step has values
 * that go together; `*count` of them. `named`: of those alone that have a line in `wanted`. Any
 * thread but the loop's; waits for the loop at most 2 seconds. FOVEA_ERROR_*: nothing was changed,
 * but where the loop takes nothing. */
enum fovea_status fv_parameters_reload(struct fv_parameters *parameters,
                                       const struct fv_settings *wanted, bool named,
                                       uint32_t *count, struct fovea_error *error);

/* Serve the requests that change a camera, write what is to be kept, at most once in a second
 * unless `now`, and have it answered. On a thread that may wait for the disk and the camera; after
 * the loop has ended, before fv_parameters_end, with `now`, and no camera is set any more. */
void fv_parameters_tend(struct fv_parameters *parameters, bool now);

/* Put what has come into the inputs of the next step. Loop thread, wait-free. */
void fv_parameters_take(struct fv_parameters *parameters, struct fovea_inputs *inputs);

/* The step has taken it: record it by both recorders, each of which may be NULL, before the step is
 * recorded, and answer. Loop thread, wait-free. */
void fv_parameters_step(struct fv_parameters *parameters, struct fv_recorder *const recorders[2],
                        const struct fovea_inputs *inputs, struct fv_transport *transport,
                        struct fv_feed *feed);

/* The loop has ended: answer those that no step takes any more. */
void fv_parameters_end(struct fv_parameters *parameters, struct fv_transport *transport,
                       struct fv_feed *feed);

/* After the listener has ended. */
void fv_parameters_close(struct fv_parameters *parameters);

#endif

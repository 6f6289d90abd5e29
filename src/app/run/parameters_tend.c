/* Live parameters on the thread that may wait for the camera and the disk. */
#include <stdio.h>
#include <string.h>

#include "app/config/camera_controls.h"
#include "app/config/kept_parameters.h"
#include "app/run/parameters_internal.h"
#include "drivers/clock.h"
#include "drivers/table.h"
#include "support/utf8.h"

static const int64_t keep_ns = 1000000000; /* between two writes of the file */

/* ---- requests that change a camera ----------------------------------------------------------- */

/* Take the first that waits, its value read into `tried`. False: none. */
static bool take_camera_request(struct fv_parameters *parameters,
                                struct fv_parameter_change *change,
                                char assignment[FV_PARAMETER_KEY_BYTES + FV_PARAMETER_VALUE_BYTES])
{
    if (parameters->camera_request_count == 0) return false;
    *change = parameters->camera_requests[0];
    parameters->camera_request_count--;
    memmove(parameters->camera_requests, parameters->camera_requests + 1,
            parameters->camera_request_count * sizeof *parameters->camera_requests);
    snprintf(assignment, FV_PARAMETER_KEY_BYTES + FV_PARAMETER_VALUE_BYTES, "%s=%s", change->key,
             change->value);
    *parameters->tried = *parameters->settings;
    return fv_settings_set(parameters->tried, assignment, NULL) == FOVEA_OK; /* as before */
}

/* The camera has answered: to the loop. */
static void end_camera_request(struct fv_parameters *parameters, const struct fv_settings_key *key,
                               struct fv_parameter_change *change)
{
    struct fv_parameter_change *room = fv_parameters_await_room(parameters);
    if (room == NULL) return; /* the loop stands still: nobody would send an answer */
    if (change->bytes > 0) *parameters->settings = *parameters->tried;
    fv_parameters_print_value(parameters->settings, key, change->value);
    if (change->keep && change->bytes > 0) fv_parameters_keep(parameters, change);
    *room = *change;
    fv_ring_commit(&parameters->ring, sizeof *room);
}

/* False: there is none, or the camera does not answer. */
static bool serve_camera_request(struct fv_parameters *parameters)
{
    char assignment[FV_PARAMETER_KEY_BYTES + FV_PARAMETER_VALUE_BYTES];
    struct fv_parameter_change change;
    struct fovea_error said;
    enum fovea_source_control control;
    pthread_mutex_lock(&parameters->changing);
    const bool any = take_camera_request(parameters, &change, assignment);
    const struct fv_settings_key *key = any ? fv_settings_key_find(change.key) : NULL;
    const bool one = key != NULL && fv_camera_control(key, &control);
    const double before = one ? fv_camera_control_value(parameters->settings, control) : 0,
                 value = one ? fv_camera_control_value(parameters->tried, control) : 0;
    pthread_mutex_unlock(&parameters->changing);
    if (!one) return false;
    const enum fovea_status status =
        fv_source_control(parameters->ops, parameters->source, control, value, &said);
    pthread_mutex_lock(&parameters->changing);
    *parameters->tried = *parameters->settings;
    if (status != FOVEA_OK) {
        fv_parameters_refuse(&change, said.text);
    } else if (change.keep && !fv_parameters_try_to_keep(parameters, assignment, &change)) {
        (void)fv_source_control(parameters->ops, parameters->source, control, before, &said);
    } else {
        (void)fv_settings_set(parameters->tried, assignment, NULL);
        fv_parameters_describe(parameters, key, &change);
        snprintf(change.reason, sizeof change.reason, "%.255s", said.text);
        fv_utf8_cut(change.reason);
    }
    end_camera_request(parameters, key, &change);
    pthread_mutex_unlock(&parameters->changing);
    return status != FOVEA_AGAIN;
}

/* ---- what is kept ---------------------------------------------------------------------------- */

/* Take what is to be written; false: nothing, or too soon after the last time. */
static bool take_kept(struct fv_parameters *parameters, bool now)
{
    const int64_t now_ns = fv_clock_ns(CLOCK_MONOTONIC);
    pthread_mutex_lock(&parameters->changing);
    const bool due =
        parameters->keeping_count > 0 && (now || now_ns - parameters->written_ns >= keep_ns);
    if (due) {
        parameters->answer_count = parameters->keeping_count;
        memcpy(parameters->answers, parameters->keeping,
               parameters->keeping_count * sizeof *parameters->keeping);
        parameters->keeping_count = 0;
        *parameters->written = *parameters->kept;
        parameters->answers_passed = 0;
        parameters->written_ns = now_ns;
    }
    pthread_mutex_unlock(&parameters->changing);
    return due;
}

static void write_kept(struct fv_parameters *parameters)
{
    struct fovea_error error;
    char reason[FV_PARAMETER_REASON_BYTES];
    const char *path = parameters->settings->parameters_file;
    if (fv_kept_parameters_write(parameters->written, parameters->kept_calibration, path, &error) ==
        FOVEA_OK)
        return;
    snprintf(reason, sizeof reason, "not kept for the next start: %.200s", error.text);
    for (uint32_t i = 0; i < parameters->answer_count; i++)
        fv_parameters_refuse(&parameters->answers[i], reason);
}

/* To the loop, which sends answers; those that find no room wait. */
static void pass_answers(struct fv_parameters *parameters)
{
    pthread_mutex_lock(&parameters->changing);
    while (parameters->answers_passed < parameters->answer_count) {
        void *room = fv_ring_reserve(&parameters->ring, sizeof(struct fv_parameter_change));
        if (room == NULL) break;
        memcpy(room, &parameters->answers[parameters->answers_passed++],
               sizeof(struct fv_parameter_change));
        fv_ring_commit(&parameters->ring, sizeof(struct fv_parameter_change));
    }
    pthread_mutex_unlock(&parameters->changing);
}

void fv_parameters_tend(struct fv_parameters *parameters, bool now)
{
    if (parameters->rt == NULL) return;
    while (!now && serve_camera_request(parameters))
        continue;
    if (parameters->answers_passed == parameters->answer_count && take_kept(parameters, now))
        write_kept(parameters);
    pass_answers(parameters);
}

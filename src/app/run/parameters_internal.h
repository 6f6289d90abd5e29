/* What the three threads of live parameters share (parameters.h): the listener's (parameters.c),
 * the one that may wait for cameras and the disk (parameters_tend.c), and the loop's
 * (parameters_loop.c). */
#ifndef FOVEA_APP_RUN_PARAMETERS_INTERNAL_H
#define FOVEA_APP_RUN_PARAMETERS_INTERNAL_H

#include "app/config/settings.h"
#include "app/run/parameters.h"

enum { FV_PARAMETERS_ANSWER_BYTES = 1536 };

void fv_parameters_print_value(const struct fv_settings *settings,
                               const struct fv_settings_key *key,
                               char value[FV_PARAMETER_VALUE_BYTES]);

void fv_parameters_refuse(struct fv_parameter_change *change, const char *reason);

/* An answer as a message; 0: it does not fit. */
int fv_parameters_encode(const struct fv_parameters *parameters, struct fv_parameter_change *change,
                         uint8_t data[FV_PARAMETERS_ANSWER_BYTES]);

/* ---- with `changing` locked ------------------------------------------------------------------ */

/* The value tried as an input of the loop. */
void fv_parameters_describe(const struct fv_parameters *parameters,
                            const struct fv_settings_key *key, struct fv_parameter_change *change);

/* The value among those of the next start, if it goes with them. False: refused. */
bool fv_parameters_try_to_keep(struct fv_parameters *parameters, const char *assignment,
                               struct fv_parameter_change *change);

/* To be written; the answer comes after that. */
void fv_parameters_keep(struct fv_parameters *parameters, struct fv_parameter_change *change);

/* Room in the ring, for which the loop is waited for. NULL: it takes nothing for 2 s. */
struct fv_parameter_change *fv_parameters_await_room(struct fv_parameters *parameters);

#endif

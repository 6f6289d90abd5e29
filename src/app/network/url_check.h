/* Whether a URL of LCM is well-formed. Init-only. */
#ifndef FOVEA_APP_NETWORK_URL_CHECK_H
#define FOVEA_APP_NETWORK_URL_CHECK_H

#include "fovea/status.h"

/* FOVEA_ERROR_INPUT: it is not; `error` starts with "lcm_url:". */
enum fovea_status fv_transport_url_check(const char *url, struct fovea_error *error);

#endif

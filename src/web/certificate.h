/* The certificate of the page, for HTTPS: PEM files as any authority gives them, or one that signs
 * itself, made by libcrypto. Init-only. */
#ifndef FOVEA_WEB_CERTIFICATE_H
#define FOVEA_WEB_CERTIFICATE_H

#include <stdbool.h>

#include "fovea/status.h"

struct fv_web_certificate {
    const char *file, *key_file; /* PEM; NULL: none, plain HTTP */
};

/* Whether both files are there, can be read and belong together, and others than the owner and its
 * group cannot read the key. FOVEA_ERROR_INPUT: one line with what was found. */
enum fovea_status fv_web_certificate_check(const struct fv_web_certificate *certificate,
                                           struct fovea_error *error);

/* Make the certificate where its file is not there, and the key on the curve P-256 where that is
 * not there either, as at an interrupted first start: a certificate that signs itself, for `names`,
 * `address` (an IPv4 address; 0.0.0.0: none), localhost and 127.0.0.1, from a day ago, since clocks
 * of robots are wrong at times, for 825 days, the most that all browsers take. The key is for its
 * owner alone (0600). `made`: whether it was. */
enum fovea_status fv_web_certificate_make(const struct fv_web_certificate *certificate,
                                          const char *const *names, int name_count,
                                          const char *address, bool *made,
                                          struct fovea_error *error);

#endif

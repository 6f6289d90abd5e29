/* Commands of a page, to the run, over LCM: the answer comes back through the feed. */
#ifndef FOVEA_WEB_COMMAND_H
#define FOVEA_WEB_COMMAND_H

#include <stdbool.h>
#include <stdint.h>

#include "app/config/kept_parameters.h"
#include "app/network/siphash.h"
#include "app/network/transport.h"

enum { FV_WEB_SENDER = 7670 }; /* the number that fovea-web has among those with one key */

struct fv_web_commander {
    struct fv_transport *transport; /* NULL: no commands */
    bool keyed;
    uint8_t key[FV_SIPHASH_KEY_BYTES];
    int64_t id;
};

/* `url` as the run's lcm_url, "": no commands; `key`: the file of its command_key, NULL: none.
 * Init-only. */
enum fovea_status fv_web_commander_open(struct fv_web_commander *commander, const char *url,
                                        const char *key, struct fovea_error *error);

/* Send bits of command_t to the run. Returns the number by which command_result_t answers. */
int64_t fv_web_commander_send(struct fv_web_commander *commander, const char *prefix,
                              int64_t run_id, int32_t bits);

/* Send a parameter_t, `value` "": to ask for it. Returns the number by which parameter_result_t
 * answers. */
int64_t fv_web_commander_set(struct fv_web_commander *commander, const char *prefix, int64_t run_id,
                             const char *key, const char *value, bool keep);

/* Send a settings_t of at most FV_KEPT_BYTES_MAX, `text` "": to ask for them. Returns the
 * number by which settings_result_t answers; 0: no memory. */
int64_t fv_web_commander_settings(struct fv_web_commander *commander, const char *prefix,
                                  int64_t run_id, const char *text);

/* Send a map_load_t, `file` "": to ask for the list. Returns the number by which command_result_t
 * or map_files_t answers. */
int64_t fv_web_commander_map(struct fv_web_commander *commander, const char *prefix, int64_t run_id,
                             const char *file);

void fv_web_commander_close(struct fv_web_commander *commander);

#endif

/* `fovea run --web`: the program fovea-web as a child, beside the run. */
#ifndef FOVEA_APP_RUN_WEB_PAGE_H
#define FOVEA_APP_RUN_WEB_PAGE_H

#include <sys/types.h>

#include "app/config/settings.h"

/* Start it at `port` ("": its own), for the feed that the settings name, or one in a folder of the
 * user if they name none. NULL: nothing. `*child` is its process, 0: none. FOVEA_ERROR_INPUT: the
 * port is none, or the program is not there. Before any thread. Init-only. */
enum fovea_status fv_web_page_start(const char *port, struct fv_settings *settings, pid_t *child,
                                    struct fovea_error *error);
/* Say that it has ended by itself, once; `*child` is then 0. */
void fv_web_page_tend(pid_t *child);
/* End it. */
void fv_web_page_end(pid_t child);

#endif

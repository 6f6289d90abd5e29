#include "app/network/run_id.h"

#include <errno.h>
#include <string.h>
#include <sys/random.h>

enum fovea_status fv_run_id_make(int64_t *run_id, struct fovea_error *error)
{
    *run_id = 0;
    while (*run_id == 0) {
        const ssize_t got = getrandom(run_id, sizeof *run_id, 0);
        if (got == (ssize_t)sizeof *run_id) continue;
        *run_id = 0;
        if (got < 0 && errno != EINTR)
            return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "no random number for the run: %s",
                                   strerror(errno));
    }
    return FOVEA_OK;
}
